import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, Ring, StrutType
from hexafix.kinematics import (
    condition_number,
    joint_radius_mm,
    strut_jacobian,
    strut_jacobian_batch,
    strut_lengths,
    strut_lengths_batch,
)
from hypothesis import given
from hypothesis import strategies as st

small = st.floats(-0.5, 0.5)


def test_a_raised_ring_with_joints_above_joints_has_struts_of_its_height():
    corners = np.array(
        [[90, 10, 0], [-30, 80, 0], [-60, 70, 0], [-60, -70, 0], [-30, -80, 0], [90, -10, 0.0]]
    )
    ring = Ring(corners, 8.0, 110.0)
    prism = Fixator("prism", "prism", "hand", ring, ring, StrutType(50.0, 300.0))
    lengths = strut_lengths(Pose(np.eye(3), np.array([0.0, 0.0, 150.0])), prism)
    np.testing.assert_allclose(lengths, 150.0, atol=1e-12)
    shifted = strut_lengths(Pose(np.eye(3), np.array([30.0, 40.0, 120.0])), prism)
    np.testing.assert_allclose(shifted, 130.0, atol=1e-12)


def test_lengths_are_distances_between_moved_joints(fixator, random_poses):
    for pose in random_poses(20, seed=1):
        by_matrix = [
            np.linalg.norm((pose.matrix @ np.append(a, 1.0))[:3] - b)
            for a, b in zip(fixator.proximal.joints_mm, fixator.distal.joints_mm, strict=True)
        ]
        np.testing.assert_allclose(strut_lengths(pose, fixator), by_matrix, atol=1e-11)


def test_batch_of_any_leading_shape_equals_single_poses(fixator, random_poses):
    poses = random_poses(12, seed=2)
    r = np.array([p.rotation for p in poses]).reshape(3, 4, 3, 3)
    x = np.array([p.position_mm for p in poses]).reshape(3, 4, 3)
    lengths = strut_lengths_batch(rotations=r, positions_mm=x, fixator=fixator)
    jacobians = strut_jacobian_batch(rotations=r, positions_mm=x, fixator=fixator)
    for k, pose in enumerate(poses):
        np.testing.assert_allclose(
            lengths.reshape(12, 6)[k], strut_lengths(pose, fixator), atol=1e-11
        )
        np.testing.assert_allclose(
            jacobians.reshape(12, 6, 6)[k], strut_jacobian(pose, fixator), atol=1e-11
        )


@given(angles=st.tuples(small, small, small), shift=st.tuples(small, small, small))
def test_jacobian_equals_central_differences_of_a_body_twist(fixator, angles, shift):
    pose = Pose.from_xyz_fixed(
        position_mm=np.array([0.0, 0.0, 185.0]) + 60.0 * np.array(shift), angles_rad=angles
    )
    jacobian = strut_jacobian(pose, fixator)
    for column, step in enumerate(np.diag([1e-3] * 3 + [1e-5] * 3)):
        ahead = strut_lengths(pose @ Pose.exp(step), fixator)
        behind = strut_lengths(pose @ Pose.exp(-step), fixator)
        np.testing.assert_allclose(
            jacobian[:, column], (ahead - behind) / (2 * step.max()), atol=1e-5
        )


def test_condition_number_does_not_change_with_the_size_of_the_mechanism(fixator, neutral):
    twice = Fixator(
        "twice",
        "twice",
        "scaled",
        Ring(2 * fixator.proximal.joints_mm, 8.0, 220.0),
        Ring(2 * fixator.distal.joints_mm, 8.0, 220.0),
        fixator.strut,
    )
    double = Pose(neutral.rotation, 2 * neutral.position_mm)
    small_one = condition_number(
        strut_jacobian(neutral, fixator), length_mm=joint_radius_mm(fixator)
    )
    large_one = condition_number(strut_jacobian(double, twice), length_mm=joint_radius_mm(twice))
    assert joint_radius_mm(fixator) == pytest.approx(95.0, abs=0.01)
    assert small_one == pytest.approx(large_one, rel=1e-9)
    assert 1.0 < small_one < 10.0


def test_a_quarter_turn_about_the_axis_is_singular(fixator):
    turned = Pose.from_xyz_fixed(position_mm=[0, 0, 185], angles_rad=[0, 0, np.pi / 2])
    value = condition_number(strut_jacobian(turned, fixator), length_mm=joint_radius_mm(fixator))
    assert value > 1e3
