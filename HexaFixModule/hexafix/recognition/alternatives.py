"""Other numberings, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hexafix.hardware import MarkerLayout

Balls = tuple[tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True, slots=True)
class Alternative:
    """A numbering that was not chosen.

    Attributes
    ----------
    words : str
        How it differs from the chosen one.
    rms_mm : float
        RMS of its worse ring.
    """

    words: str
    rms_mm: float


def describe(chosen: Balls, other: Balls, *, proximal: MarkerLayout, distal: MarkerLayout) -> str:
    """How another choice of balls differs from the chosen one.

    Parameters
    ----------
    chosen, other : pair of tuples of int
        Ball of each marker, in the order of the layouts, proximal and distal.
    """
    layouts = (proximal, distal)
    number = {
        ball: marker
        for balls, layout in zip(chosen, layouts, strict=True)
        for ball, marker in zip(balls, layout.numbers, strict=True)
    }
    if chosen == other:
        return "the same numbering"
    if set(other[0]) == set(chosen[1]) and set(other[1]) == set(chosen[0]):
        new = {
            number[ball]: marker
            for balls, layout in zip(other, layouts, strict=True)
            for ball, marker in zip(balls, layout.numbers, strict=True)
        }
        return (
            "rings exchanged: "
            + _list(sorted(new))
            + " become "
            + _list([new[k] for k in sorted(new)])
        )
    words = [
        _ring_words(a, b, layout, side, number)
        for a, b, layout, side in zip(chosen, other, layouts, ("proximal", "distal"), strict=True)
        if a != b
    ]
    return " and ".join(words)


def _ring_words(
    chosen: tuple[int, ...],
    other: tuple[int, ...],
    layout: MarkerLayout,
    side: str,
    number: dict[int, int],
) -> str:
    """The change within one ring."""
    if set(chosen) == set(other):
        order = [other.index(ball) for ball in chosen]
        return f"{side} {relabelling_words(order, layout)}"
    changes = []
    for marker, old_ball, new_ball in zip(layout.numbers, chosen, other, strict=True):
        if old_ball == new_ball:
            continue
        named = f"the ball of {number[new_ball]}" if new_ball in number else "an unused ball"
        changes.append(f"number {marker} on {named}")
    return f"{side} ring with " + ", ".join(changes)


def _list(numbers: list[int]) -> str:
    return ",".join(map(str, numbers))


def relabelling_words(order: Sequence[int], layout: MarkerLayout) -> str:
    """A wrong numbering of one ring in words.

    Parameters
    ----------
    order : sequence of int
        Index of the site for which each site's ball is taken, in the order of the layout.
    """
    around = np.argsort(np.mod([s.sweep_rad for s in layout.sites], 2 * np.pi), kind="stable")
    old = [layout.numbers[k] for k in around]
    new = [layout.numbers[order[k]] for k in around]
    shifts = [old[k:] + old[:k] for k in range(len(old))]
    verb = "exchanged for"
    if new in shifts:
        verb = "turned to"
    elif new[::-1] in shifts:
        verb = "turned over to"
    else:
        changed = [k for k in range(len(old)) if old[k] != new[k]]
        old, new = [old[k] for k in changed], [new[k] for k in changed]
    return f"numbers {_list(old)} {verb} {_list(new)}"
