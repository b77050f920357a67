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

MANY_BALLS = 30
"""Above this count chance fits are listed to a narrower RMS."""

WIDER_MM, WIDER_MARKERS, WIDER_PARTIAL = (10.0, 20.0, 40.0), 6, 2_000
"""RMS up to which the next best relabelling is looked for when there is none nearer, the most
markers a ring for which that is cheap, and the bound of its work."""


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
    """RMS below which the same balls under other numbers are ambiguous (H18)."""
    return max(UNIQUENESS_LIMIT_MM, UNIQUENESS_NOISE_FACTOR * noise_mm)


def other_balls_limit_mm(noise_mm: float) -> float:
    """RMS below which a choice with other balls is ambiguous."""
    return max(OTHER_BALLS_LIMIT_MM, UNIQUENESS_NOISE_FACTOR * noise_mm)


def search(
    points: Array, *, proximal: MarkerLayout, distal: MarkerLayout, noise_mm: float
) -> Choices:
    """All disjoint choices of both rings up to the RMS that matters; points (M, 3), LPS mm.

    Among more than `MANY_BALLS` chance fits abound: there, choices with other balls than the
    best one's are listed to `other_balls_limit_mm` only.
    """
    layouts = (proximal, distal)
    wide, narrow = search_limit_mm(noise_mm), other_balls_limit_mm(noise_mm)
    many = len(points) > MANY_BALLS
    found = [_fits(points, layout, narrow if many else wide) for layout in layouts]
    choices = joined(found[0], found[1], len(points))
    if not many or len(choices.rms_mm) == 0:
        return choices
    used = np.sort(np.concatenate(choices.balls(0)))
    merged = [
        _united(one, _fits(points[used], layout, wide), used)
        for one, layout in zip(found, layouts, strict=True)
    ]
    return joined(merged[0], merged[1], len(points))


def _fits(points: Array, layout: MarkerLayout, limit_mm: float) -> Embeddings:
    """Embeddings of one layout, none if there are too few balls."""
    if len(points) < len(layout):
        return Embeddings(np.zeros((0, len(layout)), int), np.zeros(0), complete=True)
    return embeddings(points_mm=points, layout_mm=layout.points_mm, max_rms_mm=limit_mm)


def _united(all_balls: Embeddings, of_used: Embeddings, used: NDArray[np.intp]) -> Embeddings:
    """Embeddings of both searches, each once, best first."""
    balls = np.vstack([all_balls.balls, used[of_used.balls]])
    rms = np.concatenate([all_balls.rms_mm, of_used.rms_mm])
    _, first = np.unique(balls, axis=0, return_index=True)
    first = first[np.argsort(rms[first], kind="stable")]
    return Embeddings(balls[first], rms[first], all_balls.complete and of_used.complete)


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
    same_limit, other_limit = search_limit_mm(noise_mm), other_balls_limit_mm(noise_mm)
    used = set().union(*choices.balls(best))
    rivals = []
    for row, rms in enumerate(choices.rms_mm):
        if row == best:
            continue
        same = used == set().union(*choices.balls(row))
        if rms < (same_limit if same else other_limit):
            rivals.append(row)
    return rivals


def next_best_mm(
    points: Array,
    choices: Choices,
    row: int,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    noise_mm: float,
) -> tuple[float, bool]:
    """RMS of the best choice other than `row`, mm, and whether it is only a lower bound."""
    many = len(points) > MANY_BALLS
    reached = other_balls_limit_mm(noise_mm) if many else search_limit_mm(noise_mm)
    others = np.delete(choices.rms_mm, row)
    if len(others) and others[0] <= reached:
        return float(others[0]), False
    balls = choices.balls(row)
    used = [*balls[0], *balls[1]]
    if len(used) < len(points) or max(map(len, balls)) > WIDER_MARKERS:
        return reached, True
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
