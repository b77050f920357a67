"""Every way in which a layout fits into a cloud of balls, up to an RMS, by branch and bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.recognition.rigid import Array, rigid_rms_mm

MAX_PARTIAL = 20_000
"""Partial assignments held at once; beyond, the search stops and says so."""


@dataclass(frozen=True, eq=False)
class Embeddings:
    """All assignments of a layout's markers to balls below an RMS.

    Attributes
    ----------
    balls : ndarray of int, shape (E, N)
        Ball index of each marker, best first.
    rms_mm : ndarray, shape (E,)
        RMS distance of the best rigid motion.
    complete : bool
        False if the search stopped at `MAX_PARTIAL`; then some assignments are missing.
    """

    balls: NDArray[np.intp]
    rms_mm: Array
    complete: bool

    def __len__(self) -> int:
        return len(self.rms_mm)


def embeddings(
    *,
    points_mm: ArrayLike,
    layout_mm: ArrayLike,
    max_rms_mm: float,
    mirrored: bool = False,
    max_partial: int = MAX_PARTIAL,
) -> Embeddings:
    """Find all assignments of layout points to balls that a proper rigid motion explains.

    Parameters
    ----------
    points_mm : array_like, shape (M, 3)
        Balls in any frame, mm.
    layout_mm : array_like, shape (N, 3)
        Markers in the ring frame, mm, N ≥ 2.
    max_rms_mm : float
        Largest RMS of an assignment to list.
    mirrored : bool
        Fit the mirrored layout instead (H01).
    max_partial : int
        Bound of the work.

    Notes
    -----
    Markers are placed one by one, the best spread first. With Σ|e|² ≤ N rms² for the whole
    assignment, k placed markers keep Σ(d - D)² ≤ 2(k-1) N rms² over their pairwise distances and
    their own best rigid fit keeps Σ|e|² ≤ N rms²; what breaks either can be cut without loss.
    """
    points, layout = np.asarray(points_mm, float), np.asarray(layout_mm, float)
    count, order = len(layout), spread_order(layout)
    placed = layout[order]
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    wanted = np.linalg.norm(placed[:, None] - placed[None], axis=-1)
    budget = count * max_rms_mm**2 * (1.0 + 1e-9) + 1e-18
    partial = np.arange(len(points))[:, None]
    strain = np.zeros(len(points))
    complete = True
    for k in range(1, count):
        partial, strain = _extend(partial, strain, apart, wanted[k, :k], 2.0 * k * budget)
        if len(partial) > max_partial:
            keep = np.argsort(strain, kind="stable")[:max_partial]
            partial, strain, complete = partial[keep], strain[keep], False
        if k >= 2 and len(partial):
            rms = rigid_rms_mm(
                points_mm=points[partial], layout_mm=placed[: k + 1], mirrored=mirrored
            )
            fits = (k + 1) * rms**2 <= budget
            partial, strain = partial[fits], strain[fits]
    if len(partial) == 0:
        return Embeddings(np.zeros((0, count), int), np.zeros(0), complete)
    balls = np.empty_like(partial)
    balls[:, order] = partial
    rms = np.atleast_1d(rigid_rms_mm(points_mm=points[balls], layout_mm=layout, mirrored=mirrored))
    best_first = np.argsort(rms, kind="stable")
    return Embeddings(balls[best_first], rms[best_first], complete)


def _extend(
    partial: NDArray[np.intp], strain: Array, apart: Array, wanted: Array, limit: float
) -> tuple[NDArray[np.intp], Array]:
    """Partial assignments (P, k) with one more ball each, those within the strain limit."""
    added = np.sum((apart[partial] - wanted[None, :, None]) ** 2, axis=1)
    total = strain[:, None] + added
    total[np.arange(len(partial))[:, None], partial] = np.inf
    rows, balls = np.nonzero(total <= limit)
    return np.concatenate([partial[rows], balls[:, None]], axis=1), total[rows, balls]


def spread_order(layout_mm: ArrayLike) -> NDArray[np.intp]:
    """Order of the markers, shape (N,): each next one the farthest from those before."""
    layout = np.asarray(layout_mm, float)
    apart = np.linalg.norm(layout[:, None] - layout[None], axis=-1)
    order = list(np.unravel_index(np.argmax(apart), apart.shape))
    nearest = apart[order].min(axis=0)
    while len(order) < len(layout):
        order.append(np.argmax(nearest))
        nearest = np.minimum(nearest, apart[order[-1]])
    return np.array(order[: len(layout)], dtype=np.intp)
