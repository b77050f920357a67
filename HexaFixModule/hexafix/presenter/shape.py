"""The case document as doors read it: each part is of its kind, or nothing.

A case file may hold anything, and its faults stand in the banners. A door fills its fields from the
document and must not stumble over what they refuse. What is not of its kind becomes None here, or
points without numbers: it is empty on the screen, and written back it is as faulty as before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

Shape = Callable[[Any], Any]
"""Gives the value where it is of its kind, else what stands for it."""


def text(value: Any) -> str | None:
    """A text."""
    return value if isinstance(value, str) else None


def whole(value: Any) -> int | None:
    """A whole number."""
    return value if isinstance(value, int) and not isinstance(value, bool) else None


def number(value: Any) -> float | None:
    """A number."""
    return value if isinstance(value, float) else whole(value)


def row(shape: Shape, size: int) -> Shape:
    """So many values: what is missing is None, and so are all of a list that is too long."""

    def read(value: Any) -> list[Any]:
        given = value if isinstance(value, list) and len(value) <= size else []
        return [shape(item) for item in [*given, *[None] * size][:size]]

    return read


def rows(shape: Shape) -> Shape:
    """A list; None where it is something else."""
    return lambda value: [shape(item) for item in value] if isinstance(value, list) else None


def part(**shapes: Shape) -> Shape:
    """An object, its other keys as they are; None where it is something else."""

    def read(value: Any) -> dict[str, Any] | None:
        if not isinstance(value, dict):
            return None
        return {k: shapes[k](held) if k in shapes else held for k, held in value.items()}

    return read


POINT = row(number, 3)


def _marker(value: Any) -> dict[str, Any]:
    given = value if isinstance(value, dict) else {}
    keys = {"number": whole, "radius_mm": number, "sweep_deg": number, "height_mm": number}
    return {**given, **{key: shape(given.get(key)) for key, shape in keys.items()}}


def _readings(value: Any) -> list[float | None] | None:
    return row(number, 6)(value) if isinstance(value, list) else None


def _risks(value: Any) -> list[list[float | None]] | None:
    """None is right there: what is no list must not become it."""
    return None if value is None else rows(POINT)(value) or [POINT(None)]


def _fixator(value: Any) -> Any:
    return value if isinstance(value, str | dict) else None


_NEEDED: Mapping[str, Mapping[str, Shape]] = {
    "target-pose": {"position_mm": POINT, "angles_deg": POINT},
    "fragment-motion": {"matrix_lps": row(row(number, 4), 4)},
    "landmarks": {"moving_points_lps_mm": rows(POINT), "fixed_points_lps_mm": rows(POINT)},
    "deformity": {"origin_lps_mm": POINT},
}
"""What each kind of correction cannot be shown without."""


def _complete(value: Any) -> bool:
    return all(map(_complete, value)) if isinstance(value, list) else value is not None


def _correction(value: Any) -> dict[str, Any] | None:
    """Whole or not at all: doors set it whole, too."""
    needed = _NEEDED.get(str(value.get("kind"))) if isinstance(value, dict) else None
    if needed is None:
        return None
    lists: list[Any] = [value.get(key) for key in needed]
    right = all(
        _complete(held) and shape(held) == held and len(held) == len(lists[0])
        for held, shape in zip(lists, needed.values(), strict=True)
    )
    others = (held for key, held in value.items() if key not in needed)
    return value if right and not any(isinstance(held, list | dict) for held in others) else None


_DOCUMENT = part(
    case_id=text,
    limb=part(side=text, bone=text),
    image=part(path=text, series_instance_uid=text),
    fixator=_fixator,
    markers=part(ball_diameter_mm=number, proximal=rows(_marker), distal=rows(_marker)),
    strut_readings_mm=_readings,
    correction=_correction,
    schedule=part(
        start_date=text,
        adjustments_per_day=whole,
        strut_step_mm=number,
        max_rate_mm_per_day=number,
        max_rate_deg_per_day=number,
        compensation=text,
        structures_at_risk_lps_mm=_risks,
    ),
)


def shaped(document: Mapping[str, Any]) -> dict[str, Any]:
    """A case document in which every part that doors read is of its kind, or None."""
    return _DOCUMENT(dict(document))
