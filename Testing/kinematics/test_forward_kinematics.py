from dataclasses import replace

import numpy as np
import pytest
from hexafix.errors import ForwardKinematicsDiverged, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Ring
from hexafix.kinematics import (
    forward_kinematics,
    forward_kinematics_batch,
    second_starts,
    strut_lengths,
    strut_lengths_batch,
)
from hexafix.kinematics.newton import _rotation, _rotations, solve_rows
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import least_squares

turn = st.floats(-0.35, 0.35)
shift = st.floats(-30.0, 30.0)


@given(angles=st.tuples(turn, turn, turn), offset=st.tuples(shift, shift, shift))
def test_forward_inverts_inverse_from_the_neutral_pose(fixator, neutral, angles, offset):
    pose = Pose.from_xyz_fixed(position_mm=neutral.position_mm + offset, angles_rad=angles)
    solution = forward_kinematics(strut_lengths(pose, fixator), fixator, start=neutral)
    distance, angle = pose.difference(solution.pose)
    assert distance < 1e-9
    assert angle < 1e-11
    assert solution.residual_mm < 1e-9
    assert solution.iterations <= 8


def test_forward_agrees_with_a_general_solver(fixator, neutral, random_poses):
    for pose in random_poses(5, seed=3):
        q = strut_lengths(pose, fixator)
        general = least_squares(
            lambda x, q=q: (
                strut_lengths(Pose.from_xyz_fixed(position_mm=x[:3], angles_rad=x[3:]), fixator) - q
            ),
            [0, 0, 185, 0, 0, 0],
            x_scale=[1, 1, 1, 0.01, 0.01, 0.01],
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        )
        found = forward_kinematics(q, fixator, start=neutral).pose
        np.testing.assert_allclose(found.position_mm, general.x[:3], atol=1e-6)
        np.testing.assert_allclose(found.angles_rad, general.x[3:], atol=1e-8)


def test_a_batch_equals_single_solutions(fixator, neutral, random_poses):
    poses = random_poses(3000, seed=4)
    r = np.array([p.rotation for p in poses])
    x = np.array([p.position_mm for p in poses])
    lengths = strut_lengths_batch(rotations=r, positions_mm=x, fixator=fixator)
    batch = forward_kinematics_batch(
        lengths, fixator, start_rotations=neutral.rotation, start_positions=neutral.position_mm
    )
    np.testing.assert_allclose(batch.positions_mm, x, atol=1e-9)
    np.testing.assert_allclose(batch.rotations, r, atol=1e-11)
    for k in (0, 1500, 2999):
        one = forward_kinematics(lengths[k], fixator, start=neutral)
        np.testing.assert_allclose(batch.positions_mm[k], one.pose.position_mm, atol=1e-10)


def test_a_start_read_with_six_digits_gives_an_exact_rotation(fixator, random_poses):
    pose = random_poses(1, seed=5)[0]
    rough = Pose(np.round(pose.rotation, 7), pose.position_mm + 1.0)
    found = forward_kinematics(strut_lengths(pose, fixator), fixator, start=rough).pose
    np.testing.assert_allclose(found.rotation.T @ found.rotation, np.eye(3), atol=1e-14)
    assert pose.difference(found)[0] < 1e-9


def test_lengths_that_no_pose_has_are_refused_with_residual_and_iterations(fixator, neutral):
    with pytest.raises(ForwardKinematicsDiverged) as caught:
        forward_kinematics([400.0, 20, 400, 20, 400, 20], fixator, start=neutral)
    fault = caught.value.faults[0]
    assert fault.hazard == "H29"
    assert "residual" in str(fault.value)
    assert "iterations" in str(fault.value)


def test_one_impossible_row_of_a_batch_is_named(fixator, neutral):
    lengths = np.tile(strut_lengths(neutral, fixator), (5, 1))
    lengths[3] = [400.0, 20, 400, 20, 400, 20]
    with pytest.raises(ForwardKinematicsDiverged, match=r"row 3 \(1 of 5 rows\)"):
        forward_kinematics_batch(
            lengths, fixator, start_rotations=neutral.rotation, start_positions=neutral.position_mm
        )


@pytest.mark.parametrize("bad", [np.nan, np.inf, -175.0, 0.0])
def test_a_length_that_is_no_length_is_an_input_error(fixator, neutral, bad):
    lengths = strut_lengths(neutral, fixator)
    lengths[2] = bad
    with pytest.raises(InputError) as caught:
        forward_kinematics(lengths, fixator, start=neutral)
    assert caught.value.faults[0].hazard == "H55"
    with pytest.raises(InputError):
        forward_kinematics_batch(
            [lengths], fixator, start_rotations=np.eye(3), start_positions=[0, 0, 185]
        )


def test_a_near_singular_solution_is_refused(fixator):
    turned = Pose.from_xyz_fixed(position_mm=[3, 2, 185], angles_rad=np.radians([2, 3, 88]))
    with pytest.raises(ForwardKinematicsDiverged) as caught:
        forward_kinematics(strut_lengths(turned, fixator), fixator, start=turned)
    assert caught.value.faults[0].hazard == "H31"


def test_a_step_from_an_exactly_singular_start_is_no_crash(fixator, neutral):
    turned = Pose.from_xyz_fixed(position_mm=[0, 0, 185], angles_rad=[0, 0, np.pi / 2])
    try:
        found = forward_kinematics(strut_lengths(neutral, fixator), fixator, start=turned)
    except ForwardKinematicsDiverged:
        return
    np.testing.assert_allclose(
        strut_lengths(found.pose, fixator), strut_lengths(neutral, fixator), atol=1e-9
    )


def test_a_singular_row_leaves_the_others_alone(fixator, neutral):
    flat = np.zeros((6, 3))
    line = replace(fixator, proximal=Ring(flat, 8.0, 110.0))
    # all joints of the moving ring in one point: no turn moves a strut
    point = Pose(np.eye(3), np.array([1.0, 2.0, 180.0]))
    with pytest.raises(ForwardKinematicsDiverged, match=r"row 0 \(2 of 2 rows\)"):
        forward_kinematics_batch(
            [strut_lengths(point, line) + 1.0] * 2,
            line,
            start_rotations=np.eye(3),
            start_positions=[0.0, 0.0, 185.0],
        )
    starts = np.array([np.eye(3), Pose.exp([0, 0, 0, 0, 0, np.pi / 2]).rotation])
    lengths = np.tile(strut_lengths(neutral, fixator), (2, 1))
    lengths[0] += [0.5, -0.5, 0.2, 0.1, -0.3, 0.4]
    batch = solve_rows(
        lengths, fixator, start_rotations=starts, start_positions=neutral.position_mm
    )
    assert batch.arrived[0]


def test_the_cheap_rotation_of_a_step_is_proper_and_right_to_third_order():
    for vector in np.random.default_rng(2).uniform(-0.05, 0.05, (20, 3)):
        one = _rotation(*vector)
        many = _rotations(*vector[:, None])[..., 0]
        np.testing.assert_allclose(one, many, atol=1e-15)
        np.testing.assert_allclose(one.T @ one, np.eye(3), atol=1e-15)
        exact = Pose.exp([0, 0, 0, *vector]).rotation
        assert np.abs(one - exact).max() < np.linalg.norm(vector) ** 3 / 6


def test_second_starts_agree_over_the_working_space(fixator, random_poses):
    for pose in random_poses(100, seed=6):
        check = second_starts(strut_lengths(pose, fixator), fixator, solution=pose)
        assert check.agree
        assert check.count == 20
        assert check.worst_mm < 1e-6


def test_a_second_assembly_mode_nearby_is_detected(fixator):
    turned = Pose.from_xyz_fixed(position_mm=[3, 2, 185], angles_rad=np.radians([2, 3, 85]))
    lengths = strut_lengths(turned, fixator)
    check = second_starts(lengths, fixator, solution=turned)
    assert not check.agree
    assert check.elsewhere > 0
    assert check.worst_mm > 1.0


def test_a_pose_that_is_no_solution_is_not_confirmed(fixator, neutral):
    check = second_starts(strut_lengths(neutral, fixator) + 1.0, fixator, solution=neutral)
    assert not check.agree
    assert check.elsewhere == 20
