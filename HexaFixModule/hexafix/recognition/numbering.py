"""Which ball is which marker, found by congruence with both rings' layouts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hexafix.errors import InputError, NumberingAmbiguous
from hexafix.hardware import MarkerLayout
from hexafix.recognition.alternatives import Alternative, describe
from hexafix.recognition.choices import (
    NOISE_MM,
    Choices,
    ambiguous_rows,
    next_best_mm,
    search,
)
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM, RingPose, ring_pose
from hexafix.recognition.numbering_refusals import ambiguous, not_found
from hexafix.recognition.rigid import Array

STRUTS_AGREE_MM, STRUTS_DISAGREE_MM = 2.0, 5.0
"""RMS of CT against read strut lengths: one choice below the first (G6), all others above."""

Judge = Callable[[RingPose, RingPose], float]
"""RMS difference in mm between strut lengths of two ring poses (proximal, distal) and readings."""

MAX_NAMED = 12
"""Alternatives kept in a `Numbering`."""


@dataclass(frozen=True, eq=False)
class RingNumbering:
    """The balls of one ring.

    Attributes
    ----------
    numbers : tuple of int
        Marker numbers in the order of the layout.
    balls : tuple of int
        Index of each marker's ball among the balls found.
    rms_mm : float
        RMS distance from the layout after the best rigid motion.
    """

    numbers: tuple[int, ...]
    balls: tuple[int, ...]
    rms_mm: float


@dataclass(frozen=True, eq=False)
class Numbering:
    """The balls of both rings.

    Attributes
    ----------
    proximal, distal : RingNumbering
    unused : tuple of int
        Balls that belong to no ring.
    alternatives : tuple of Alternative
        Other choices below the search limit, best first.
    next_best_mm : float
        RMS of the best other choice, the worse ring's.
    next_best_is_bound : bool
        True if no other choice was met and `next_best_mm` is only a lower bound.
    settled_by : str
        ``layout``, ``strut-readings`` or ``user``.
    """

    proximal: RingNumbering
    distal: RingNumbering
    unused: tuple[int, ...]
    alternatives: tuple[Alternative, ...]
    next_best_mm: float
    next_best_is_bound: bool
    settled_by: str

    @property
    def rms_mm(self) -> float:
        """RMS of the worse ring."""
        return max(self.proximal.rms_mm, self.distal.rms_mm)

    @property
    def margin_mm(self) -> float:
        """RMS of the best other choice minus that of this one (G7)."""
        return self.next_best_mm - self.rms_mm

    @property
    def margin_ratio(self) -> float:
        """RMS of the best other choice over that of this one, this one at least 1 µm."""
        return self.next_best_mm / max(self.rms_mm, 1e-3)

    @property
    def ball_of_number(self) -> dict[int, int]:
        """Ball index of each marker number, both rings."""
        pairs = [
            pair
            for ring in (self.proximal, self.distal)
            for pair in zip(ring.numbers, ring.balls, strict=True)
        ]
        return dict(sorted(pairs))


def number_balls(
    centers_mm: ArrayLike,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    noise_mm: float = NOISE_MM,
    judge: Judge | None = None,
) -> Numbering:
    """Find which balls form which ring and which number each has.

    Parameters
    ----------
    centers_mm : array_like, shape (M, 3)
        All balls found, LPS mm; more than the layouts need are allowed.
    proximal, distal : MarkerLayout
        Layouts of {A} and {B}; numbers differ between the rings.
    noise_mm : float
        Noise of a ball against its place along one axis, mm.
    judge : callable, optional
        RMS difference in mm between the strut lengths of two ring poses and the readings; asked
        only when the layouts leave a choice.

    Raises
    ------
    MarkersNotFound
        A ring is not among the balls (H12, H13, H15).
    ImageRefused
        Only a mirrored layout fits (H01).
    NumberingAmbiguous
        More than one choice fits and the struts do not settle it (H18, H19, H20).

    Notes
    -----
    Rings are told apart by their layouts alone, never by height in the image. A choice's RMS is
    that of its worse ring: a choice is only as good as its worst evidence.
    """
    points = np.asarray(centers_mm, float).reshape(-1, 3)
    check_numbers(proximal, distal)
    choices = search(points, proximal=proximal, distal=distal, noise_mm=noise_mm)
    if len(choices.rms_mm) == 0 or choices.rms_mm[0] > RING_RMS_LIMIT_MM:
        raise not_found(points, choices, proximal=proximal, distal=distal)
    rivals = ambiguous_rows(choices, 0, noise_mm=noise_mm)
    row, settled_by = 0, "layout"
    if rivals or not choices.complete:
        if judge is None or not choices.complete:
            raise ambiguous(choices, rivals, proximal=proximal, distal=distal)
        row = _settle(points, choices, [0, *rivals], judge, proximal=proximal, distal=distal)
        settled_by = "strut-readings"
    return numbering_value(
        points, choices, row, settled_by, proximal=proximal, distal=distal, noise_mm=noise_mm
    )


def check_numbers(proximal: MarkerLayout, distal: MarkerLayout) -> None:
    """Refuse layouts that use a number twice."""
    numbers = (*proximal.numbers, *distal.numbers)
    twice = sorted({number for number in numbers if numbers.count(number) > 1})
    if twice:
        raise InputError.of(
            "number-twice",
            "a marker number is used twice",
            value=", ".join(map(str, twice)),
            limit="each number once over both rings",
            where="markers",
            next_step="give every marker its own number",
        )


def _settle(
    points: Array,
    choices: Choices,
    rows: list[int],
    judge: Judge,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
) -> int:
    """The one row that the struts agree with, all others being clearly out."""
    poses: dict[tuple[str, int], RingPose] = {}

    def pose(side: str, row: int, layout: MarkerLayout, balls: tuple[int, ...]) -> RingPose:
        if (side, row) not in poses:
            poses[side, row] = ring_pose(points[list(balls)], layout)
        return poses[side, row]

    differences = []
    for row in rows:
        a, b = choices.pairs[row]
        balls_a, balls_b = choices.balls(row)
        ring_a = pose("proximal", int(a), proximal, balls_a)
        ring_b = pose("distal", int(b), distal, balls_b)
        differences.append(float(judge(ring_a, ring_b)))
    agree = [row for row, d in zip(rows, differences, strict=True) if d <= STRUTS_AGREE_MM]
    # Written so that a difference that is not a number settles nothing.
    out = sum(d > STRUTS_DISAGREE_MM for d in differences)
    if len(agree) == 1 and out == len(rows) - 1 and choices.rms_mm[agree[0]] <= RING_RMS_LIMIT_MM:
        return agree[0]
    named = describe(
        choices.balls(rows[0]),
        choices.balls(rows[int(np.argmin(differences))]),
        proximal=proximal,
        distal=distal,
    )
    raise NumberingAmbiguous.of(
        "numbering-not-settled",
        f"{len(rows)} numberings fit the layouts and the strut readings do not settle which"
        f" (closest to the readings: {named})",
        value="strut differences " + ", ".join(f"{d:.1f}" for d in sorted(differences)[:4]) + " mm",
        limit=f"one at most {STRUTS_AGREE_MM:g} mm, all others above {STRUTS_DISAGREE_MM:g} mm",
        hazard="H18",
        next_step="check the readings, assign the numbers by hand, or move a marker",
    )


def numbering_value(
    points: Array,
    choices: Choices,
    row: int,
    settled_by: str,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    noise_mm: float,
) -> Numbering:
    """The choice of one row as a `Numbering`, with all other choices as alternatives."""
    balls_a, balls_b = choices.balls(row)
    a, b = choices.pairs[row]
    others = [k for k in range(len(choices.rms_mm)) if k != row]
    alternatives = tuple(
        Alternative(
            describe((balls_a, balls_b), choices.balls(k), proximal=proximal, distal=distal),
            float(choices.rms_mm[k]),
        )
        for k in others[:MAX_NAMED]
    )
    next_best, bound = next_best_mm(
        points,
        choices,
        row,
        proximal=proximal,
        distal=distal,
        noise_mm=noise_mm,
    )
    return Numbering(
        RingNumbering(proximal.numbers, balls_a, float(choices.proximal.rms_mm[a])),
        RingNumbering(distal.numbers, balls_b, float(choices.distal.rms_mm[b])),
        tuple(k for k in range(len(points)) if k not in (*balls_a, *balls_b)),
        alternatives,
        next_best,
        bound,
        settled_by,
    )
