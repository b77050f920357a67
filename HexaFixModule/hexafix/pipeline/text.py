"""Numbers as text for doors: the same rounding as on the prescription."""

from hexafix.report.format import (
    format_change,
    format_deg,
    format_margin,
    format_measure,
    format_mm,
    format_number,
    format_reading,
    format_row,
    format_setting,
)

__all__ = [
    "format_change",
    "format_deg",
    "format_margin",
    "format_measure",
    "format_mm",
    "format_number",
    "format_reading",
    "format_row",
    "format_setting",
]
