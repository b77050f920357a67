"""Closed-form rigid fits of point sets: the start of every ring pose."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

MIN_TRIANGLE_HEIGHT_MM = 10.0
"""Three markers with a flatter triangle do not hold a ring's orientation (H16)."""


def kabsch(
    *, points_mm: ArrayLike, layout_mm: ArrayLike, mirrored: bool = False
) -> tuple[Array, Array]:
    """Proper rotation and translation that bring layout points closest to measured points.

    Parameters
    ----------
    points_mm : array_like, shape (..., N, 3)
        Measured points in the outer frame, mm.
    layout_mm : array_like, shape (..., N, 3)
        The same points in the ring frame, mm.
    mirrored : bool
        Fit the mirrored layout instead: the matrix returned has determinant -1. Only to
        recognise a mirrored image, never to use as a pose (H01).

    Returns
    -------
    rotation : ndarray, shape (..., 3, 3)
    position_mm : ndarray, shape (..., 3)
        p ≈ rotation r + position.

    Notes
    -----
    Source: the least-squares solution of Eq. (6) by singular values (Kabsch 1976, Umeyama 1991).
    """
    m, r = np.asarray(points_mm, float), np.asarray(layout_mm, float)
    middle_m, middle_r = m.mean(axis=-2), r.mean(axis=-2)
    spread = np.swapaxes(m - middle_m[..., None, :], -1, -2) @ (r - middle_r[..., None, :])
    u, _, vt = np.linalg.svd(spread)
    wanted = -1.0 if mirrored else 1.0
    # The direction with the smallest singular value is the one that pays for a proper rotation.
    u[..., :, 2] *= (wanted * np.sign(np.linalg.det(u) * np.linalg.det(vt)))[..., None]
    rotation = u @ vt
    return rotation, middle_m - np.einsum("...ij,...j->...i", rotation, middle_r)


def residuals_mm(
    *, points_mm: ArrayLike, layout_mm: ArrayLike, rotation: ArrayLike, position_mm: ArrayLike
) -> Array:
    """Distances |R r_i + p - m_i|, shape (..., N), mm. Source: Eq. (6)."""
    r, turn = np.asarray(layout_mm, float), np.asarray(rotation, float)
    fitted = r @ np.swapaxes(turn, -1, -2) + np.asarray(position_mm, float)[..., None, :]
    return np.linalg.norm(fitted - np.asarray(points_mm, float), axis=-1)


def rigid_rms_mm(
    *, points_mm: ArrayLike, layout_mm: ArrayLike, mirrored: bool = False
) -> NDArray[np.float64]:
    """RMS distance left by the best rigid motion, shape (...), mm; arguments as in `kabsch`."""
    rotation, position = kabsch(points_mm=points_mm, layout_mm=layout_mm, mirrored=mirrored)
    distance = residuals_mm(
        points_mm=points_mm, layout_mm=layout_mm, rotation=rotation, position_mm=position
    )
    return np.sqrt(np.mean(distance**2, axis=-1))


def triangle_heights_mm(corners_mm: ArrayLike) -> Array:
    """Smallest height of triangles, shape (..., 3, 3) of corners to (...), mm."""
    corners = np.asarray(corners_mm, float)
    sides = corners - np.roll(corners, 1, axis=-2)
    double_area = np.linalg.norm(np.cross(sides[..., 0, :], sides[..., 1, :]), axis=-1)
    longest = np.linalg.norm(sides, axis=-1).max(axis=-1)
    return np.divide(double_area, longest, out=np.zeros_like(double_area), where=longest > 0.0)


def best_triangle_height_mm(points_mm: ArrayLike) -> float:
    """Smallest height of the least flat triangle among points, shape (N, 3), N ≥ 3, mm."""
    points = np.asarray(points_mm, float)
    triples = np.array(list(combinations(range(len(points)), 3)))
    return float(triangle_heights_mm(points[triples]).max())
