"""What the prescription prints, as rows of words that a checker must find in the PDF's text.

The PDF's text, read back and split at white space, holds each row's words next to one another
and the rows in the order given here.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hexafix.report.patient import day_blocks, printed_values
from hexafix.report.surgeon import surgeon_tables

PrintedRow = tuple[str, ...]


def printed_schedule_rows(document: Mapping[str, Any]) -> list[PrintedRow]:
    """The rows of the patient's large table: time, count, six values each with its arrow."""
    rows: list[PrintedRow] = [printed_values(dict(document))[0]]
    for block in day_blocks(dict(document)):
        rows.append(("Day", block["day"], *block["date"].split()))
        for row in block["rows"]:
            cells = (word for cell in row["cells"] for word in cell)
            rows.append((row["time"], *row["nth"].split(), *cells))
    return rows


def printed_table_rows(document: Mapping[str, Any]) -> list[PrintedRow]:
    """The rows of every table on the surgeon's pages."""
    tables = surgeon_tables(document).values()
    return [tuple(" ".join(row).split()) for table in tables if table for row in table.rows]


def printed_rows(document: Mapping[str, Any]) -> list[PrintedRow]:
    """Every row that the prescription of this plan must print, in order."""
    return printed_schedule_rows(document) + printed_table_rows(document)


def rows_missing(text: str, rows: Iterable[PrintedRow]) -> list[PrintedRow]:
    """Rows that do not follow one another, word for word, in `text`.

    Parameters
    ----------
    text : str
        Text of the PDF's pages, joined in order.
    rows : iterable of tuple of str
        As from `printed_rows`.
    """
    found = text.split()
    places: dict[str, list[int]] = {}
    for place, word in enumerate(found):
        places.setdefault(word, []).append(place)
    missing, start = [], 0
    for row in rows:
        words = list(row)
        hits = (p for p in places.get(words[0], ()) if p >= start)
        place = next((p for p in hits if found[p : p + len(words)] == words), None)
        if place is None:
            missing.append(row)
        else:
            start = place + len(words)
    return missing
