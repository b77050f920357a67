"""J of Eq. (20)-(22) against the hand-derived one, the recognition and the paper's own steps."""

import numpy as np
import pytest
from hexafix.accuracy.jacobian import (
    group_covariance,
    least_squares_covariance,
    paper_covariance,
    paper_jacobian,
)
from hexafix.recognition.group_pose import group_jacobian
from hexafix.recognition.groups import ring_poses_by_groups
from hexafix.study import ErrorModel
from hexafix.study.error_model import absolute_covariances, error_maps, exact_covariances
from hexafix.study.jacobians import (
    finite_differences,
    jacobian_check,
    least_squares_road,
    model_jacobians,
)
from hexafix.study.layouts import RingLayouts, even_layout

ANISOTROPIC = ErrorModel((0.1, 0.2, 0.5), (0.05, 0.02, 0.1))


def random_layouts(markers, count=3):
    rng = np.random.default_rng(markers)
    even = np.arange(markers) * 2 * np.pi / markers
    sweep = even + rng.uniform(-0.25, 0.25, (count, markers))
    return RingLayouts(rng.uniform(80, 110, sweep.shape), sweep, rng.uniform(-30, 30, sweep.shape))


@pytest.mark.parametrize("markers", [3, 4, 7, 10])
def test_many_layouts_at_once_give_the_matrices_of_one(markers):
    layouts = random_layouts(markers)
    flat = RingLayouts(layouts.radius_mm, layouts.sweep_rad, np.full_like(layouts.sweep_rad, 20.0))
    tilted = model_jacobians(layouts, ErrorModel())
    level = model_jacobians(flat, ErrorModel())
    for g in range(len(layouts)):
        assert np.allclose(tilted[g, 1, :, :, :3], group_jacobian(layouts.layout(g)), atol=1e-13)
        assert np.allclose(level[g, 0], paper_jacobian(flat.layout(g)), atol=1e-12)


@pytest.mark.parametrize("errors", [ErrorModel(), ANISOTROPIC])
@pytest.mark.parametrize("markers", [3, 5, 8])
def test_every_model_agrees_with_finite_differences_of_the_recognition(markers, errors):
    assert max(jacobian_check(random_layouts(markers), errors).values()) < 2e-8


def test_the_check_sees_a_wrong_column():
    layouts = random_layouts(4, count=1)
    found = finite_differences(layouts.layout(0), ring_poses_by_groups)
    paper, groups, _ = model_jacobians(layouts, ErrorModel())[0]
    assert np.abs(found - groups).max() < 1e-5
    # an error of a height tilts the ring in truth, and not in the paper's model
    assert np.abs(found - paper)[3:, :, 5].max() > 1e-4


@pytest.mark.parametrize("method", [1, 2])
def test_what_j_leaves_out_is_of_second_order(method):
    layouts = random_layouts(5, count=1)
    layout = layouts.layout(0)
    jacobian = model_jacobians(layouts, ANISOTROPIC)[0, method][..., :3].reshape(6, -1)
    road = ring_poses_by_groups if method == 1 else least_squares_road(ANISOTROPIC)
    direction = np.random.default_rng(2).normal(size=(5, 3))
    rest = []
    for size in (0.4, 0.2):
        balls = layout.points_mm + size * direction
        position = road(balls[None], layout)[1][0]
        rest.append(np.linalg.norm(position - jacobian[:3] @ (size * direction).ravel()))
    assert rest[0] > 1e-5
    assert rest[0] / rest[1] == pytest.approx(4.0, rel=0.05)


def test_exact_covariances_are_those_of_the_accuracy_room():
    layouts = random_layouts(6)
    level = RingLayouts(layouts.radius_mm, layouts.sweep_rad, np.full_like(layouts.sweep_rad, 20.0))
    errors = ErrorModel()
    found = exact_covariances(error_maps(model_jacobians(level, errors), level, errors))
    for g in range(len(level)):
        layout = level.layout(g)
        for m, covariance in enumerate((paper_covariance, group_covariance)):
            assert np.allclose(found[g, m], covariance(layout), rtol=1e-9, atol=1e-15)
        assert np.allclose(found[g, 2], least_squares_covariance(layout), rtol=1e-9, atol=1e-15)


def test_weights_lower_the_error_where_the_axes_differ():
    layouts = random_layouts(6)
    maps = error_maps(model_jacobians(layouts, ANISOTROPIC), layouts, ANISOTROPIC)
    unweighted = model_jacobians(layouts, ErrorModel())
    plain = error_maps(unweighted, layouts, ANISOTROPIC)
    weighted, equal = exact_covariances(maps)[:, 2], exact_covariances(plain)[:, 2]
    scale = np.sqrt(np.diagonal(equal, axis1=1, axis2=2))
    gap = (equal - weighted) / (scale[:, :, None] * scale[:, None, :])
    assert np.linalg.eigvalsh(gap).min() > -1e-9
    assert np.abs(gap).max() > 0.01


def test_the_paper_moves_a_height_by_equation_18_alone():
    jacobian = model_jacobians(even_layout(5), ErrorModel())[0, 0]
    assert np.array_equal(jacobian[2, :, 5], np.full(5, -0.2))
    assert not np.any(np.delete(jacobian[:, :, 5], 2, axis=0))


def test_the_covariance_of_absolute_values_is_the_sampled_one():
    rng = np.random.default_rng(3)
    root = rng.normal(size=(6, 6)) * [1, 2, 3, 0.1, 0.2, 0.3]
    covariance = root.T @ root
    values = np.abs(rng.normal(size=(200_000, 6)) @ root)
    stated = absolute_covariances(covariance)
    scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
    assert np.abs((np.cov(values.T) - stated) / scale).max() < 0.02
