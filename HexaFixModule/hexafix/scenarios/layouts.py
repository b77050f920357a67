"""Where the scenarios' marker balls sit, ring by ring and count by count."""

from __future__ import annotations

from collections.abc import Sequence

from hexafix.hardware import MarkerLayout

_Sites = tuple[tuple[int, ...], tuple[int, ...]]

_PROXIMAL: dict[int, _Sites] = {
    3: ((60, 109, 203), (20, 20, 20)),
    4: ((32, 79, 142, 239), (20, 45, 20, 20)),
    5: ((16, 73, 159, 206, 253), (35, 20, 20, 50, 20)),
    6: ((57, 116, 184, 231, 277, 330), (35, 20, 50, 20, 20, 35)),
    7: ((8, 57, 112, 160, 213, 260, 310), (50, 35, 35, 65, 20, 20, 20)),
}
"""Balls of the proximal ring above its plate: sweep angles in degrees and heights in mm."""

_DISTAL: dict[int, _Sites] = {
    3: ((23, 103, 216), (20, 20, 20)),
    4: ((63, 111, 175, 262), (20, 20, 45, 20)),
    5: ((59, 117, 166, 214, 342), (-55, -28, -40, -28, -28)),
    6: ((46, 108, 160, 208, 254, 333), (-40, -40, -28, -28, -55, -28)),
    7: ((3, 52, 105, 152, 199, 245, 317), (-28, -40, -65, -28, -40, -28, -55)),
}
"""Balls of the distal ring: up to four between the rings, more below its plate."""

_FIRST_DISTAL = 11
"""Number of the distal ring's first ball."""


def balls(proximal: int, distal: int, *, radius_mm: float = 100.0) -> dict[str, MarkerLayout]:
    """Layouts that keep the preferred angle rule, with so many balls a ring."""
    return {
        "proximal": _layout(*_PROXIMAL[proximal], radius_mm, 1),
        "distal": _layout(*_DISTAL[distal], radius_mm, _FIRST_DISTAL),
    }


def relaxed() -> dict[str, MarkerLayout]:
    """A proximal layout that keeps only the relaxed angle rule: two neighbours stand close."""
    return {
        "proximal": _layout((10, 42, 195), (20, 20, 20), 100.0, 1),
        "distal": _layout(*_DISTAL[3], 100.0, _FIRST_DISTAL),
    }


def even() -> dict[str, MarkerLayout]:
    """The proximal balls exactly 120° apart: turned by a third it looks the same."""
    return {
        "proximal": _layout((0, 120, 240), (20, 20, 20), 100.0, 1),
        "distal": _layout((20, 112, 235), (20, 20, 20), 100.0, _FIRST_DISTAL),
    }


def alike() -> dict[str, MarkerLayout]:
    """The same three angles on both rings: either could be the other."""
    return {
        "proximal": _layout(*_PROXIMAL[3], 100.0, 1),
        "distal": _layout((28, 121, 340), (20, 20, 20), 100.0, _FIRST_DISTAL),
    }


def _layout(
    sweep_deg: Sequence[float], height_mm: Sequence[float], radius_mm: float, first: int
) -> MarkerLayout:
    return MarkerLayout.of(
        radius_mm=[radius_mm] * len(sweep_deg),
        sweep_deg=sweep_deg,
        height_mm=height_mm,
        first_number=first,
    )
