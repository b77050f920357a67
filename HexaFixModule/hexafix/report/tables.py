"""The two tables beside the PDF: ``schedule.csv`` and ``markers.mrk.json``."""

from __future__ import annotations

import json
from typing import Any

from hexafix.report.format import format_row

SCHEDULE_COLUMNS = ("day", "date", "adjustment", *(f"strut_{n}_mm" for n in range(1, 7)))
"""Columns of ``schedule.csv``."""

MARKUPS_SCHEMA = (
    "https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
    "Resources/Schema/markups-schema-v1.0.3.json#"
)
"""Name of the markups format that 3D Slicer checks on loading."""

LPS_AXES = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]


def schedule_csv(document: dict[str, Any]) -> bytes:
    """The schedule as CSV: the readings of today, then one row an adjustment.

    Parameters
    ----------
    document : dict
        The finished plan, ``plan.json``.

    Returns
    -------
    bytes
        UTF-8, LF line ends. Strut values are scale values, mm, with the same characters as in the
        prescription.
    """
    schedule = document["schedule"]
    lines: list[tuple[str, ...]] = [SCHEDULE_COLUMNS]
    for row in schedule["rows"]:
        values = format_row(row, schedule["strut_step_mm"])
        lines.append((str(row["day"]), row["date"], str(row["adjustment"]), *values))
    return "".join(",".join(line) + "\n" for line in lines).encode("utf-8")


def markers_mrk_json(document: dict[str, Any]) -> bytes:
    """The numbered ball centres as one 3D Slicer markups list, LPS mm.

    One list for both rings: Slicer's scene reader takes only the first list of a file. Each
    point's label is the ball's number, its description names the ring.

    Parameters
    ----------
    document : dict
        The finished plan, ``plan.json``.
    """
    balls = sorted(document["balls"], key=lambda ball: ball["number"])
    points = [
        {
            "id": str(ball["number"]),
            "label": str(ball["number"]),
            "description": f"{ball['ring']} ring",
            "associatedNodeID": "",
            "position": [float(x) for x in ball["center_mm"]],
            "orientation": LPS_AXES,
            "selected": True,
            "locked": True,
            "visibility": True,
            "positionStatus": "defined",
        }
        for ball in balls
    ]
    markup = {
        "type": "Fiducial",
        "name": "HexaFix markers",
        "coordinateSystem": "LPS",
        "coordinateUnits": "mm",
        "locked": True,
        "fixedNumberOfControlPoints": True,
        "labelFormat": "%d",
        "lastUsedControlPointNumber": max((ball["number"] for ball in balls), default=0),
        "controlPoints": points,
    }
    text = json.dumps({"@schema": MARKUPS_SCHEMA, "markups": [markup]}, indent=1, allow_nan=False)
    return (text + "\n").encode("utf-8")
