"""What a ring's pose error does where it counts: at the strut joints and at the bone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.geometry import skew
from hexafix.hardware import Ring, StrutType

Array = NDArray[np.float64]

BONE_HEIGHT_MM = 90.0
"""Distance of the bone's point from the ring where no struts are known: half a strut of 180 mm."""


@dataclass(frozen=True, slots=True)
class ErrorTarget:
    """The places at which a ring's pose error is counted.

    Attributes
    ----------
    joint_radius_mm : float
        RMS distance of the joint centres from the ring's z axis.
    joint_height_mm : float
        Mean height of the joint centres.
    joint_square_mm2 : float
        Mean square of their heights.
    bone_height_mm : float
        Height of the bone's point on the z axis: midway to the other ring.

    Notes
    -----
    Joints count as spread evenly about the axis, so that turning a layout in its ring changes
    nothing. For joints in three equal sectors, as of every usual hexapod, that is no approximation.
    """

    joint_radius_mm: float
    joint_height_mm: float
    joint_square_mm2: float
    bone_height_mm: float

    @classmethod
    def of_ring(
        cls, ring: Ring, strut: StrutType, side: Literal["proximal", "distal"]
    ) -> ErrorTarget:
        """Joints of the definition; the bone's point half a middle strut towards the other ring."""
        joints = ring.joints_mm
        half = (strut.min_mm + strut.max_mm) / 4
        return cls(
            float(np.sqrt(np.mean(np.sum(joints[:, :2] ** 2, axis=1)))),
            float(joints[:, 2].mean()),
            float(np.mean(joints[:, 2] ** 2)),
            -half if side == "proximal" else half,
        )

    @classmethod
    def of_radius(
        cls, radius_mm: float, side: Literal["proximal", "distal"] = "proximal"
    ) -> ErrorTarget:
        """Where no hardware is known: joints on this circle in the ring's plane."""
        sign = -1.0 if side == "proximal" else 1.0
        return cls(float(radius_mm), 0.0, 0.0, sign * BONE_HEIGHT_MM)

    @property
    def joint_moments(self) -> tuple[Array, Array]:
        """Mean (3,) and second moments (3, 3) of the joint centres, mm and mm²."""
        across = self.joint_radius_mm**2 / 2
        return (
            np.array([0.0, 0.0, self.joint_height_mm]),
            np.diag([across, across, self.joint_square_mm2]),
        )

    @property
    def bone_moments(self) -> tuple[Array, Array]:
        """The same of the bone's point."""
        return (
            np.array([0.0, 0.0, self.bone_height_mm]),
            np.diag([0.0, 0.0, self.bone_height_mm**2]),
        )


@dataclass(frozen=True, slots=True)
class PlaceError:
    """Predicted error of a ring's pose at joints and bone.

    Attributes
    ----------
    error_mm : float
        What layouts are ranked by: the root of the mean of the two squares below.
    joints_mm : float
        RMS displacement of the strut joints.
    bone_mm : float
        RMS displacement of the bone's point.
    """

    error_mm: float
    joints_mm: float
    bone_mm: float


def place_error(covariance: ArrayLike, target: ErrorTarget) -> PlaceError:
    """RMS displacement of joints and bone, shape (6, 6), ring frame, mm and radians.

    Notes
    -----
    A point q of the ring moves by ρ + θ × q with ξ = (ρ, θ), so its mean square displacement is
    tr C_ρρ + 2 q · E[ρ × θ] + tr C_θθ (|q|² 1 - q qᵀ).
    """
    c = np.asarray(covariance, float)
    cross = c[:3, 3:]
    twist = np.array([cross[1, 2] - cross[2, 1], cross[2, 0] - cross[0, 2],
                      cross[0, 1] - cross[1, 0]])  # fmt: skip

    def square(moments: tuple[Array, Array]) -> float:
        mean, second = moments
        lever = np.trace(second) * np.eye(3) - second
        return float(np.trace(c[:3, :3]) + 2.0 * mean @ twist + np.sum(c[3:, 3:] * lever))

    joints, bone = square(target.joint_moments), square(target.bone_moments)
    return PlaceError(*np.sqrt([(joints + bone) / 2, joints, bone]).tolist())


def bone_covariance_mm2(covariance: ArrayLike, target: ErrorTarget) -> Array:
    """Covariance of the bone's point, shape (3, 3), ring frame, mm²; arguments as `place_error`."""
    lever = np.hstack([np.eye(3), -skew(np.array([0.0, 0.0, target.bone_height_mm]))])
    return lever @ np.asarray(covariance, float) @ lever.T


def unit_square_errors(
    x: Array, y: Array, z: Array, target: ErrorTarget, *, every_pair: bool
) -> Array:
    """`PlaceError.error_mm` squared of many layouts at a ball error of 1 mm along each axis, mm².

    Parameters
    ----------
    x, y : ndarray, shape (K, N)
        Ball centres in the ring frame, mm.
    z : ndarray, shape (P, N)
        Their heights; with `every_pair` each row goes with each row of x and y, else P = K and
        each with its own.

    Returns
    -------
    ndarray, shape (K, P), or (K, 1) without `every_pair`

    Notes
    -----
    With the same error along each axis the least-squares pose has no correlation between the
    shift of the markers' middle, σ²/N along each axis, and the turn about it, σ² I⁻¹ with the
    inertia I = Σ (|d|² 1 - d dᵀ). So the mean square displacement of points with moments M about
    that middle is σ² (3/N + tr I⁻¹ (tr M 1 - M)). `isotropic_covariances` gives the same.
    """
    count = x.shape[1]
    mean_x, mean_y = x.mean(axis=1), y.mean(axis=1)
    dx, dy = x - mean_x[:, None], y - mean_y[:, None]
    dz = z - z.mean(axis=1)[:, None]
    mean_z = z.mean(axis=1)[None, :] if every_pair else z.mean(axis=1)[:, None]
    if every_pair:
        xz, yz, zz = dx @ dz.T, dy @ dz.T, np.sum(dz**2, axis=1)[None, :]
    else:
        xz, yz, zz = (np.sum(d * dz, axis=1)[:, None] for d in (dx, dy, dz))
    xx, xy, yy = (np.sum(p * q, axis=1)[:, None] for p, q in ((dx, dx), (dx, dy), (dy, dy)))
    joints, bone = target.joint_moments, target.bone_moments
    low, square = (joints[0][2] + bone[0][2]) / 2, np.diag(joints[1] + bone[1]) / 2
    # Second moments of the targets about the middle of the markers.
    cx, cy = mean_x[:, None], mean_y[:, None]
    tz = low - mean_z
    m_xx, m_yy, m_xy = square[0] + cx**2, square[1] + cy**2, cx * cy
    m_xz, m_yz = -cx * tz, -cy * tz
    m_zz = square[2] - 2.0 * low * mean_z + mean_z**2
    # Inertia of the markers and its adjugate.
    a, b, c = yy + zz, xx + zz, xx + yy
    d, e, f = -xy, -xz, -yz
    det = a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e)
    lever = (b * c - f * f) * (m_yy + m_zz) + (a * c - e * e) * (m_xx + m_zz)
    lever += (a * b - d * d) * (m_xx + m_yy)
    lever -= 2.0 * ((e * f - c * d) * m_xy + (d * f - b * e) * m_xz + (d * e - a * f) * m_yz)
    # Markers on one line hold no turn about it.
    flat = det <= 1e-9 * (a + b + c) ** 3
    return np.where(flat, np.inf, 3.0 / count + lever / np.where(flat, 1.0, det))
