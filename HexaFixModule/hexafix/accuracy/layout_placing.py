"""Which copy of an advised layout asks for the fewest changes, and the markers' numbers."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.advised import Move, RingTask
from hexafix.accuracy.layout_candidates import Candidates
from hexafix.hardware import HoleCircle, MarkerLayout, MarkerSite

SAME_PLACE_MM = 0.01
"""A ball this near its old place has not moved."""

MOVED_MM = 1e4
"""Cost of moving a ball at all, so that few moves come before short ones."""


@dataclass(frozen=True, eq=False)
class Placed:
    """A layout on its holes.

    Attributes
    ----------
    layout : MarkerLayout
    places : tuple of int
        Hole or site of each marker, counted from 1.
    moves : tuple of Move
    cost : float
        Smaller for fewer and shorter moves.
    """

    layout: MarkerLayout
    places: tuple[int, ...]
    moves: tuple[Move, ...]
    cost: float


def placed(candidates: Candidates, flat: int, task: RingTask, *, reflected: bool) -> Placed | None:
    """The copy of a candidate nearest to the present layout; None if no copy fits.

    Without a present layout of as many markers, the first that fits, from hole 1 on.
    """
    chosen, heights = candidates.copies(flat, reflected=reflected)
    if len(chosen) == 0:
        return None
    sites = _sites(candidates, chosen, heights)
    present = task.present
    if present is None or len(present) != chosen.shape[1]:
        around = np.argsort(chosen[0], kind="stable")
        numbers = [task.first_number + k for k in range(len(around))]
        return _built(task, chosen[0][around], sites[0][around], numbers, 0.0)
    t, phi, h = sites[..., 0], sites[..., 1], sites[..., 2]
    points = np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)
    apart = np.linalg.norm(present.points_mm[None, :, None] - points[:, None], axis=-1)
    cost = apart + MOVED_MM * (apart > SAME_PLACE_MM)
    orders = np.array(list(permutations(range(len(present)))))
    total = cost[:, np.arange(len(present)), orders].sum(axis=2)
    copy, order = np.unravel_index(np.argmin(np.round(total, 6)), total.shape)
    order = orders[order]
    return _built(
        task, chosen[copy][order], sites[copy][order], list(present.numbers),
        float(total[copy].min()),
    )  # fmt: skip


def _sites(
    candidates: Candidates, chosen: NDArray[np.intp], heights: NDArray[np.float64]
) -> NDArray[np.float64]:
    """t, φ from 0 to 2π, h of places, shape (M, N) to (M, N, 3)."""
    places = candidates.places
    if isinstance(places, HoleCircle):
        sweep = places.sweep_rad[chosen]
        t = np.full(sweep.shape, places.radius_mm)
    else:
        sweep = np.array([site.sweep_rad for site in places.sites])[chosen]
        t = np.array([site.radius_mm for site in places.sites])[chosen]
    # Turned to degrees and back, so that 10° is not 9.99999999999° in a file.
    degrees = np.mod(np.round(np.degrees(sweep), 9), 360.0)
    return np.stack([t, np.radians(degrees), np.broadcast_to(heights, t.shape)], axis=-1)


def _built(
    task: RingTask,
    chosen: NDArray[np.intp],
    sites: NDArray[np.float64],
    numbers: list[int],
    cost: float,
) -> Placed:
    layout = MarkerLayout(
        tuple(
            MarkerSite(number, *map(float, site))
            for number, site in zip(numbers, sites, strict=True)
        )
    )
    moves = ()
    if task.present is not None and len(task.present) == len(layout):
        moves = layout_moves(task.present, layout)
    return Placed(layout, tuple(int(k) + 1 for k in chosen), moves, cost)


def layout_moves(present: MarkerLayout, layout: MarkerLayout) -> tuple[Move, ...]:
    """What changes from one layout to another with the same numbers."""
    gone = np.linalg.norm(present.points_mm - layout.points_mm, axis=1) > SAME_PLACE_MM
    return tuple(
        Move(
            new.number,
            float(np.mod(round(np.degrees(old.sweep_rad), 6), 360.0)),
            float(np.mod(round(np.degrees(new.sweep_rad), 6), 360.0)),
            old.height_mm,
            new.height_mm,
            old.radius_mm,
            new.radius_mm,
        )
        for old, new, moved in zip(present.sites, layout.sites, gone, strict=True)
        if moved
    )
