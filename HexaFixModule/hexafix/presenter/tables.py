"""The tables of the workstation from the pipeline's documents; every number formatted once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from hexafix.presenter.state import Step, Table


def _mm(value: float | None) -> str:
    from hexafix.pipeline import format_mm

    return "-" if value is None else format_mm(value)


def _margin(value: float | None) -> str:
    from hexafix.pipeline import format_margin

    return "-" if value is None else format_margin(value)


def _deg(value: float | None) -> str:
    from hexafix.pipeline import format_deg

    return "-" if value is None else format_deg(value)


def _number(value: float, digits: int) -> str:
    from hexafix.pipeline import format_number

    return format_number(value, digits)


def _measure(value: float | None) -> str:
    from hexafix.pipeline import format_measure

    return format_measure(value)


def _point(values: Any) -> tuple[str, ...]:
    return tuple(_mm(value) for value in values)


def summary(step: Step, document: Mapping[str, Any]) -> str:
    """A done step in a few words."""
    match step:
        case Step.LOAD:
            return " x ".join(str(count) for count in document["size_ijk"]) + " voxels"
        case Step.MARKERS:
            count, others = len(document["balls"]), len(document["rejected"])
            return f"{count} balls, {others} other places rejected"
        case Step.NUMBERING:
            return SETTLED.get(document.get("settled_by", ""), "numbered")
        case Step.POSES:
            rms = (_mm(document["rings"][ring]["rms_mm"]) for ring in ("proximal", "distal"))
            return "residual {} mm proximal, {} mm distal".format(*rms)
        case Step.READINGS:
            doubtful = [s["strut"] for s in document["struts"] if s["verdict"] != "agrees"]
            return "read again: " + _listed(doubtful) if doubtful else "readings and CT agree"
        case Step.CORRECTION:
            return "within the struts' stroke at the end"
        case Step.SCHEDULE:
            found = document["schedule"]
            return f"{found['days']} days, {found['adjustments_per_day']} adjustments a day"
    return "recomputed by another road, printed and read back"


SETTLED = {
    "layout": "settled by the layouts",
    "strut-readings": "settled by the strut readings",
    "user": "numbered by hand",
}
"""What settled a numbering, in words."""


def _listed(struts: list[int]) -> str:
    return ", ".join(f"strut {strut}" for strut in struts)


def series(document: Mapping[str, Any]) -> Table:
    """The series of a folder."""
    columns = ("No.", "Description", "Modality", "Slices", "Size", "SeriesInstanceUID")
    rows, alerts = [], []
    for row in document["series"]:
        rows.append(
            (
                str(row["number"]),
                str(row["description"]),
                str(row["modality"] or ""),
                str(row["slices"]),
                " x ".join(str(count) for count in row["size_ij"]),
                row["series_instance_uid"] or "",
            )
        )
        why = row["left_out"] or "; ".join(fault["message"] for fault in row["refused"])
        alerts.append(why or "")
    return Table(columns, tuple(rows), tuple(alerts))


def image(document: Mapping[str, Any]) -> Table:
    """What the image is."""
    tilt = document.get("gantry_tilt_deg")
    rows = [
        ("Kind", str(document["kind"])),
        ("Size", " x ".join(str(count) for count in document["size_ijk"]) + " voxels"),
        ("Spacing", " x ".join(_mm(value) for value in document["spacing_mm"]) + " mm"),
        ("Gantry tilt", "none" if tilt is None else f"{_deg(tilt)} deg, resampled"),
    ]
    alerts = ["" for _ in rows]
    for text in document.get("warnings", ()):
        rows.append(("Warning", text))
        alerts.append(text)
    return Table(("", "Image"), tuple(rows), tuple(alerts))


def balls(document: Mapping[str, Any], number_of: Mapping[int, str]) -> Table:
    """The balls found."""
    columns = ("Ball", "Number", "L mm", "P mm", "S mm", "Diameter mm", "Sigma mm")
    columns += ("Residual mm", "HU")
    rows, alerts = [], []
    for index, ball in enumerate(document["balls"]):
        rows.append(
            (
                str(index + 1),
                number_of.get(index, "-"),
                *_point(ball["center_mm"]),
                _mm(ball["diameter_mm"]),
                _number(max(ball["sigma_mm"]), 4),
                _mm(ball["rms_residual_mm"]),
                _number(ball["core_hu"], 0),
            )
        )
        added = ("added by the user",) if ball.get("added") else ()
        alerts.append("; ".join([*added, *ball["warnings"]]))
    return Table(columns, tuple(rows), tuple(alerts))


def rejected(document: Mapping[str, Any]) -> Table:
    """Candidates that are no balls, and why."""
    rows = tuple((*_point(other["center_mm"]), other["reason"]) for other in document["rejected"])
    return Table(("L mm", "P mm", "S mm", "Reason"), rows, ("",) * len(rows))


def numbering(document: Mapping[str, Any]) -> Table:
    """Each number's ball and residual."""
    rows, alerts = [], []
    for ring in ("proximal", "distal"):
        for number, residual in document["rings"][ring]["residuals_mm"].items():
            ball = document["assigned"].get(number)
            rows.append((number, ring, "-" if ball is None else str(ball + 1), _mm(residual)))
            alerts.append("no ball yet" if ball is None else "")
    return Table(("Number", "Ring", "Ball", "Residual mm"), tuple(rows), tuple(alerts))


def poses(document: Mapping[str, Any]) -> Table:
    """Both rings in the image, and the proximal ring in the distal one."""
    columns = ("Pose", "x mm", "y mm", "z mm", "α deg", "β deg", "γ deg", "Residual mm")
    named = (
        ("proximal ring in LPS", document["rings"]["proximal"]),
        ("distal ring in LPS", document["rings"]["distal"]),
        ("proximal in distal ring", document["mechanism"]),
    )
    rows = tuple(
        (
            name,
            *_point(pose["position_mm"]),
            *(_deg(value) for value in pose["angles_deg"]),
            _mm(pose.get("rms_mm")),
        )
        for name, pose in named
    )
    return Table(columns, rows, ("",) * len(rows))


def gates(found: Any) -> Table:
    """Every gate with its figure."""
    rows, alerts = [], []
    for gate in found:
        rows.append(
            (
                gate["gate"],
                gate["name"],
                _measure(gate["value"]),
                _measure(gate["limit"]),
                gate["unit"],
                "pass" if gate["passed"] else "RED",
            )
        )
        told = "told" in gate["unit"] and "BEYOND" in gate["name"]
        alerts.append(gate["message"] if told or not gate["passed"] else "")
    columns = ("Gate", "What", "Value", "Limit", "Unit", "Verdict")
    return Table(columns, tuple(rows), tuple(alerts))


def layout(document: Mapping[str, Any]) -> Table:
    """Both rings' layout: angles, rule, uniqueness, predicted error."""
    columns = ("Ring", "Included angles deg", "Rule", "Next numbering mm", "Predicted error mm")
    columns += ("Predicted error deg",)
    rows, alerts = [], []
    for ring in ("proximal", "distal"):
        found = document[ring]
        rows.append(
            (
                ring,
                "/".join(_measure(angle) for angle in found["included_angles_deg"]),
                found["rule"],
                _margin(found["uniqueness_mm"]),
                _mm(found["predicted_error_mm"]),
                _deg(found["predicted_error_deg"]),
            )
        )
        alerts.append("" if found["rule"] == "preferred" else f"the layout is {found['rule']}")
    return Table(columns, tuple(rows), tuple(alerts))


VERDICTS = {"agrees": "", "read-again": "read again", "disagrees": "disagrees with the CT"}
"""What a strut's verdict asks of the user."""


def struts(document: Mapping[str, Any]) -> Table:
    """The readings against the CT."""
    columns = ("Strut", "Reading mm", "Length mm", "Length by CT mm", "CT - reading mm", "Verdict")
    rows, alerts = [], []
    for strut in document["struts"]:
        verdict = strut["verdict"]
        values = (strut[key] for key in ("reading_mm", "length_mm", "ct_length_mm"))
        rows.append(
            (
                str(strut["strut"]),
                *_point(values),
                _mm(strut["difference_mm"]),
                verdict.replace("-", " "),
            )
        )
        alerts.append(VERDICTS.get(verdict, verdict))
    return Table(columns, tuple(rows), tuple(alerts))


def target(document: Mapping[str, Any]) -> Table:
    """Where the correction leads: the pose at the end, and each strut there."""
    rows: list[tuple[str, str]] = []
    alerts: list[str] = []
    pose = document.get("target")
    if pose is not None:
        named = (("x", "y", "z"), pose["position_mm"], _mm, "mm")
        angles = (("α", "β", "γ"), pose["angles_deg"], _deg, "deg")
        for names, values, text, unit in (named, angles):
            rows += [(f"{n} {unit}", text(v)) for n, v in zip(names, values, strict=True)]
        alerts += [""] * len(rows)
    ends = zip(document.get("struts_mm") or (), document.get("within_stroke") or (), strict=True)
    for strut, (reading, inside) in enumerate(ends, 1):
        rows.append((f"Strut {strut} at the end mm", _mm(reading)))
        alerts.append("" if inside else "beyond the strut's stroke")
    return Table(("Target", "Value"), tuple(rows), tuple(alerts))


def strut_plan(document: Mapping[str, Any]) -> Table:
    """The scale values to set, row by row."""
    from hexafix.pipeline import format_row

    step = document["schedule"]["strut_step_mm"]
    columns = ("Day", "Date", "Adjustment", *(f"Strut {k} mm" for k in range(1, 7)))
    rows = tuple(
        (str(row["day"]), row["date"], str(row["adjustment"]), *format_row(row, step))
        for row in document["schedule"]["rows"]
    )
    return Table(columns, rows, ("",) * len(rows))


def schedule(document: Mapping[str, Any]) -> Table:
    """The schedule in a few lines."""
    found = document["schedule"]
    rows = (
        ("Start", found["start_date"]),
        ("Days", str(found["days"])),
        ("Adjustments a day", str(found["adjustments_per_day"])),
        ("Ruled by", found["ruling_point"]),
        ("Rate", f"{_mm(found['rate_mm_per_day'])} mm and {_deg(found['rate_deg_per_day'])} deg "
                 "a day"),
        ("Rounding leaves at the end", f"{_mm(found['end_error_mm'])} mm and "
                                       f"{_deg(found['end_error_deg'])} deg"),
    )  # fmt: skip
    return Table(("", "Schedule"), rows, ("",) * len(rows))
