from __future__ import annotations

import numpy as np
import pytest
from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.markers.crop import Crop
from hexafix.markers.directions import neighbour_average, sphere_directions
from hexafix.markers.model import _ball_and_slopes, fit_model
from hexafix.markers.rays import DIRECTIONS, fine_fit, half_sample_mode, rough_fit
from hexafix.markers.search import candidate_centers
from hexafix.markers.uncertainty import _harmonics
from hexafix.progress import silent


def both_fits(volume, truth):
    start = truth.center_mm + np.array([0.2, -0.1, 0.1])
    crop = Crop.around(volume, start, truth.diameter_mm / 2 + 4.5)
    rays = fine_fit(crop, rough_fit(crop, start, truth.diameter_mm / 2), truth.diameter_mm / 2)
    return crop, rays


def test_directions_are_unit_antipodal_and_even():
    for count in (26, 200, DIRECTIONS):
        directions = sphere_directions(count)
        np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1.0)
        np.testing.assert_array_equal(directions[: count // 2], -directions[count // 2 :])
        np.testing.assert_allclose(directions.T @ directions / count, np.eye(3) / 3, atol=0.03)


def test_neighbour_average_keeps_a_constant():
    average = neighbour_average(200, 0.2)
    np.testing.assert_allclose(average @ np.full(200, 7.0), 7.0)


def test_harmonics_are_orthonormal_over_the_directions():
    rows = _harmonics()
    np.testing.assert_allclose(rows.T @ rows / DIRECTIONS, np.eye(16), atol=0.03)


def test_half_sample_mode_finds_the_crowd_not_the_middle():
    values = np.concatenate([np.full(40, -1000.0), np.linspace(0, 2000, 45)])
    assert half_sample_mode(values) == pytest.approx(-1000.0)


def test_the_model_is_the_blurred_ball_and_its_slopes_its_derivatives():
    points = 6.0 * np.random.default_rng(0).uniform(-1, 1, (200, 3))
    points = points[np.linalg.norm(points, axis=1) > 2.5]
    axis = np.array([0.6, 0.0, 0.8])
    nodes, weights = np.polynomial.legendre.leggauss(5)
    point_like = np.zeros(1), np.ones(1)
    state = np.array([0.1, -0.2, 0.05, 5.0, 0.6, 0.6])
    share, _ = _ball_and_slopes(points, state, axis, *point_like)
    away = np.linalg.norm(points - state[:3], axis=1)
    np.testing.assert_allclose(share, blurred_ball(away, radius_mm=5.0, sigma_mm=0.6), atol=1e-6)

    state[5] = 0.9
    _, slope = _ball_and_slopes(points, state, axis, 0.6 * nodes, 0.5 * weights)
    # The blur is taken constant while the direction turns, so the centre is checked loosely.
    for parameter, tolerance in enumerate((0.03, 0.03, 0.03, 1e-6, 1e-6, 1e-6)):
        step = np.zeros(6)
        step[parameter] = 1e-5
        high, _ = _ball_and_slopes(points, state + step, axis, 0.6 * nodes, 0.5 * weights)
        low, _ = _ball_and_slopes(points, state - step, axis, 0.6 * nodes, 0.5 * weights)
        np.testing.assert_allclose((high - low) / 2e-5, slope[:, parameter], atol=tolerance)


def test_rays_and_model_agree_and_measure_the_radius(crop_with_ball):
    volume, truth = crop_with_ball(2, noise_hu=10.0)
    crop, rays = both_fits(volume, truth)
    cut = sphere_directions(DIRECTIONS)[rays.cut]
    model = fit_model(crop, rays.center_mm, 5.0, cut=cut, clip_hu=None)
    assert np.linalg.norm(rays.center_mm - truth.center_mm) < 0.01
    assert np.linalg.norm(model.center_mm - truth.center_mm) < 0.01
    assert model.radius_mm == pytest.approx(5.0, abs=0.01)
    assert rays.radius_mm == pytest.approx(5.0, abs=0.1)
    assert model.contrast_hu == pytest.approx(3300.0, rel=0.01)


def test_the_rods_side_and_its_antipode_are_cut(crop_with_ball):
    volume, truth = crop_with_ball(6)
    _, rays = both_fits(volume, truth)
    cosine = sphere_directions(DIRECTIONS) @ truth.rod_direction
    assert rays.cut[np.abs(cosine) > np.cos(0.5)].all()
    assert not rays.cut[np.abs(cosine) < np.cos(1.2)].any()
    assert np.isnan(rays.residual_mm[rays.cut]).all()


def test_without_a_rod_nothing_is_cut(crop_with_ball):
    volume, truth = crop_with_ball(6, rod_diameter_mm=0.0)
    _, rays = both_fits(volume, truth)
    assert not rays.cut.any()


def test_rays_on_the_rods_side_would_pull_the_centre_along_it(crop_with_ball, monkeypatch):
    scenes = [crop_with_ball(30 + seed, rod_diameter_mm=6.0, rod_hu=200.0) for seed in range(4)]

    def pull() -> float:
        fits = [(both_fits(*scene)[1], scene[1]) for scene in scenes]
        return float(np.mean([(f.center_mm - t.center_mm) @ t.rod_direction for f, t in fits]))

    cut = pull()
    monkeypatch.setattr(
        "hexafix.markers.rays._bright_side",
        lambda shell, outside, core_hu: np.zeros(len(shell), bool),
    )
    assert abs(cut) < 0.006
    assert pull() > 3.0 * abs(cut)


def test_the_first_look_is_right_to_about_a_voxel(crop_with_ball):
    volume, truth = crop_with_ball(12, ring_gap_mm=1.0, half_width_mm=14.0)
    centers, radii = candidate_centers(volume, ball_diameter_mm=10.0, progress=silent)
    nearest = int(np.argmin(np.linalg.norm(centers - truth.center_mm, axis=1)))
    assert np.linalg.norm(centers[nearest] - truth.center_mm) < 0.7
    assert radii[nearest] == pytest.approx(5.0, abs=0.5)
