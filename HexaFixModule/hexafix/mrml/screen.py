"""Where patient points stand on a view's screen, and which side of the patient is which edge."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hexafix.mrml.geometry import array4, lps_points, ras_points

EDGE_LETTERS = (("R", "L"), ("A", "P"), ("H", "F"))
"""Names of the positive and negative direction along each RAS axis; H and F: head and foot."""

LPS_LETTERS = "LPS"
"""Names of the axes along which every point is told."""

TOLD_MM = 0.05
"""Half of the last digit of a slice's position."""

OBLIQUE = 0.3
"""Cosine from which a second axis is named too: 17.5 deg off the first."""


def edge_letters(slice_node: Any) -> dict[str, str]:
    """What the edges of a slice view show of the patient.

    Parameters
    ----------
    slice_node : vtkMRMLSliceNode
        The view's node.

    Returns
    -------
    dict
        ``left``, ``right``, ``top``, ``bottom``: R, L, A, P, H or F, two letters if oblique.
    """
    to_ras = array4(slice_node.GetXYToRAS())
    right, top = to_ras[:3, 0], to_ras[:3, 1]
    return {
        "left": direction_letters(-right),
        "right": direction_letters(right),
        "top": direction_letters(top),
        "bottom": direction_letters(-top),
    }


def direction_letters(direction_ras: Sequence[float] | np.ndarray) -> str:
    """Letters of a direction, the nearest axis first.

    Parameters
    ----------
    direction_ras : array_like, shape (3,)
        Direction in RAS, of any length but 0.
    """
    unit = np.asarray(direction_ras, float) / np.linalg.norm(direction_ras)
    order = np.argsort(-np.abs(unit), kind="stable")
    named = [axis for k, axis in enumerate(order) if k == 0 or abs(unit[axis]) > OBLIQUE]
    return "".join(EDGE_LETTERS[axis][0 if unit[axis] > 0 else 1] for axis in named)


def slice_position(slice_node: Any) -> str:
    """Where a slice stands, as the balls are told: the LPS coordinate across it.

    The coordinate along the patient's axis that is nearest to the slice's normal, at the middle of
    the view. A tilted slice has another value at each of its points, and says so.

    Parameters
    ----------
    slice_node : vtkMRMLSliceNode
        The view's node.
    """
    to_ras = array4(slice_node.GetXYToRAS())
    width, height, _ = slice_node.GetDimensions()
    middle = lps_points((to_ras @ (0.5 * width, 0.5 * height, 0.0, 1.0))[:3])
    normal = array4(slice_node.GetSliceToRAS())[:3, 2]
    share = np.abs(normal) / np.linalg.norm(normal)
    axis = int(np.argmax(share))
    # How much the coordinate changes from the middle to an edge of the view, in mm.
    edges = (0.5 * width * to_ras[axis, 0], 0.5 * height * to_ras[axis, 1])
    words = f"{LPS_LETTERS[axis]} {middle[axis]:.1f} mm".replace("-0.0 ", "0.0 ")
    if sum(map(abs, edges)) < TOLD_MM:
        return words
    tilt_deg = np.degrees(np.arccos(min(1.0, share[axis])))
    return f"{words} in the middle\ntilted {max(tilt_deg, 0.1):.1f}°"


def point_under(slice_node: Any, x: float, y: float) -> tuple[float, float, float]:
    """The patient point under a pixel of a slice view.

    Parameters
    ----------
    slice_node : vtkMRMLSliceNode
        The view's node.
    x, y : float
        Pixel from the lower left corner.

    Returns
    -------
    tuple of float
        LPS, mm.
    """
    ras = array4(slice_node.GetXYToRAS()) @ (x, y, 0.0, 1.0)
    lps = lps_points(ras[:3])
    return float(lps[0]), float(lps[1]), float(lps[2])


def nearest_in_slice(
    slice_node: Any, x: float, y: float, points_lps: Sequence[Sequence[float]], *, within_mm: float
) -> int | None:
    """Index of the point nearest to a pixel of a slice view.

    Parameters
    ----------
    slice_node : vtkMRMLSliceNode
        The view's node.
    x, y : float
        Pixel from the lower left corner.
    points_lps : array_like, shape (n, 3)
        Points in LPS, mm.
    within_mm : float
        A point farther from the pixel's patient point does not count, in mm.
    """
    if len(points_lps) == 0:
        return None
    away = np.asarray(points_lps, float) - point_under(slice_node, x, y)
    distances = np.linalg.norm(away, axis=1)
    nearest = int(np.argmin(distances))
    return nearest if distances[nearest] <= within_mm else None


def nearest_in_space(
    renderer: Any, x: float, y: float, points_lps: Sequence[Sequence[float]], *, within_mm: float
) -> int | None:
    """Index of the point that a pixel of a 3D view shows; of two behind each other the front one.

    Parameters
    ----------
    renderer : vtkRenderer
        The view's renderer.
    x, y : float
        Pixel from the lower left corner.
    points_lps : array_like, shape (n, 3)
        Points in LPS, mm.
    within_mm : float
        A point whose distance from the line of sight is larger does not count, in mm.
    """
    if len(points_lps) == 0:
        return None
    near, far = (_unprojected(renderer, x, y, depth) for depth in (0.0, 1.0))
    sight = (far - near) / np.linalg.norm(far - near)
    away = np.asarray(points_lps, float) - near
    along = away @ sight
    off = np.linalg.norm(away - along[:, None] * sight, axis=1)
    hit = np.flatnonzero((off <= within_mm) & (along > 0.0))
    return int(hit[np.argmin(along[hit])]) if hit.size else None


def jump_to(slice_node: Any, point_lps: Sequence[float]) -> None:
    """Bring a slice to a patient point, without moving it in its plane.

    Parameters
    ----------
    slice_node : vtkMRMLSliceNode
        The view's node.
    point_lps : array_like, shape (3,)
        LPS, mm.
    """
    slice_node.JumpSliceByOffsetting(*(float(c) for c in ras_points(point_lps)))


def _unprojected(renderer: Any, x: float, y: float, depth: float) -> np.ndarray:
    """A pixel of a 3D view at a depth of [0, 1] as a point in LPS, mm, shape (3,)."""
    renderer.SetDisplayPoint(x, y, depth)
    renderer.DisplayToWorld()
    ras = np.asarray(renderer.GetWorldPoint(), float)
    return lps_points(ras[:3] / ras[3])
