"""The balls are exact: against brute force, by their moments, and in a whole volume."""

import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.phantom import make_phantom
from hexafix.phantom.balls import ExactBall, ball_share
from hexafix.phantom.solids import Grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.ndimage import gaussian_filter, uniform_filter

RADIUS = 5.0


def ranges(grid: Grid) -> tuple[range, range, range]:
    i, j, k = (range(n) for n in grid.size_ijk)
    return i, j, k


def positions(grid: Grid) -> np.ndarray:
    index = np.stack(np.meshgrid(*[np.arange(n) for n in grid.size_ijk], indexing="ij"), -1)
    points = index @ grid.ijk_to_lps[:3, :3].T + grid.ijk_to_lps[:3, 3]
    return points.transpose(2, 1, 0, 3)


@pytest.mark.parametrize(
    ("spacing", "thickness"),
    [((0.7, 0.7, 0.5), 0.5), ((0.5, 0.9, 1.3), 2.5), ((0.7, 0.7, 3.1), 3.1)],
)
def test_a_voxel_holds_what_supersampling_and_numeric_convolution_give(
    a_grid, spacing: tuple[float, float, float], thickness: float
) -> None:
    fine, sigma = 0.1, 0.5
    center = np.array([0.13, -0.22, 0.31])
    grid = a_grid(spacing, 8.0, thickness_mm=thickness)
    half = 110
    axis = np.arange(-half, half + 1) * fine
    r = np.sqrt(
        (axis[:, None, None] - center[2]) ** 2
        + (axis[None, :, None] - center[1]) ** 2
        + (axis[None, None, :] - center[0]) ** 2
    ).astype(np.float32)
    # antialiased indicator of the ball, then the blur and the voxel box as plain filters
    numeric = np.clip(0.5 + (RADIUS - r) / fine, 0.0, 1.0)
    numeric = gaussian_filter(numeric, sigma / fine, truncate=6.0)
    for axis_number, width in ((0, thickness), (1, spacing[1]), (2, spacing[0])):
        n = round(width / fine)
        # an even box has no middle: the mean of the two neighbours is centred
        assert n % 2, "an even box has no middle on the fine grid"
        numeric = uniform_filter(numeric, [n if a == axis_number else 1 for a in range(3)])
    points = positions(grid)
    nearest = np.rint(points / fine).astype(int) + half
    on_grid = np.all(np.abs(points / fine - np.rint(points / fine)) < 1e-6, axis=-1)
    expected = numeric[nearest[..., 2], nearest[..., 1], nearest[..., 0]]
    share = ball_share(ExactBall(center, RADIUS, 2300.0), grid, *ranges(grid))
    assert on_grid.sum() > 1000
    # the fine grid itself is good to 1 µm of edge: 8e-4 of the ball's density
    np.testing.assert_allclose(share[on_grid], expected[on_grid], atol=8e-4)


@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    offset=st.tuples(*[st.floats(-0.7, 0.7)] * 3),
    angles=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    spacing=st.tuples(st.floats(0.4, 0.9), st.floats(0.4, 0.9), st.floats(0.4, 1.5)),
    sigma=st.floats(0.45, 0.8),
    overlap=st.sampled_from([1.0, 2.0]),
)
def test_first_moment_of_a_ball_is_its_centre_within_a_micrometre(
    a_grid, offset, angles, spacing, sigma, overlap
) -> None:
    # the sum over a grid of samples is exact for widths that are whole multiples of the pitch
    grid = a_grid(spacing, 11.0, angles, thickness_mm=overlap * spacing[2], sigma_mm=sigma)
    center = np.array(offset)
    share = ball_share(ExactBall(center, RADIUS, 2300.0), grid, *ranges(grid))
    moment = np.tensordot(share, positions(grid), 3) / share.sum()
    np.testing.assert_allclose(moment, center, atol=1e-3)
    voxel = float(np.prod(spacing))
    assert share.sum() * voxel == pytest.approx(4 / 3 * np.pi * RADIUS**3, rel=1e-5)


def test_a_point_sample_differs_from_the_voxel_average(a_grid) -> None:
    grid = a_grid((0.7, 0.7, 2.0), 8.0)
    points = positions(grid)
    point = blurred_ball(np.linalg.norm(points, axis=-1), radius_mm=RADIUS, sigma_mm=0.5)
    share = ball_share(ExactBall(np.zeros(3), RADIUS, 2300.0), grid, *ranges(grid))
    assert np.abs(share - point).max() > 0.05


@pytest.mark.parametrize("number", [1, 4, 6])
def test_balls_of_a_volume_lie_where_the_truth_says(a_crop, number: int) -> None:
    spec = a_crop(number, rod_diameter_mm=0.0, spacing_mm=(0.5, 0.8, 0.7))
    phantom = make_phantom(spec)
    volume = phantom.volume
    truth = {ball["number"]: np.array(ball["center_mm"]) for ball in phantom.truth["balls"]}
    i, j, k = volume.size_ijk
    index = np.stack(np.meshgrid(range(i), range(j), range(k), indexing="ij"), -1)
    points = volume.lps_from_ijk(index)
    share = volume.voxels.transpose(2, 1, 0) + 1000.0
    moment = np.tensordot(share, points, 3) / share.sum()
    # whole HU: 0.3 HU of rounding in each of ~1000 edge voxels
    np.testing.assert_allclose(moment, truth[number], atol=1.5e-3)
    assert np.linalg.norm(truth[number]) > 300.0


def test_a_rod_and_the_ball_share_the_voxels_between_them(a_crop) -> None:
    spec = a_crop(1)
    with_rod = make_phantom(spec)
    center = np.array(with_rod.truth["balls"][0]["center_mm"])
    ring = Pose.from_matrix(np.array(with_rod.truth["rings"]["proximal"]["matrix_lps"]))
    volume = with_rod.volume

    def hu(along_mm: float) -> float:
        point = center + along_mm * ring.rotation[:, 2]
        i, j, k = np.rint(volume.ijk_from_lps(point)).astype(int)
        return float(volume.voxels[k, j, i])

    assert hu(0.0) == pytest.approx(2300.0, abs=2)
    assert hu(-8.0) == pytest.approx(120.0, abs=40)
    assert hu(8.0) == pytest.approx(-1000.0, abs=2)
    assert volume.voxels.max() <= 2301
