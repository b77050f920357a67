"""Eq. (25) and the limits of an error model."""

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.study import ErrorModel
from hexafix.study.error_model import installation_maps
from hexafix.study.layouts import RingLayouts


def test_equation_25_is_the_change_of_polar_coordinates():
    rng = np.random.default_rng(1)
    layouts = RingLayouts.of(rng.uniform(0, 360, (2, 4)))
    deviation = rng.normal(size=(2, 4, 3)) * 1e-4
    moved = layouts.points_mm + deviation
    radius = np.hypot(moved[..., 0], moved[..., 1])
    sweep = np.arctan2(moved[..., 1], moved[..., 0])
    turned = np.angle(np.exp(1j * (sweep - layouts.sweep_rad)))
    exact = np.stack([radius - layouts.radius_mm, turned, deviation[..., 2]], -1)
    stated = np.einsum("gnij,gnj->gni", installation_maps(layouts), deviation)
    assert np.abs(stated - exact).max() < 1e-9


def test_the_default_is_the_papers_error_model():
    model = ErrorModel()
    assert model.image_sigma_mm == (0.3, 0.3, 0.3)
    assert model.installation_sigma_mm == pytest.approx((0.4 / 6,) * 3)
    assert model.variance_mm2 == pytest.approx(0.09 + (0.4 / 6) ** 2)


@pytest.mark.parametrize(
    ("image", "place"),
    [
        ((0.3, -0.05, 0.3), (0.1, 0.1, 0.1)),
        ((0.3, np.nan, 0.3), (0.1, 0.1, 0.1)),
        ((0.3, np.inf, 0.3), (0.1, 0.1, 0.1)),
        ((0.3, 0.0, 0.3), (0.1, 0.0, 0.1)),
    ],
)
def test_an_impossible_error_is_refused(image, place):
    with pytest.raises(InputError, match="each axis needs"):
        ErrorModel(image, place)
