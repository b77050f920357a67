import numpy as np
import pytest
from hexafix.benchmark.recognition import random_layout, random_pose
from hexafix.errors import ImageRefused, InputError, LayoutRejected
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.recognition import ring_pose, ring_pose_by_groups, ring_poses
from hexafix.recognition.rigid import kabsch, rigid_rms_mm
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation


def random_covariances(rng: np.random.Generator, count: int) -> np.ndarray:
    root = 0.1 * rng.normal(size=(count, 3, 3))
    return root @ np.swapaxes(root, 1, 2) + 0.01 * np.eye(3)


def tangent(truth: Pose, rotation: np.ndarray, position: np.ndarray) -> np.ndarray:
    """ξ of many poses against a truth, to first order in the position, shape (K, 6)."""
    theta = Rotation.from_matrix(truth.rotation.T @ rotation).as_rotvec()
    return np.concatenate([(position - truth.position_mm) @ truth.rotation, theta], axis=1)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_pose_minimises_the_weighted_residuals(seed):
    rng = np.random.default_rng(seed)
    layout, truth = random_layout(rng), random_pose(rng)
    covariances = random_covariances(rng, len(layout))
    points = truth.apply(layout.points_mm) + 0.2 * rng.normal(size=(len(layout), 3))
    roots = np.linalg.cholesky(np.linalg.inv(covariances))

    def weighted(x: np.ndarray) -> np.ndarray:
        turn = Rotation.from_rotvec(x[3:]).as_matrix()
        e = points - (layout.points_mm @ (truth.rotation @ turn).T + truth.position_mm + x[:3])
        return np.einsum("nij,ni->nj", roots, e).ravel()

    # Without installation errors the weights do not turn with the ring: one plain problem.
    found = ring_pose(points, layout, covariances_mm2=covariances, installation_sigma_mm=0.0)
    tight = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-12, "x_scale": [1, 1, 1, 0.01, 0.01, 0.01]}
    other = least_squares(weighted, np.zeros(6), jac="3-point", **tight)
    turn = Rotation.from_rotvec(other.x[3:]).as_matrix()
    expected = Pose(truth.rotation @ turn, truth.position_mm + other.x[:3])
    mm, rad = expected.difference(found.pose)
    assert mm < 1e-5
    assert rad < 1e-7
    assert found.chi2 == pytest.approx(2 * other.cost, rel=1e-6)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_the_pose_moves_with_the_image(seed):
    rng = np.random.default_rng(seed)
    layout, truth, motion = random_layout(rng), random_pose(rng), random_pose(rng)
    covariances = random_covariances(rng, len(layout))
    points = truth.apply(layout.points_mm) + 0.2 * rng.normal(size=(len(layout), 3))
    here = ring_pose(points, layout, covariances_mm2=covariances)
    there = ring_pose(
        motion.apply(points),
        layout,
        covariances_mm2=motion.rotation @ covariances @ motion.rotation.T,
    )
    mm, rad = (motion @ here.pose).difference(there.pose)
    assert mm < 1e-8
    assert rad < 1e-10
    assert np.allclose(here.covariance, there.covariance, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("sigma", [0.05, (0.02, 0.05, 0.15)])
def test_covariance_and_chi2_agree_with_monte_carlo(an_unequal_layout, an_oblique_pose, sigma):
    rng = np.random.default_rng(4)
    layout, count = an_unequal_layout, 6_000
    covariances = random_covariances(rng, len(layout)) * np.array([1, 1, 4, 0.3])[:, None, None]
    image = np.einsum(
        "nij,knj->kni", np.linalg.cholesky(covariances), rng.normal(size=(count, len(layout), 3))
    )
    built = layout.points_mm + np.asarray(sigma) * rng.normal(size=(count, len(layout), 3))
    rotation, position, stated, chi2 = ring_poses(
        an_oblique_pose.apply(built) + image,
        layout,
        covariances_mm2=covariances,
        installation_sigma_mm=sigma,
    )
    xi = tangent(an_oblique_pose, rotation, position)
    scale = np.sqrt(np.outer(np.diag(stated[0]), np.diag(stated[0])))
    assert np.abs(np.cov(xi.T) / scale - stated[0] / scale).max() < 0.07
    assert np.abs(xi.mean(axis=0) / np.sqrt(np.diag(stated[0]))).max() < 0.06
    assert chi2.mean() == pytest.approx(3 * len(layout) - 6, rel=0.03)


def test_a_noisy_ball_moves_the_pose_little_when_its_covariance_says_so(
    an_unequal_layout, an_oblique_pose
):
    centers = an_oblique_pose.apply(an_unequal_layout.points_mm)
    shifted = centers.copy()
    shifted[1] += [0.0, 0.0, 0.4]
    covariances = np.tile(np.eye(3) * 1e-4, (4, 1, 1))
    plain = ring_pose(shifted, an_unequal_layout, covariances_mm2=covariances)
    covariances[1] *= 1e4
    weighted = ring_pose(
        shifted, an_unequal_layout, covariances_mm2=covariances, installation_sigma_mm=0.0
    )
    assert plain.pose.difference(an_oblique_pose)[0] > 0.1
    assert weighted.pose.difference(an_oblique_pose)[0] < 0.002


def test_a_batch_gives_what_single_fits_give(an_unequal_layout):
    rng = np.random.default_rng(5)
    points = np.array(
        [random_pose(rng).apply(an_unequal_layout.points_mm) for _ in range(5)]
    ) + 0.1 * rng.normal(size=(5, 4, 3))
    rotation, position, covariance, chi2 = ring_poses(points, an_unequal_layout)
    for k in range(5):
        one = ring_pose(points[k], an_unequal_layout)
        assert np.abs(one.pose.rotation - rotation[k]).max() < 1e-11
        assert np.abs(one.pose.position_mm - position[k]).max() < 1e-9
        assert np.allclose(one.covariance, covariance[k], rtol=1e-9)
        assert one.chi2 == pytest.approx(chi2[k], rel=1e-9)


def test_residuals_are_distances_in_the_order_of_the_layout(an_unequal_layout, an_oblique_pose):
    rng = np.random.default_rng(6)
    points = an_oblique_pose.apply(an_unequal_layout.points_mm) + 0.2 * rng.normal(size=(4, 3))
    for found in (
        ring_pose(points, an_unequal_layout),
        ring_pose_by_groups(points, an_unequal_layout),
    ):
        e = np.linalg.norm(found.pose.apply(an_unequal_layout.points_mm) - points, axis=1)
        assert np.allclose(found.residuals_mm, e)
        assert found.rms_mm == pytest.approx(np.sqrt(np.mean(e**2)))
        assert found.degrees_of_freedom == 6
        with pytest.raises(ValueError, match="read-only"):
            found.covariance[0, 0] = 0.0


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("method", [ring_pose, ring_pose_by_groups])
def test_a_mirrored_ring_is_refused_and_not_fitted(
    an_unequal_layout, an_oblique_pose, axis, method
):
    mirrored = an_oblique_pose.apply(an_unequal_layout.points_mm)
    mirrored[:, axis] *= -1
    with pytest.raises(ImageRefused) as caught:
        method(mirrored, an_unequal_layout)
    assert caught.value.faults[0].hazard == "H01"


def test_a_proper_fit_of_a_mirrored_ring_keeps_a_proper_rotation(an_unequal_layout):
    mirrored = an_unequal_layout.points_mm * [1, 1, -1]
    rotation, _ = kabsch(points_mm=mirrored, layout_mm=an_unequal_layout.points_mm)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    layout = an_unequal_layout.points_mm
    assert rigid_rms_mm(points_mm=mirrored, layout_mm=layout) > 5.0
    assert rigid_rms_mm(points_mm=mirrored, layout_mm=layout, mirrored=True) < 1e-12


def test_two_markers_are_refused():
    layout = MarkerLayout.of(radius_mm=[100, 100], sweep_deg=[0, 120], height_mm=[20, 20])
    for method in (ring_pose, ring_pose_by_groups):
        with pytest.raises(LayoutRejected) as caught:
            method(layout.points_mm, layout)
        assert caught.value.faults[0].hazard == "H13"


def test_points_and_covariances_of_the_wrong_kind_are_named(an_unequal_layout):
    points = np.array(an_unequal_layout.points_mm)
    with pytest.raises(InputError, match="finite ball centre"):
        ring_pose(points[:3], an_unequal_layout)
    points[2, 1] = np.nan
    with pytest.raises(InputError, match="finite ball centre"):
        ring_pose(points, an_unequal_layout)
    points = an_unequal_layout.points_mm
    for bad in (np.eye(3), np.full((4, 3, 3), np.nan), np.tile(-np.eye(3), (4, 1, 1))):
        with pytest.raises(InputError) as caught:
            ring_pose(points, an_unequal_layout, covariances_mm2=bad)
        assert caught.value.faults[0].code == "bad-covariance"
    zero = np.zeros((4, 3, 3))
    with pytest.raises(InputError, match="not positive"):
        ring_pose(points, an_unequal_layout, covariances_mm2=zero, installation_sigma_mm=0.0)
