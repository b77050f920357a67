"""The paper's formulas as they are printed, to measure what their misprints would do.

Nothing here recognises a patient's ring: `hexafix.recognition` does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.geometry import Pose, skew
from hexafix.hardware import MarkerLayout
from hexafix.recognition.groups import marker_groups, mean_rotation

Array = NDArray[np.float64]


def printed_angles_rad(rotation: ArrayLike) -> Array:
    """Angles α, β, γ of matrices by three arcsines, as Eq. (3) prints them.

    Parameters
    ----------
    rotation : array_like, shape (..., 3, 3)
        Any matrices: no test of the determinant, as printed.

    Returns
    -------
    ndarray, shape (..., 3)
        Radians, each within ±π/2.
    """
    r = np.asarray(rotation, float)
    beta = -np.arcsin(np.clip(r[..., 2, 0], -1.0, 1.0))
    alpha = np.arcsin(np.clip(r[..., 2, 1] / np.cos(beta), -1.0, 1.0))
    gamma = np.arcsin(np.clip(r[..., 1, 0] / np.cos(beta), -1.0, 1.0))
    return np.stack([alpha, beta, gamma], axis=-1)


def printed_ring_pose(points_mm: ArrayLike, layout: MarkerLayout, *, printed: int) -> Pose:
    """Pose as the mean of the groups by Eq. (8)-(19), one equation as printed.

    Arguments as in `printed_group_pose`; the mean is that of `mean_rotation`, so that Eq. (19)
    adds nothing of its own.
    """
    found = [
        printed_group_pose(points_mm, layout, group, printed=printed)
        for group in marker_groups(layout)
    ]
    rotation = mean_rotation(np.array([pose.rotation for pose in found]))
    return Pose(rotation, np.mean([pose.position_mm for pose in found], axis=0))


def printed_group_pose(
    points_mm: ArrayLike, layout: MarkerLayout, group: ArrayLike, *, printed: int
) -> Pose:
    """One group's pose by Eq. (8)-(18), one of them as printed.

    Parameters
    ----------
    points_mm : array_like, shape (N, 3)
        Ball centres in the order of `layout.sites`, LPS mm.
    layout : MarkerLayout
    group : array_like, shape (3,)
        Indices of j1, j2, j3.
    printed : {9, 14, 15}
        The equation taken as printed; the other two as HexaFix has them.

    Returns
    -------
    Pose
        With x taken across z where the printed steps leave the two at a slant.
    """
    j = np.asarray(group, int)
    m1, m2, m3 = np.asarray(points_mm, float)[j]
    r1, r2, r3 = layout.points_mm[j]
    first, second = layout.sites[int(j[0])], layout.sites[int(j[1])]
    normal = np.cross(m1 - m2, m2 - m3)
    sense = 1.0 if printed == 9 else np.sign(np.cross(r1 - r2, r2 - r3)[2])
    w = sense * normal / np.linalg.norm(normal)
    turn = second.sweep_rad - first.sweep_rad
    across = second.radius_mm * np.sin(turn)
    along = first.radius_mm - second.radius_mm * np.cos(turn)
    lam = (
        np.arcsin(across / np.hypot(across, along)) if printed == 14 else np.arctan2(across, along)
    )
    axis = skew(w)
    rodrigues = np.eye(3) + axis * np.sin(lam) + axis @ axis * (1.0 - np.cos(lam))
    t: Array = rodrigues @ (m1 - m2) / np.linalg.norm(m1 - m2)
    cos, sin = np.cos(first.sweep_rad), np.sin(first.sweep_rad)
    if printed == 15:
        u = np.asarray(np.linalg.solve(np.eye(3) * cos + axis, t), float)
    else:
        u = cos * t - sin * np.cross(w, t)
    u = u - w * (w @ u)
    u = u / np.linalg.norm(u)
    rotation = np.stack([u, np.cross(w, u), w], axis=-1)
    return Pose(rotation, m1 - rotation @ r1)
