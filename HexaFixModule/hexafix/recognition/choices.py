"""All choices of balls for both rings, and which of them the layouts cannot tell apart."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.hardware import MarkerLayout
from hexafix.recognition.congruence import Embeddings, embeddings
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM
from hexafix.recognition.rigid import Array, rigid_rms_mm

UNIQUENESS_LIMIT_MM = 5.0
"""The same balls under wrong numbers must miss the layout by this RMS (H18)."""

UNIQUENESS_NOISE_FACTOR = 10.0
"""Any other choice must miss the layout by this many times the noise (H18)."""

OTHER_BALLS_LIMIT_MM = 2 * RING_RMS_LIMIT_MM
"""A choice with a ball that the best one leaves out must miss the layout by this RMS.

Such a fit comes by chance and not by symmetry, so the layout need not be rebuilt for it; it must
only be far from passing G2.
"""

NOISE_MM = 0.1
"""Noise of a ball against its place along one axis: centre and installation together."""

MAX_CHOICES = 4096
"""Choices of both rings compared one by one; more mean a hopeless symmetry."""

WIDER_MM = (10.0, 20.0, 40.0)
"""RMS up to which the next best relabelling is looked for when there is none nearer."""

WIDER_PARTIAL = 2_000
"""Bound of that search's work; beyond, the next best is only bounded."""


@dataclass(frozen=True, eq=False)
class Choices:
    """Joint choices of both rings, disjoint, best first.

    Attributes
    ----------
    proximal, distal : Embeddings
    pairs : ndarray of int, shape (P, 2)
        Rows of the two embeddings.
    rms_mm : ndarray, shape (P,)
        RMS of the worse ring.
    complete : bool
        False if the search was cut short.
    """

    proximal: Embeddings
    distal: Embeddings
    pairs: NDArray[np.intp]
    rms_mm: Array
    complete: bool

    def balls(self, row: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Ball indices of the proximal and the distal ring in one choice."""
        a, b = self.pairs[row]
        return tuple(map(int, self.proximal.balls[a])), tuple(map(int, self.distal.balls[b]))


def search_limit_mm(noise_mm: float) -> float:
    """RMS up to which every choice is listed."""
    return max(UNIQUENESS_LIMIT_MM, UNIQUENESS_NOISE_FACTOR * noise_mm)


def search(
    points: Array, *, proximal: MarkerLayout, distal: MarkerLayout, noise_mm: float
) -> Choices:
    """All disjoint choices of both rings up to the RMS that matters; points (M, 3), LPS mm."""
    limit = search_limit_mm(noise_mm)
    found = [
        embeddings(points_mm=points, layout_mm=layout.points_mm, max_rms_mm=limit)
        if len(points) >= len(layout)
        else Embeddings(np.zeros((0, len(layout)), int), np.zeros(0), complete=True)
        for layout in (proximal, distal)
    ]
    return joined(found[0], found[1], len(points))


def joined(proximal: Embeddings, distal: Embeddings, ball_count: int) -> Choices:
    """Every pair of embeddings that shares no ball, best first, at most `MAX_CHOICES`."""
    found = (proximal, distal)
    worse = np.maximum(proximal.rms_mm[:, None], distal.rms_mm[None])
    used = [np.zeros((len(f), ball_count), bool) for f in found]
    for mask, f in zip(used, found, strict=True):
        mask[np.arange(len(f))[:, None], f.balls] = True
    apart = (used[0].astype(np.int32) @ used[1].T.astype(np.int32)) == 0
    pairs = np.argwhere(apart)
    rms = worse[apart]
    # The sum breaks ties, so that the better of two choices with one bad ring comes first.
    total = found[0].rms_mm[pairs[:, 0]] + found[1].rms_mm[pairs[:, 1]]
    order = np.lexsort((total, rms))[:MAX_CHOICES]
    complete = proximal.complete and distal.complete and len(rms) <= MAX_CHOICES
    return Choices(proximal, distal, pairs[order], rms[order], complete)


def ambiguous_rows(choices: Choices, best: int, *, noise_mm: float) -> list[int]:
    """Rows of the choices that cannot be told from row `best` by the layouts."""
    noise = UNIQUENESS_NOISE_FACTOR * max(noise_mm, 0.0)
    used = set().union(*choices.balls(best))
    rivals = []
    for row, rms in enumerate(choices.rms_mm):
        if row == best:
            continue
        same = used == set().union(*choices.balls(row))
        limit = max(UNIQUENESS_LIMIT_MM if same else OTHER_BALLS_LIMIT_MM, noise)
        if rms < limit:
            rivals.append(row)
    return rivals


def next_best_mm(
    points: Array,
    choices: Choices,
    row: int,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    searched_mm: float,
) -> tuple[float, bool]:
    """RMS of the best other choice, mm, and whether it is only a lower bound.

    Beyond `searched_mm`, the RMS up to which `choices` is full, only the balls of the chosen row
    are searched.
    """
    others = np.delete(choices.rms_mm, row)
    if len(others):
        return float(others[0]), False
    balls = choices.balls(row)
    used = [*balls[0], *balls[1]]
    reached = searched_mm
    for limit in WIDER_MM:
        found = [
            embeddings(
                points_mm=points[used],
                layout_mm=layout.points_mm,
                max_rms_mm=limit,
                max_partial=WIDER_PARTIAL,
            )
            for layout in (proximal, distal)
        ]
        if not (found[0].complete and found[1].complete):
            break
        wider = joined(found[0], found[1], len(used))
        if len(wider.rms_mm) > 1:
            return float(wider.rms_mm[1]), False
        reached = max(reached, limit)
    return reached, True


def with_choice(
    points: Array,
    choices: Choices,
    balls: tuple[tuple[int, ...], tuple[int, ...]],
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
) -> tuple[Choices, int]:
    """The choices with this one among them, and its row; balls as of `Choices.balls`."""
    for row in range(len(choices.rms_mm)):
        if choices.balls(row) == balls:
            return choices, row
    rms = [
        float(rigid_rms_mm(points_mm=points[list(ring)], layout_mm=layout.points_mm))
        for ring, layout in zip(balls, (proximal, distal), strict=True)
    ]
    both = [
        Embeddings(
            np.vstack([found.balls.reshape(-1, len(ring)), np.array(ring)]),
            np.append(found.rms_mm, value),
            found.complete,
        )
        for found, ring, value in zip((choices.proximal, choices.distal), balls, rms, strict=True)
    ]
    last = np.array([[len(choices.proximal), len(choices.distal)]])
    pairs = np.vstack([choices.pairs.reshape(-1, 2), last])
    all_rms = np.append(choices.rms_mm, max(rms))
    return Choices(both[0], both[1], pairs, all_rms, choices.complete), len(all_rms) - 1
