"""X-Y-Z fixed angles and rotation checks against scipy's own."""

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.geometry import (
    Pose,
    angles_xyz_fixed_from_matrix,
    is_rotation,
    matrix_from_rotation_vector,
    matrix_from_xyz_fixed,
)
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

angle = st.floats(-np.pi, np.pi)
number = st.floats(-500.0, 500.0)


@given(angle, angle, angle)
def test_the_matrix_is_scipys_for_fixed_axes(a, b, c):
    expected = Rotation.from_euler("xyz", [a, b, c]).as_matrix()
    assert np.abs(matrix_from_xyz_fixed([a, b, c]) - expected).max() < 1e-14


component = st.floats(-4.0, 4.0) | st.floats(-1e-6, 1e-6) | st.just(0.0)


@given(st.lists(st.tuples(component, component, component), min_size=1, max_size=4))
def test_the_matrix_of_a_rotation_vector_is_scipys_however_small_the_turn(vectors):
    expected = Rotation.from_rotvec(vectors).as_matrix()
    assert np.abs(matrix_from_rotation_vector(vectors) - expected).max() < 1e-14


@given(angle, st.floats(-1.57, 1.57), angle)
def test_angles_come_back_over_the_full_circle(a, b, c):
    back = angles_xyz_fixed_from_matrix(matrix_from_xyz_fixed([a, b, c]))
    turned = (back - [a, b, c] + np.pi) % (2 * np.pi) - np.pi
    assert np.abs(turned).max() < 1e-6


def test_gimbal_lock_is_refused():
    with pytest.raises(InputError, match="not unique"):
        angles_xyz_fixed_from_matrix(matrix_from_xyz_fixed([0.1, np.pi / 2, 0.2]))


@pytest.mark.parametrize(
    "wrong",
    [
        np.diag([1.0, 1.0, -1.0]),
        -np.eye(3),
        1.01 * np.eye(3),
        np.array([[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        np.full((3, 3), np.nan),
        np.zeros((3, 3)),
    ],
    ids=["mirrored", "inverted", "scaled", "sheared", "not a number", "zero"],
)
def test_what_is_no_rotation_is_refused_alone_and_in_a_batch(wrong):
    assert not is_rotation(wrong)
    assert not is_rotation(np.stack([np.eye(3), wrong]))
    with pytest.raises(InputError):
        Pose(wrong, np.zeros(3))
    if np.all(np.isfinite(wrong)):
        with pytest.raises(InputError):
            angles_xyz_fixed_from_matrix(wrong)


@given(st.tuples(angle, angle, angle), st.tuples(number, number, number))
def test_a_rotation_is_accepted_alone_and_in_a_batch(angles, position):
    matrix = matrix_from_xyz_fixed(angles)
    assert is_rotation(matrix)
    assert is_rotation(np.stack([matrix, np.eye(3)]))
    pose = Pose(matrix, np.array(position))
    assert np.abs((pose @ pose.inverse()).matrix - np.eye(4)).max() < 1e-9


@given(st.tuples(number, number, number), st.tuples(*[st.floats(-1.7, 1.7)] * 3))
def test_exponential_and_logarithm_are_inverse(shift, turn):
    twist = np.array([*shift, *turn])
    assert np.abs(Pose.exp(twist).log() - twist).max() < 1e-8
