import numpy as np
import pytest
from hexafix.accuracy.jacobian import (
    expected_errors,
    group_covariance,
    isotropic_covariances,
    least_squares_covariance,
    paper_covariance,
    paper_jacobian,
    volume_error,
)
from hexafix.geometry import Pose, angles_xyz_fixed_from_matrix
from hexafix.hardware import MarkerLayout, MarkerSite
from hexafix.recognition import ring_pose, ring_poses
from hexafix.recognition.groups import marker_groups, paper_group_pose, ring_poses_by_groups

DEGREES = np.array([1, 1, 1, *[180 / np.pi] * 3])

# Expected |error| in mm and degrees, 200 000 samples: the paper's method, then least squares.
NOTES = {
    3: ((0.163, 0.163, 0.142, 0.112, 0.112, 0.081), (0.147, 0.147, 0.141, 0.115, 0.115, 0.081)),
    4: ((0.154, 0.154, 0.123, 0.097, 0.097, 0.071), (0.128, 0.127, 0.122, 0.099, 0.099, 0.070)),
    6: ((0.115, 0.115, 0.100, 0.079, 0.080, 0.057), (0.104, 0.104, 0.100, 0.081, 0.081, 0.057)),
    8: ((0.109, 0.109, 0.087, 0.068, 0.069, 0.050), (0.090, 0.090, 0.087, 0.070, 0.070, 0.050)),
    10: ((0.092, 0.092, 0.077, 0.061, 0.062, 0.044), (0.081, 0.081, 0.078, 0.063, 0.063, 0.044)),
}


def even(layout_at, count: int) -> MarkerLayout:
    return layout_at(np.arange(count) * 360 / count)


@pytest.mark.parametrize("count", NOTES)
def test_expected_errors_of_even_layouts_are_those_of_the_notes(layout_at, count):
    layout = even(layout_at, count)
    paper, fitted = NOTES[count]
    assert expected_errors(paper_covariance(layout)) * DEGREES == pytest.approx(paper, rel=0.02)
    assert expected_errors(least_squares_covariance(layout)) * DEGREES == pytest.approx(
        fitted, rel=0.02
    )


def test_equation_26_as_printed_is_met_within_nine_percent(layout_at):
    printed = (0.165, 0.164, 0.137, 0.103, 0.106, 0.079)
    found = expected_errors(paper_covariance(even(layout_at, 3))) * DEGREES
    assert found == pytest.approx(printed, rel=0.09)


@pytest.mark.parametrize(
    ("sweeps", "mm", "deg"), [((0, 120, 240), 0.269, 0.179), ((0, 45, 90), 0.909, 0.617)]
)
def test_volume_errors_of_the_best_and_the_worst_allowed_layout(layout_at, sweeps, mm, deg):
    position, orientation = volume_error(paper_covariance(layout_at(sweeps)))
    assert position == pytest.approx(mm, rel=0.03)
    assert np.degrees(orientation) == pytest.approx(deg, rel=0.03)


def test_a_height_error_tilts_the_ring_in_truth_though_not_in_the_paper_model(layout_at):
    layout = even(layout_at, 3)
    linear = expected_errors(paper_covariance(layout))[3]
    full = expected_errors(group_covariance(layout))[3]
    assert np.degrees(linear) == pytest.approx(0.112, abs=0.001)
    assert np.degrees(full) == pytest.approx(0.115, abs=0.001)


def paper_mean(points: np.ndarray, layout: MarkerLayout) -> np.ndarray:
    """X of the mended paper road, Eq. (19) on the angles, near the identity."""
    poses = [paper_group_pose(points, layout, g) for g in marker_groups(layout)]
    p = np.mean([pose.position_mm for pose in poses], axis=0)
    return np.concatenate([p, np.mean([pose.angles_rad for pose in poses], axis=0)])


@pytest.mark.parametrize("column", range(6))
@pytest.mark.parametrize("count", [3, 4, 7])
def test_paper_jacobian_agrees_with_finite_differences(layout_at, count, column):
    rng = np.random.default_rng(count)
    sweeps = np.arange(count) * 360 / count + rng.uniform(-15, 15, count)
    layout = layout_at(sweeps, radius_mm=rng.uniform(80, 110, count))
    points, jacobian = layout.points_mm, paper_jacobian(layout)
    step = 1e-5 if column != 4 else 1e-7
    for marker in range(count):
        ends = []
        for sign in (1, -1):
            moved, sites = np.array(points), list(layout.sites)
            if column < 3:
                moved[marker, column] += sign * step
            else:
                site = sites[marker]
                eta = np.array([site.radius_mm, site.sweep_rad, site.height_mm])
                eta[column - 3] += sign * step
                sites[marker] = MarkerSite(site.number, *eta.tolist())
            if column == 5:
                # The paper's Eq. (9) takes no heights: only Eq. (18) sees them.
                heights = np.array([s.height_mm for s in sites])
                first = marker_groups(layout)[:, 0]
                ends.append(np.array([0, 0, -heights[first].mean(), 0, 0, 0]))
            else:
                ends.append(paper_mean(moved, MarkerLayout(tuple(sites))))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(slope - jacobian[:, marker, column]).max() < 1e-6


def test_covariances_of_both_methods_agree_with_monte_carlo(layout_at):
    layout = layout_at([0, 70, 190, 260], height_mm=[20, -30, 25, 10], radius_mm=[90, 100, 95, 110])
    rng = np.random.default_rng(8)
    built = layout.points_mm + 0.1 * rng.normal(size=(12_000, 4, 3))
    points = built + 0.2 * rng.normal(size=built.shape)
    errors = {"sigma_image_mm": 0.2, "sigma_installation_mm": 0.1}
    for stated, (rotation, position) in (
        (least_squares_covariance(layout, **errors), ring_poses(points, layout)[:2]),
        (group_covariance(layout, **errors), ring_poses_by_groups(points, layout)),
    ):
        angles = angles_xyz_fixed_from_matrix(rotation)
        errors_met = np.concatenate([position, angles], axis=1)
        scale = np.sqrt(np.outer(np.diag(stated), np.diag(stated)))
        assert np.abs(np.cov(errors_met.T) / scale - stated / scale).max() < 0.05
        met = np.abs(errors_met).mean(axis=0)
        assert expected_errors(stated) == pytest.approx(met, rel=0.03)


def test_least_squares_is_never_worse_than_the_group_method(layout_at):
    rng = np.random.default_rng(9)
    for _ in range(20):
        layout = layout_at(
            rng.permutation(np.arange(5) * 72 + rng.uniform(-20, 20, 5)),
            height_mm=rng.uniform(-30, 30, 5),
        )
        gap = group_covariance(layout) - least_squares_covariance(layout)
        scale = np.sqrt(np.diag(group_covariance(layout)))
        assert np.linalg.eigvalsh(gap / np.outer(scale, scale)).min() > -1e-9


def test_the_batch_for_searches_gives_the_same_covariance(layout_at):
    layouts = [layout_at(s) for s in ([0, 105, 225], [0, 60, 200])]
    batch = isotropic_covariances(np.array([one.points_mm for one in layouts]), 0.3)
    for one, found in zip(layouts, batch, strict=True):
        expected = least_squares_covariance(one, sigma_image_mm=0.3, sigma_installation_mm=0.0)
        assert np.allclose(found, expected, rtol=1e-9, atol=1e-15)


def test_ball_covariances_and_installation_per_axis_are_used(layout_at):
    layout = layout_at([0, 105, 225])
    covariances = np.tile(np.diag([0.01, 0.04, 0.09]), (3, 1, 1))
    sigma = (0.02, 0.05, 0.3)
    expected = ring_pose(
        layout.points_mm, layout, covariances_mm2=covariances, installation_sigma_mm=sigma
    ).covariance
    errors = {"covariances_mm2": covariances, "sigma_installation_mm": sigma}
    assert np.allclose(least_squares_covariance(layout, **errors), expected)
    summed = np.tile(np.diag(np.array([0.01, 0.04, 0.09]) + np.square(sigma)), (3, 1, 1))
    plain = group_covariance(layout, covariances_mm2=summed, sigma_installation_mm=0.0)
    assert np.allclose(group_covariance(layout, **errors), plain)


def test_the_error_model_is_that_of_a_ring_anywhere(layout_at):
    layout = layout_at([0, 105, 225])
    pose = Pose.from_xyz_fixed(position_mm=[300, -40, 90], angles_rad=[0.4, -1.0, 2.5])
    there = ring_pose(pose.apply(layout.points_mm), layout).covariance
    assert np.allclose(there, least_squares_covariance(layout), rtol=1e-8, atol=1e-14)
