"""How the balls assigned to one ring fit its layout, and how far the next choice stands off."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hexafix.hardware import MarkerLayout
from hexafix.recognition.choices import MANY_BALLS, NOISE_MM, WIDER_MM, search_limit_mm
from hexafix.recognition.congruence import embeddings
from hexafix.recognition.rigid import kabsch, residuals_mm

FEWEST = 3
"""Fewer balls have no rigid fit that could be judged."""

PARTIAL_WORK = 2_000
"""Bound of the search for the next choice: it runs after each click."""


@dataclass(frozen=True)
class RingFit:
    """The balls assigned to one ring so far.

    Attributes
    ----------
    residuals_mm : dict of int to float or None
        Of each number assigned, the distance of its ball from its place after the best rigid
        motion; None below `FEWEST` balls.
    rms_mm : float or None
    next_best_mm : float or None
        RMS of the best other choice of balls for the whole ring; None while the ring is not whole.
    next_best_is_bound : bool
        Whether no other choice was met and `next_best_mm` is only a lower bound.
    """

    residuals_mm: dict[int, float | None]
    rms_mm: float | None
    next_best_mm: float | None
    next_best_is_bound: bool


def ring_fit(
    centers_mm: ArrayLike,
    layout: MarkerLayout,
    ball_of: Mapping[int, int],
    *,
    others: Set[int] = frozenset(),
) -> RingFit:
    """Fit the balls that one ring has so far.

    Parameters
    ----------
    centers_mm : array_like, shape (M, 3)
        All balls found, LPS mm.
    layout : MarkerLayout
    ball_of : mapping of int to int
        Ball index of each number assigned; numbers of another ring are passed over.
    others : set of int
        Balls that the other ring holds: not open to this one.
    """
    points = np.asarray(centers_mm, float).reshape(-1, 3)
    rows = [k for k, number in enumerate(layout.numbers) if number in ball_of]
    numbers = [layout.numbers[k] for k in rows]
    chosen = [ball_of[number] for number in numbers]
    if len(rows) < FEWEST:
        return RingFit(dict.fromkeys(numbers), None, None, next_best_is_bound=False)
    measured, placed = points[chosen], layout.points_mm[rows]
    rotation, position = kabsch(points_mm=measured, layout_mm=placed)
    distance = residuals_mm(
        points_mm=measured, layout_mm=placed, rotation=rotation, position_mm=position
    )
    next_best, bound = None, False
    if len(rows) == len(layout):
        next_best, bound = _next_best(points, layout, chosen, others)
    return RingFit(
        dict(zip(numbers, map(float, distance), strict=True)),
        float(np.sqrt(np.mean(distance**2))),
        next_best,
        bound,
    )


def _next_best(
    points: np.ndarray, layout: MarkerLayout, chosen: list[int], others: Set[int]
) -> tuple[float, bool]:
    """RMS of the best other choice for one ring, and whether it is only a lower bound."""
    open_to_it = [k for k in range(len(points)) if k not in others]
    if len(open_to_it) > MANY_BALLS:
        open_to_it = chosen
    reached = 0.0
    for limit in (search_limit_mm(NOISE_MM), *WIDER_MM):
        found = embeddings(
            points_mm=points[open_to_it],
            layout_mm=layout.points_mm,
            max_rms_mm=limit,
            max_partial=PARTIAL_WORK,
        )
        if not found.complete:
            break
        own = [open_to_it.index(k) for k in chosen]
        rivals = found.rms_mm[np.any(found.balls != own, axis=1)]
        if len(rivals):
            return float(rivals[0]), False
        reached = limit
    return reached, True
