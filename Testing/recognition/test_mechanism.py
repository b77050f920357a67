import numpy as np
import pytest
from hexafix.benchmark.recognition import random_pose
from hexafix.geometry import Pose
from hexafix.recognition import mechanism_pose, ring_pose, ring_poses


def test_the_adjoint_carries_a_twist_through_a_pose():
    rng = np.random.default_rng(0)
    for _ in range(20):
        pose, xi = random_pose(rng), rng.normal(size=6) * [5, 5, 5, 0.3, 0.3, 0.3]
        left = pose @ Pose.exp(xi) @ pose.inverse()
        assert np.abs(left.matrix - Pose.exp(pose.adjoint @ xi).matrix).max() < 1e-9


def test_the_mechanism_pose_is_equation_4(image_of_rings, a_proximal_layout, a_distal_layout):
    points, where, pose_a, pose_b = image_of_rings(
        a_proximal_layout, a_distal_layout, seed=1, noise_mm=0.0
    )
    a = ring_pose(points[where[:3]], a_proximal_layout)
    b = ring_pose(points[where[3:6]], a_distal_layout)
    found = mechanism_pose(proximal=a, distal=b)
    expected_p = pose_b.rotation.T @ (pose_a.position_mm - pose_b.position_mm)
    assert np.abs(found.pose.position_mm - expected_p).max() < 1e-9
    assert np.abs(found.pose.rotation - pose_b.rotation.T @ pose_a.rotation).max() < 1e-12
    assert np.degrees(found.pose.angles_rad) == pytest.approx([6.0, -9.0, 14.0])


def test_the_mechanism_covariance_agrees_with_monte_carlo(
    image_of_rings, a_proximal_layout, a_distal_layout
):
    points, where, pose_a, pose_b = image_of_rings(
        a_proximal_layout, a_distal_layout, seed=2, noise_mm=0.0
    )
    rng = np.random.default_rng(7)
    true = [points[where[:3]], points[where[3:6]]]
    layouts = (a_proximal_layout, a_distal_layout)
    stated = mechanism_pose(
        proximal=ring_pose(true[0], layouts[0], installation_sigma_mm=0.0),
        distal=ring_pose(true[1], layouts[1], installation_sigma_mm=0.0),
    )
    rings = [
        ring_poses(t + 0.3 * rng.normal(size=(4000, 3, 3)), layout, installation_sigma_mm=0.0)
        for t, layout in zip(true, layouts, strict=True)
    ]
    truth = pose_b.inverse() @ pose_a
    xi = np.array(
        [
            (truth.inverse() @ Pose(rb, pb).inverse() @ Pose(ra, pa)).log()
            for ra, pa, rb, pb in zip(*rings[0][:2], *rings[1][:2], strict=True)
        ]
    )
    scale = np.sqrt(np.outer(np.diag(stated.covariance), np.diag(stated.covariance)))
    assert np.abs(np.cov(xi.T) / scale - stated.covariance / scale).max() < 0.08
    assert stated.sigma == pytest.approx(np.sqrt(np.diag(stated.covariance)))
