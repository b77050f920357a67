"""What is printed against the plan: CSV, markups and the text read back out of the PDF."""

from __future__ import annotations

import csv
import io
import json
import re
from collections.abc import Mapping
from typing import Any

from hexafix.report.printed import printed_rows, rows_missing
from hexafix.threads import PDFIUM

TURN = re.compile(r"(\d+) of (\d+)\s+" + r"\s+".join([r"(-?\d+(?:\.\d+)?)\s+\S+"] * 6))
"""One row of the patient's table in the PDF's text: adjustment, count, six values with arrows."""


def check_printed(document: dict[str, Any], files: Mapping[str, bytes]) -> list[str]:
    """Every difference between the plan and what patient and surgeon would hold.

    Parameters
    ----------
    document : dict
        ``plan.json``.
    files : mapping of str to bytes
        The export's files by name.

    Returns
    -------
    list of str
        Empty if all agree.
    """
    return [
        *_csv_differences(document, files["schedule.csv"]),
        *_markup_differences(document, files["markers.mrk.json"]),
        *_pdf_differences(document, files["prescription.pdf"]),
    ]


def _csv_differences(document: dict[str, Any], content: bytes) -> list[str]:
    rows = list(csv.reader(io.StringIO(content.decode("utf-8"))))
    columns = ["day", "date", "adjustment", *(f"strut_{n}_mm" for n in range(1, 7))]
    wrong = [] if rows and rows[0] == columns else ["schedule.csv: columns"]
    planned = document["schedule"]["rows"]
    if len(rows) - 1 != len(planned):
        return [*wrong, f"schedule.csv: {len(rows) - 1} rows, planned {len(planned)}"]
    for place, (row, plan) in enumerate(zip(rows[1:], planned, strict=True)):
        given = (int(row[0]), row[1], int(row[2]), [float(value) for value in row[3:]])
        if given != (plan["day"], plan["date"], plan["adjustment"], plan["strut_mm"]):
            wrong.append(f"schedule.csv: row {place}")
    return wrong


def _markup_differences(document: dict[str, Any], content: bytes) -> list[str]:
    markup = json.loads(content)["markups"]
    if any(one["coordinateSystem"] != "LPS" for one in markup):
        return ["markers.mrk.json: not LPS"]
    marked = {point["label"]: point["position"] for one in markup for point in one["controlPoints"]}
    planned = {str(ball["number"]): ball["center_mm"] for ball in document["balls"]}
    numbered = document["numbering"]
    wrong = [] if marked == planned else ["markers.mrk.json: numbers or centres"]
    return wrong if numbered == planned else [*wrong, "numbering: differs from the balls"]


def _pdf_differences(document: dict[str, Any], content: bytes) -> list[str]:
    import pypdfium2

    try:
        with PDFIUM, pypdfium2.PdfDocument(content) as pdf:
            pages = [page.get_textpage().get_text_range() for page in pdf]
    except pypdfium2.PdfiumError as error:
        return [f"prescription.pdf: cannot be read back ({error})"]
    text = "\n".join(pages)
    wrong = [
        f"prescription.pdf: not printed as planned: {' '.join(row)}"
        for row in rows_missing(text, printed_rows(document))
    ]
    limb = f"{document['limb']['side']} {document['limb']['bone']}".upper()
    wrong += [
        f"prescription.pdf: page {number} does not name the limb and the case"
        for number, page in enumerate(pages, start=1)
        if limb not in " ".join(page.split()) or document["case_id"] not in page
    ]
    return wrong + _turn_differences(document, text)


def _turn_differences(document: dict[str, Any], text: str) -> list[str]:
    """The patient's table, parsed out of the text by itself."""
    found = [(int(turn[0]), [float(value) for value in turn[2:]]) for turn in TURN.findall(text)]
    planned = [(row["adjustment"], row["strut_mm"]) for row in document["schedule"]["rows"][1:]]
    if found == planned:
        return []
    first = next(
        (n for n, pair in enumerate(zip(found, planned, strict=False), 1) if pair[0] != pair[1]),
        min(len(found), len(planned)) + 1,
    )
    return [
        f"prescription.pdf: the table holds {len(found)} turns, planned {len(planned)}; "
        f"turn {first} is the first that differs"
    ]
