"""A rigid pose: the frame's axes and origin in another frame."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import InputError
from hexafix.geometry.rotations import (
    angles_xyz_fixed_from_matrix,
    is_rotation,
    matrix_from_xyz_fixed,
    skew,
)


@dataclass(frozen=True, eq=False)
class Pose:
    """Rigid pose T = (R, p) of a frame; maps its coordinates to the outer frame, x ↦ R x + p.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        Columns are the frame's axes in the outer frame; proper rotation, read-only.
    position_mm : ndarray, shape (3,)
        The frame's origin in the outer frame, mm, read-only.

    Raises
    ------
    InputError
        If the rotation is not proper (mirrored, scaled or sheared) or a number is not finite.
    """

    rotation: NDArray[np.float64]
    position_mm: NDArray[np.float64]

    def __post_init__(self) -> None:
        rotation = np.array(self.rotation, float)
        position = np.array(self.position_mm, float)
        if position.shape != (3,) or not np.all(np.isfinite(position)) or not is_rotation(rotation):
            raise InputError.of(
                "not-rigid",
                "the matrix is not a rigid motion (mirrored, scaled, sheared or not finite)",
                value=f"det {np.linalg.det(rotation):+.6f}"
                if rotation.shape == (3, 3) and np.all(np.isfinite(rotation))
                else None,
                limit="rotation orthonormal to 1e-6 with determinant +1",
                hazard="H01",
                next_step="give a rotation and a translation only",
            )
        rotation.setflags(write=False)
        position.setflags(write=False)
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "position_mm", position)

    @classmethod
    def identity(cls) -> Pose:
        """The pose of a frame that coincides with the outer one."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_xyz_fixed(cls, *, position_mm: ArrayLike, angles_rad: ArrayLike) -> Pose:
        """Pose X = (x y z α β γ), mm and X-Y-Z fixed angles in radians. Source: Eq. (1), (2)."""
        return cls(matrix_from_xyz_fixed(angles_rad), np.asarray(position_mm, float))

    @classmethod
    def from_matrix(cls, matrix: ArrayLike) -> Pose:
        """Pose of a homogeneous 4×4 matrix; the last row must be (0 0 0 1)."""
        m = np.asarray(matrix, float)
        if m.shape != (4, 4) or not np.array_equal(m[3], (0.0, 0.0, 0.0, 1.0)):
            raise InputError.of(
                "not-rigid", "a rigid 4×4 matrix with the last row 0 0 0 1 is needed", hazard="H01"
            )
        return cls(m[:3, :3], m[:3, 3])

    @classmethod
    def exp(cls, twist: ArrayLike) -> Pose:
        """Pose exp(ξ) of a twist ξ = (ρ, θ), shape (6,): mm first, then radians."""
        from scipy.spatial.transform import RigidTransform

        xi = np.asarray(twist, float)
        return cls.from_matrix(
            RigidTransform.from_exp_coords(np.concatenate([xi[3:], xi[:3]])).as_matrix()
        )

    def log(self) -> NDArray[np.float64]:
        """The twist ξ = (ρ, θ), shape (6,), mm and radians, with exp(ξ) = this pose."""
        from scipy.spatial.transform import RigidTransform

        coords = RigidTransform.from_matrix(self.matrix).as_exp_coords()
        return np.concatenate([coords[3:], coords[:3]])

    @property
    def adjoint(self) -> NDArray[np.float64]:
        """Ad(T), shape (6, 6), with T exp(ξ) T⁻¹ = exp(Ad(T) ξ), ξ = (mm, rad)."""
        matrix = np.zeros((6, 6))
        matrix[:3, :3] = matrix[3:, 3:] = self.rotation
        matrix[:3, 3:] = skew(self.position_mm) @ self.rotation
        return matrix

    @property
    def matrix(self) -> NDArray[np.float64]:
        """Homogeneous 4×4 matrix that maps the frame's coordinates to the outer frame."""
        m = np.eye(4)
        m[:3, :3], m[:3, 3] = self.rotation, self.position_mm
        return m

    @property
    def angles_rad(self) -> NDArray[np.float64]:
        """X-Y-Z fixed angles α, β, γ, radians. Source: Eq. (3), with arctan2."""
        return angles_xyz_fixed_from_matrix(self.rotation)

    @property
    def rotation_angle_rad(self) -> float:
        """Angle of the rotation about its own axis, in [0, π]."""
        r = self.rotation
        axis = np.array([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]])
        return float(np.arctan2(np.linalg.norm(axis), np.trace(r) - 1.0))

    def inverse(self) -> Pose:
        """The outer frame seen from this one."""
        return Pose(self.rotation.T, -self.rotation.T @ self.position_mm)

    def __matmul__(self, other: Pose) -> Pose:
        """Composition: first `other`, then this pose."""
        return Pose(
            self.rotation @ other.rotation, self.rotation @ other.position_mm + self.position_mm
        )

    def apply(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """Points, shape (..., 3), mm in the frame, mapped to the outer frame."""
        return np.asarray(points_mm, float) @ self.rotation.T + self.position_mm

    def difference(self, other: Pose) -> tuple[float, float]:
        """Distance of the origins in mm and angle between the axes in radians."""
        return (
            float(np.linalg.norm(self.position_mm - other.position_mm)),
            Pose(self.rotation.T @ other.rotation, np.zeros(3)).rotation_angle_rad,
        )
