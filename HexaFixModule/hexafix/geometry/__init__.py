"""Rotations (X-Y-Z fixed angles), rigid poses and the blurred ball: bare arrays, mm, radians."""

from hexafix.geometry.pose import Pose
from hexafix.geometry.rotations import (
    angles_xyz_fixed_from_matrix,
    is_rotation,
    matrix_from_rotation_vector,
    matrix_from_xyz_fixed,
    skew,
)

__all__ = [
    "Pose",
    "angles_xyz_fixed_from_matrix",
    "is_rotation",
    "matrix_from_rotation_vector",
    "matrix_from_xyz_fixed",
    "skew",
]
