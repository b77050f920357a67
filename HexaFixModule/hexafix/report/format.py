"""How numbers become text: one place for CSV, PDF and the check that reads the PDF back.

Every number is formatted here and handed on as a string, so that no later program drops a zero,
turns a hyphen into a dash or prints ``-0.00``.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from decimal import ROUND_HALF_EVEN, Decimal

from hexafix.errors import HexaFixError, InputError

POSITION_DIGITS = 3
"""Decimals of positions and their sigma, mm."""

ANGLE_DIGITS = 3
"""Decimals of angles and their sigma, degrees."""

FAR_MM = 10.0
"""Another numbering that misses by so much cannot be meant, and hundredths of it mean nothing."""

OFF_STEP_LIMIT = 1e-6
"""Farthest a strut value may lie from a multiple of the strut's step, mm."""


def format_number(value: float, digits: int) -> str:
    """`value` with exactly `digits` decimals, ASCII hyphen as minus, never a negative zero."""
    number = Decimal(repr(float(value)))
    if not number.is_finite():
        raise InputError.of(
            "number-not-finite",
            "a number to be printed is not finite",
            value=repr(value),
            hazard="H55",
        )
    text = f"{number.quantize(Decimal(1).scaleb(-digits), rounding=ROUND_HALF_EVEN):f}"
    return text.lstrip("-") if not any(mark in "123456789" for mark in text) else text


def format_mm(value: float) -> str:
    """A position or distance, mm, three decimals."""
    return format_number(value, POSITION_DIGITS)


def format_margin(value: float) -> str:
    """How far off something else is, mm: a tenth where it is far, all decimals near a limit."""
    return format_number(value, 1) if abs(value) >= FAR_MM else format_mm(value)


def format_deg(value: float) -> str:
    """An angle, degrees, three decimals."""
    return format_number(value, ANGLE_DIGITS)


def format_measure(value: float | None) -> str:
    """A measure of unknown size: four significant digits, below 0.001 as ``2.2e-16``."""
    if value is None:
        return "-"
    magnitude = abs(float(value))
    if magnitude == 0.0:
        return "0"
    if magnitude < 1e-3:
        return f"{float(value):.1e}"
    digits = next((d for d, top in enumerate((1e3, 1e2, 1e1, 1.0)) if magnitude >= top), 4)
    return format_number(value, digits)


def step_decimals(step_mm: float) -> int:
    """Decimals that every multiple of a strut's step needs: 0.5 → 1, 0.25 → 2, 1 → 0."""
    exponent = Decimal(repr(float(step_mm))).normalize().as_tuple().exponent
    return max(0, -int(exponent))


def format_setting(value_mm: float, step_mm: float) -> str:
    """A scale value to set: a multiple of the strut's step, with the decimals the step needs.

    Raises
    ------
    HexaFixError
        If the value is no multiple of the step (H43): printing it would round a second time.
    """
    turns = value_mm / step_mm
    if abs(turns - round(turns)) * step_mm > OFF_STEP_LIMIT:
        raise HexaFixError.of(
            "value-off-step",
            "a strut value to set is not a multiple of the strut's step",
            value=f"{value_mm!r} mm",
            limit=f"{step_mm!r} mm",
            hazard="H43",
        )
    return format_number(round(turns) * step_mm, step_decimals(step_mm))


def format_reading(value_mm: float, step_mm: float) -> str:
    """A scale reading as it was given, all its decimals, at least those of the strut's step."""
    given = Decimal(repr(float(value_mm))).normalize()
    return format_number(value_mm, max(step_decimals(step_mm), -int(given.as_tuple().exponent)))


def format_row(row: dict, step_mm: float) -> tuple[str, ...]:
    """The six strut values of a schedule row: row 0 as read, every other one as set."""
    is_start = row["day"] == 0
    as_text = format_reading if is_start else format_setting
    return tuple(as_text(value, step_mm) for value in row["strut_mm"])


def format_change(before: Sequence[str], after: Sequence[str]) -> tuple[str, ...]:
    """Change of printed values, unsigned, exact in the printed decimals."""
    pairs = zip(before, after, strict=True)
    return tuple(f"{abs(Decimal(b) - Decimal(a)):f}" for a, b in pairs)


def parse_date(text: str) -> date:
    """An ISO date; the day index stays the authority (H45)."""
    try:
        return date.fromisoformat(text)
    except (TypeError, ValueError) as error:
        raise InputError.of(
            "date-wrong",
            "a date of the schedule is not an ISO date",
            value=repr(text),
            limit="YYYY-MM-DD",
            hazard="H45",
        ) from error
