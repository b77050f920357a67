"""The patient's pages as plain strings: the facts, the directions and the large table."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import date
from decimal import Decimal
from itertools import pairwise
from typing import Any

from hexafix.report import words
from hexafix.report.format import format_change, format_row, parse_date

ROWS_PER_PAGE = 32
"""Rows of the large table on one page, a day's heading counted as one."""

WEEKDAYS = ("Monday", "Tuesday", "Wednesday", "Thursday", "Friday", "Saturday", "Sunday")
MONTHS = (
    *("January", "February", "March", "April", "May", "June", "July"),
    *("August", "September", "October", "November", "December"),
)


def long_date(day: date) -> str:
    """``Tuesday 1 December 2026``, in English whatever the machine's locale."""
    return f"{WEEKDAYS[day.weekday()]} {day.day} {MONTHS[day.month - 1]} {day.year}"


def direction(before: str, after: str) -> str:
    """The direction of a change between two printed values."""
    change = Decimal(after) - Decimal(before)
    return words.LONGER if change > 0 else words.SHORTER if change < 0 else words.SAME


def whole_direction(values: Sequence[str], step_mm: float) -> str:
    """The direction of one strut over the whole plan in words.

    Parameters
    ----------
    values : sequence of str
        Printed values, first to last.
    step_mm : float
        The strut's step: ways back of no more than one step are called ``mostly longer``.
    """
    steps = [direction(a, b) for a, b in pairwise(values)]
    turns = [step for step in steps if step != words.SAME]
    runs = [step for k, step in enumerate(turns) if k == 0 or step != turns[k - 1]]
    if len(runs) <= 1:
        return runs[0] if runs else words.SAME
    overall = direction(values[0], values[-1])
    if overall != words.SAME and _way_back(values, overall) <= Decimal(str(step_mm)):
        return f"mostly {overall}"
    if len(runs) == 2:
        return f"first {runs[0]}, then {runs[1]}"
    return "both ways, see arrows"


def _way_back(values: Sequence[str], overall: str) -> Decimal:
    """The farthest a strut goes against its overall direction, mm."""
    sign = 1 if overall == words.LONGER else -1
    farthest, back = Decimal("-Infinity"), Decimal(0)
    for value in values:
        along = sign * Decimal(value)
        farthest = max(farthest, along)
        back = max(back, farthest - along)
    return back


def printed_values(document: dict[str, Any]) -> list[tuple[str, ...]]:
    """All rows of the schedule as printed, row 0 first."""
    schedule = document["schedule"]
    return [format_row(row, schedule["strut_step_mm"]) for row in schedule["rows"]]


def strut_summary(document: dict[str, Any]) -> list[dict[str, str]]:
    """One entry a strut: number, colour, direction in words, first and last value, change."""
    table = printed_values(document)
    changes = format_change(table[0], table[-1])
    step_mm = document["schedule"]["strut_step_mm"]
    summary = []
    for index, colour in enumerate(words.STRUT_COLOURS):
        column = [row[index] for row in table]
        overall = direction(column[0], column[-1])
        whole = whole_direction(column, step_mm)
        summary.append(
            {
                "number": str(index + 1),
                "colour": colour.name,
                "fill": colour.fill,
                "ink": colour.ink,
                "direction": whole,
                "arrow": words.ARROWS[overall] if whole.endswith(overall) else "▲▼",
                "overall": overall,
                "head": whole if whole.endswith(overall) else "see arrows",
                "start": column[0],
                "end": column[-1],
                "change": changes[index],
            }
        )
    return summary


def day_blocks(document: dict[str, Any]) -> list[dict[str, Any]]:
    """The adjustments grouped by day, each value with the arrow of its own turn."""
    schedule = document["schedule"]
    per_day = schedule["adjustments_per_day"]
    table = printed_values(document)
    blocks: list[dict[str, Any]] = []
    for row, before, after in zip(schedule["rows"][1:], table, table[1:], strict=False):
        if not blocks or blocks[-1]["day"] != str(row["day"]):
            when = long_date(parse_date(row["date"]))
            blocks.append({"day": str(row["day"]), "date": when, "iso": row["date"], "rows": []})
        arrows = [words.ARROWS[direction(a, b)] for a, b in zip(before, after, strict=True)]
        blocks[-1]["rows"].append(
            {
                "time": words.time_of_day(row["adjustment"], per_day),
                "nth": f"{row['adjustment']} of {per_day}",
                "cells": [list(pair) for pair in zip(after, arrows, strict=True)],
            }
        )
    return blocks


def paginate(blocks: list[dict[str, Any]], rows_per_page: int = ROWS_PER_PAGE) -> list[list]:
    """Days spread over pages so that no day is torn apart; the start row takes two rows."""
    pages: list[list] = [[]]
    used = 2
    for block in blocks:
        size = len(block["rows"]) + 1
        if pages[-1] and used + size > rows_per_page:
            pages.append([])
            used = 0
        pages[-1].append(block)
        used += size
    return pages


def patient_content(document: dict[str, Any]) -> dict[str, Any]:
    """Everything on the patient's pages, strings only."""
    schedule = document["schedule"]
    blocks = day_blocks(document)
    per_day = schedule["adjustments_per_day"]
    bone = document["limb"]["bone"]
    first = parse_date(schedule["start_date"])
    last = parse_date(schedule["rows"][-1]["date"])
    times = words.TIMES_OF_DAY.get(per_day)
    often = "1 adjustment" if per_day == 1 else f"{per_day} adjustments"
    return {
        "facts": [
            ["First day", long_date(first)],
            ["Last day", long_date(last)],
            ["Each day", often + (f": {', '.join(times)}" if times else "")],
            ["In all", f"{schedule['days']} days, {len(schedule['rows']) - 1} adjustments"],
        ],
        "struts": strut_summary(document),
        "start": list(printed_values(document)[0]),
        "pages": paginate(blocks),
        "steps": words.adjustment_steps(per_day),
        "missed": words.MISSED,
        "done_twice": words.DONE_TWICE,
        "warnings": words.warning_signs(bone),
    }
