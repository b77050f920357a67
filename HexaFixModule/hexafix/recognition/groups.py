"""The paper's analytic group method (Eq. 6-19), made exact for every layout.

Two roads lead to a group's orientation. `group_poses` builds a triad alike on layout and image,
which holds for any radii, heights and order. `paper_group_pose` follows the paper's steps one by
one, with the misprints mended; it needs three markers of one height, as the paper does, and
serves as a second witness.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import LayoutRejected
from hexafix.geometry import Pose, skew
from hexafix.hardware import MarkerLayout
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM, Array, triangle_heights_mm

EQUAL_HEIGHT_MM = 1e-9
"""Markers of one height within this: the paper's Eq. (9) holds."""


def marker_groups(layout: MarkerLayout) -> NDArray[np.intp]:
    """Indices of the markers j1, j2, j3 of each usable group, shape (G, 3).

    Raises
    ------
    LayoutRejected
        If every group is flatter than `MIN_TRIANGLE_HEIGHT_MM` (H16).

    Notes
    -----
    Source: Section 3.2, j2 = j + floor(N/3), j3 = j + floor(2N/3). Departs: markers are counted
    in the order of their sweep angles, which the paper takes for granted, whatever number they
    bear; groups that are nearly collinear are left out.
    """
    count = len(layout)
    if count < 3:
        raise LayoutRejected.of(
            "too-few-markers",
            "a ring's pose needs three markers",
            value=str(count),
            limit="at least 3",
            hazard="H13",
            next_step="add markers to the layout",
        )
    around = np.argsort(np.mod([site.sweep_rad for site in layout.sites], 2 * np.pi), kind="stable")
    steps = np.array([0, count // 3, 2 * count // 3])
    groups = around[(np.arange(count)[:, None] + steps) % count]
    heights = triangle_heights_mm(layout.points_mm[groups])
    usable = heights >= MIN_TRIANGLE_HEIGHT_MM
    if not np.any(usable):
        raise LayoutRejected.of(
            "collinear-markers",
            "the markers of every group lie nearly on one line",
            value=f"triangle height {heights.max():.2f} mm",
            limit=f"{MIN_TRIANGLE_HEIGHT_MM:g} mm",
            hazard="H16",
            next_step="spread the markers around the ring",
        )
    return groups[usable]


def triads(corners_mm: ArrayLike) -> Array:
    """Orthonormal triads of triangles, columns e1 e2 e3, shape (..., 3, 3).

    Parameters
    ----------
    corners_mm : array_like, shape (..., 3, 3)
        Corners j1, j2, j3 as rows, mm, any frame.

    Notes
    -----
    Source: Eq. (8), (9), (11): e1 along m_j1 - m_j2, e3 the normal. Departs: e3 is the triangle's
    normal and not yet the ring's z axis.
    """
    corners = np.asarray(corners_mm, float)
    first = corners[..., 0, :] - corners[..., 1, :]
    second = corners[..., 1, :] - corners[..., 2, :]
    normal = np.cross(first, second)
    e1 = first / np.linalg.norm(first, axis=-1, keepdims=True)
    e3 = normal / np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.stack([e1, np.cross(e3, e1), e3], axis=-1)


def group_poses(points_mm: ArrayLike, layout: MarkerLayout) -> tuple[Array, Array]:
    """Ring pose from each group alone.

    Parameters
    ----------
    points_mm : array_like, shape (..., N, 3)
        Ball centres m_i in the order of `layout.sites`, LPS mm; leading axes are a batch.
    layout : MarkerLayout

    Returns
    -------
    rotation : ndarray, shape (..., G, 3, 3)
    position_mm : ndarray, shape (..., G, 3)

    Notes
    -----
    Source: Eq. (6)-(18). Departs: the triad of the image is compared with the same triad of the
    layout, R = M Lᵀ, which replaces Eq. (9)-(17): no equal heights, no order about the axis, no
    branch of an arcsin and no special case at cos φ = 0.
    """
    points = np.asarray(points_mm, float)
    groups = marker_groups(layout)
    corners = points[..., groups, :]
    rotation = triads(corners) @ np.swapaxes(triads(layout.points_mm[groups]), -1, -2)
    first = layout.points_mm[groups[:, 0]]
    # Eq. (18)
    position = corners[..., 0, :] - np.einsum("...gij,gj->...gi", rotation, first)
    return rotation, position


def mean_rotation(rotations: ArrayLike) -> Array:
    """Mean of rotations on SO(3), shape (..., G, 3, 3) to (..., 3, 3).

    Notes
    -----
    Source: Eq. (19). Departs: the rotation closest to all (chordal mean) instead of the mean of
    the angles, which fails at γ = ±180° (H35).
    """
    total = np.asarray(rotations, float).sum(axis=-3)
    u, _, vt = np.linalg.svd(total)
    u[..., :, 2] *= np.sign(np.linalg.det(u) * np.linalg.det(vt))[..., None]
    return u @ vt


def ring_poses_by_groups(points_mm: ArrayLike, layout: MarkerLayout) -> tuple[Array, Array]:
    """Ring poses as the mean of the groups, for a batch of measurements.

    Parameters
    ----------
    points_mm : array_like, shape (..., N, 3)
        Ball centres in the order of `layout.sites`, LPS mm.

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
    position_mm : ndarray, shape (..., 3)
    """
    rotation, position = group_poses(points_mm, layout)
    return mean_rotation(rotation), position.mean(axis=-2)


def paper_group_pose(points_mm: ArrayLike, layout: MarkerLayout, group: ArrayLike) -> Pose:
    """One group's ring pose by the paper's own steps.

    Parameters
    ----------
    points_mm : array_like, shape (N, 3)
        Ball centres in the order of `layout.sites`, LPS mm.
    group : array_like, shape (3,)
        Indices of j1, j2, j3.

    Raises
    ------
    LayoutRejected
        If the three heights differ: Eq. (9) then gives a tilted axis.

    Notes
    -----
    Source: Eq. (8)-(18). Departs: the sense of w from the layout's own triangle (Eq. 9), λ by
    arctan2 (Eq. 14), u = cos φ t̂ - sin φ w × t̂ (in place of Eq. 15-17, where sin φ is missing).
    """
    sites = [layout.sites[int(k)] for k in np.asarray(group)]
    if max(s.height_mm for s in sites) - min(s.height_mm for s in sites) > EQUAL_HEIGHT_MM:
        raise LayoutRejected.of(
            "unequal-heights",
            "the paper's own steps need three markers of one height",
            next_step="use the triad road, group_poses",
        )
    m1, m2, m3 = np.asarray(points_mm, float)[np.asarray(group, int)]
    delta1, delta2 = m1 - m2, m2 - m3  # Eq. (8)
    normal = np.cross(delta1, delta2)
    r1, r2, r3 = layout.points_mm[np.asarray(group, int)]
    sense = np.sign(np.cross(r1 - r2, r2 - r3)[2])
    w = sense * normal / np.linalg.norm(normal)  # Eq. (9)
    turn = sites[1].sweep_rad - sites[0].sweep_rad
    lam = np.arctan2(  # Eq. (14)
        sites[1].radius_mm * np.sin(turn), sites[0].radius_mm - sites[1].radius_mm * np.cos(turn)
    )
    axis = skew(w)
    rodrigues = np.eye(3) + axis * np.sin(lam) + axis @ axis * (1.0 - np.cos(lam))  # Eq. (13)
    t = rodrigues @ (delta1 / np.linalg.norm(delta1))  # Eq. (11), (12)
    phi = sites[0].sweep_rad
    u = np.cos(phi) * t - np.sin(phi) * np.cross(w, t)  # Eq. (15)-(17)
    rotation = np.stack([u, np.cross(w, u), w], axis=-1)  # Eq. (7)
    return Pose(rotation, m1 - rotation @ r1)  # Eq. (18)
