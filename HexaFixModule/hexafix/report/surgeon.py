"""The surgeon's pages as plain strings: tables of poses, struts, gates, balls and provenance."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from hexafix.report import patient
from hexafix.report.format import format_deg, format_measure, format_mm, format_number

REJECTED_SHOWN = 6
"""Rejected candidates printed; the rest stand in plan.json."""

LIBRARIES_A_ROW = 4
"""So that a row stays on one line."""

RINGS = ("proximal", "distal")


@dataclass(frozen=True, slots=True)
class Table:
    """One printed table.

    Attributes
    ----------
    title : str
    head : tuple of str
    rows : tuple of tuple of str
        Cells, row by row, each as long as `head`.
    note : str
        What a reader must know about frame, sign and unit.
    """

    title: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    note: str = ""

    def as_strings(self) -> dict[str, Any]:
        """The table for the template."""
        rows = [list(row) for row in self.rows]
        return {"title": self.title, "head": list(self.head), "rows": rows, "note": self.note}


def plan_fingerprint(document: Mapping[str, Any]) -> str:
    """SHA-256 of the plan's canonical JSON: printed on every page, so that pages belong together.

    The canonical form has sorted keys and no white space; ``plan.json`` may be written otherwise.
    """
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def _pose_cells(entry: Mapping[str, Any]) -> tuple[str, ...]:
    position = tuple(format_mm(x) for x in entry["position_mm"])
    return position + tuple(format_deg(x) for x in entry["angles_deg"])


def _sigma_cells(entry: Mapping[str, Any]) -> tuple[str, ...]:
    position = tuple(format_mm(x) for x in entry["sigma_position_mm"])
    return position + tuple(format_deg(x) for x in entry["sigma_angles_deg"])


POSE_HEAD = ("", "x mm", "y mm", "z mm", "α °", "β °", "γ °")


def ring_table(document: Mapping[str, Any]) -> Table:
    """Recognised ring poses in the image frame with their uncertainty."""
    rows = []
    for ring in RINGS:
        entry = document["rings"][ring]
        rows.append((f"{ring} ring", *_pose_cells(entry), format_mm(entry["rms_mm"])))
        rows.append(("± 1 σ", *_sigma_cells(entry), "-"))
    note = (
        "Frame LPS (x = L, y = P, z = S), X-Y-Z fixed angles. σ along and about the ring's own "
        "axes. RMS: distance of the balls from the fitted layout."
    )
    note += front_words(document)
    return Table("Ring poses in the CT", (*POSE_HEAD, "RMS mm"), tuple(rows), note)


def front_words(document: Mapping[str, Any]) -> str:
    """What the user said of both rings' front (H22); nothing where the case does not tell."""
    confirmed = document["case"].get("ring_front_confirmed")
    if confirmed is None:
        return ""
    said = "yes" if confirmed else "NO"
    return f" Front of both rings (notch) confirmed against the picture: {said}."


def mechanism_table(document: Mapping[str, Any]) -> Table:
    """The mechanism pose from CT and from the strut readings, and their difference."""
    entry = document["mechanism"]
    rows = [("from CT", *_pose_cells(entry)), ("± 1 σ", *_sigma_cells(entry))]
    note = "{A} proximal ring seen in {B} distal ring. The pose from CT rests on the balls alone."
    if entry.get("from_struts"):
        rows.append(("from strut readings", *_pose_cells(entry["from_struts"])))
    difference = entry.get("difference")
    if difference:
        rows.append(("CT minus struts", *_pose_cells(difference)))
        note += (
            f" The two differ by {format_mm(difference['distance_mm'])} mm and "
            f"{format_deg(difference['rotation_deg'])}°."
        )
    return Table("Mechanism pose today", POSE_HEAD, tuple(rows), note)


def strut_witness_table(document: Mapping[str, Any]) -> Table | None:
    """Strut lengths: CT against the readings."""
    difference = document["mechanism"].get("difference")
    if not difference or not difference.get("struts_mm"):
        return None
    offset = document["case"]["fixator"]["strut"].get("scale_offset_mm", 0.0)
    readings = document["schedule"]["rows"][0]["strut_mm"]
    printed = patient.printed_values(dict(document))[0]
    rows = tuple(
        (
            str(n),
            text,
            format_mm(reading + offset),
            format_mm(reading + offset + delta),
            format_mm(delta),
        )
        for n, (text, reading, delta) in enumerate(
            zip(printed, readings, difference["struts_mm"], strict=True), 1
        )
    )
    head = ("strut", "reading mm", "length by reading mm", "length in CT mm", "CT minus reading mm")
    note = "Two independent witnesses: a strut that stands out was misread or has slipped."
    return Table("Struts today: CT against reading", head, rows, note)


def strut_plan_table(document: Mapping[str, Any]) -> Table:
    """Start, end, change and stroke of each strut over the plan, in scale values."""
    strut = document["case"]["fixator"]["strut"]
    schedule = document["schedule"]
    offset = strut.get("scale_offset_mm", 0.0)
    low, high = strut["min_mm"] - offset, strut["max_mm"] - offset
    lengths = zip(schedule["strut_min_mm"], schedule["strut_max_mm"], strict=True)
    rows = tuple(
        (
            entry["number"],
            entry["start"],
            entry["end"],
            f"{entry['change']} {entry['overall']}",
            format_number(smallest, 2),
            format_number(largest, 2),
            format_number(min(smallest - low, high - largest), 2),
        )
        for entry, (smallest, largest) in zip(
            patient.strut_summary(dict(document)), lengths, strict=True
        )
    )
    head = ("strut", "start", "final", "whole change", "smallest", "largest", "stroke left")
    note = (
        f"Scale values, mm. Stroke limits on the scale: {format_number(low, 2)} to "
        f"{format_number(high, 2)} mm, checked at and between rows."
    )
    return Table("Struts over the plan", head, rows, note)


def correction_table(document: Mapping[str, Any]) -> Table:
    """Start and target of the mechanism pose."""
    correction = document["correction"]
    rows = (
        ("start", *_pose_cells(correction["start"])),
        ("target", *_pose_cells(correction["target"])),
    )
    note = (
        f"Kind: {correction['kind']}. Moving: {correction['moving']} fragment with its ring. "
        f"Compensation of the recognition error: {correction['compensation']}."
    )
    left = correction.get("recognition_error_left")
    if left:
        note += f" Recognition error left: {left}."
    return Table("Correction: {A} in {B}", POSE_HEAD, rows, note)


DEFORMITY = (
    ("ap_angulation", "AP angulation", "°"),
    ("lateral_angulation", "lateral angulation", "°"),
    ("axial_rotation", "axial rotation", "°"),
    ("ap_translation", "AP translation", "mm"),
    ("lateral_translation", "lateral translation", "mm"),
    ("axial_translation", "axial translation", "mm"),
)
"""The six clinical parameters: key without unit, words, unit."""


def deformity_table(document: Mapping[str, Any]) -> Table | None:
    """The six clinical parameters as the case gives them."""
    asked = document["case"].get("correction") or {}
    if asked.get("kind") != "deformity":
        return None
    rows = []
    for key, name, unit in DEFORMITY:
        value = asked.get(f"{key}_{'mm' if unit == 'mm' else 'deg'}") or 0.0
        rows.append((name, format_measure(value), unit, asked.get(key) or "-"))
    origin = ", ".join(format_mm(x) for x in asked["origin_lps_mm"])
    note = f"Of the {asked.get('moving', 'distal')} fragment, at the origin L, P, S = {origin} mm."
    return Table("Deformity to correct", ("parameter", "size", "unit", "sense"), tuple(rows), note)


def motion_table(document: Mapping[str, Any]) -> Table | None:
    """The rigid motion of the moving fragment in the image frame."""
    motion = document["correction"].get("fragment_motion_lps")
    if not motion:
        return None
    rows = tuple(
        (*(format_number(x, 6) for x in row[:3]), format_mm(row[3])) for row in motion["matrix"][:3]
    )
    note = f"p' = M p in LPS, mm; rotation {format_deg(motion['rotation_deg'])}°."
    head = ("rotation", "", "", "translation mm")
    return Table("Motion of the moving fragment", head, rows, note)


def rate_table(document: Mapping[str, Any]) -> Table:
    """Rates, limits and what rounding leaves at the end."""
    schedule = document["schedule"]
    limits = document["case"]["schedule"]
    rows = [
        ("fastest point", schedule["ruling_point"], "-", "-"),
        (
            "planned rate",
            format_measure(schedule["rate_mm_per_day"]),
            format_measure(limits.get("max_rate_mm_per_day")),
            "mm/day",
        ),
        (
            "planned rotation rate",
            format_measure(schedule["rate_deg_per_day"]),
            format_measure(limits.get("max_rate_deg_per_day")),
            "°/day",
        ),
    ]
    for key, name, unit in (
        ("realised_max_mm_per_day", "fastest day after rounding", "mm/day"),
        ("realised_max_deg_per_day", "fastest day after rounding", "°/day"),
        ("rounding_max_mm", "largest rounding error of a row", "mm"),
        ("rounding_max_deg", "largest rounding error of a row", "°"),
        ("end_error_mm", "expected end error after rounding", "mm"),
        ("end_error_deg", "expected end error after rounding", "°"),
        ("condition_number_max", "largest condition number", "-"),
    ):
        if schedule.get(key) is not None:
            rows.append((name, format_measure(schedule[key]), "-", unit))
    note = f"Strut step {format_measure(schedule['strut_step_mm'])} mm."
    return Table("Rates and rounding", ("measure", "value", "limit", "unit"), tuple(rows), note)


def gate_table(document: Mapping[str, Any]) -> Table:
    """Every safety gate with value and limit."""
    rows = tuple(
        (
            gate["gate"],
            gate["name"],
            gate["hazard"] or "-",
            format_measure(gate["value"]),
            format_measure(gate["limit"]),
            gate["unit"] or "-",
            "passed" if gate["passed"] else "NOT PASSED",
        )
        for gate in document["gates"]
    )
    head = ("gate", "check", "hazard", "value", "limit", "unit", "result")
    return Table("Safety gates", head, rows, "One gate that fails stops the export.")


def ball_table(document: Mapping[str, Any]) -> Table:
    """Ball centres in LPS with σ."""
    rows = tuple(
        (
            str(ball["number"]),
            ball["ring"],
            *(format_mm(x) for x in ball["center_mm"]),
            *(format_mm(x) for x in ball["sigma_mm"]),
            format_mm(ball["diameter_mm"]),
            format_number(ball["core_hu"], 0),
        )
        for ball in sorted(document["balls"], key=lambda ball: ball["number"])
    )
    head = ("ball", "ring", "L mm", "P mm", "S mm", "σL", "σP", "σS", "⌀ mm", "HU")
    margin = document.get("numbering_margin_mm")
    note = f"Numbering settled by: {document['numbering_settled_by']}"
    note += f", margin to the next best {format_measure(margin)} mm." if margin is not None else "."
    added = [str(ball["number"]) for ball in document["balls"] if ball.get("added")]
    if added:
        note += f" Put there by the user, not found by itself: ball {', '.join(added)}."
    return Table("Marker balls in the CT", head, rows, note)


def rejected_table(document: Mapping[str, Any]) -> Table | None:
    """Candidates that are no marker balls, the first few."""
    rejected: Sequence[Mapping[str, Any]] = document.get("rejected") or ()
    if not rejected:
        return None
    rows = tuple(
        (*(format_number(x, 1) for x in item["center_mm"]), item["reason"])
        for item in rejected[:REJECTED_SHOWN]
    )
    note = f"{len(rejected)} rejected in all" + (
        f"; the first {REJECTED_SHOWN} are shown." if len(rejected) > REJECTED_SHOWN else "."
    )
    return Table("Rejected candidates", ("L mm", "P mm", "S mm", "reason"), rows, note)


def layout_table(document: Mapping[str, Any]) -> Table:
    """The marker layout's verdict per ring."""
    rows = []
    for ring in RINGS:
        entry = document["layout"][ring]
        rows.append(
            (
                ring,
                " ".join(format_number(x, 1) for x in entry["included_angles_deg"]),
                entry["rule"],
                format_measure(entry["uniqueness_mm"]),
                format_mm(entry["predicted_error_mm"]),
                format_deg(entry["predicted_error_deg"]),
                format_measure(entry.get("out_of_plane_mm")),
            )
        )
    head = ("ring", "angles °", "rule", "unique mm", "error mm", "error °", "out of plane mm")
    advice = document["layout"].get("advice") or ()
    note = "Predicted error of the ring pose from the balls' σ. " + " ".join(
        f"Advice: {line}." for line in advice
    )
    return Table("Marker layout", head, tuple(rows), note.strip())


def hash_table(document: Mapping[str, Any]) -> Table:
    """What the plan was made from, by hash."""
    rows = [
        (name.removesuffix("_sha256"), value) for name, value in sorted(document["inputs"].items())
    ]
    rows.append(("plan", plan_fingerprint(document)))
    return Table("SHA-256 of the inputs and of this plan", ("of", "hash"), tuple(rows))


def _library_rows(versions: Mapping[str, str]) -> list[tuple[str, str]]:
    """A few libraries a row: a line that breaks at a hyphen is read back without it."""
    named = [f"{name} {version}" for name, version in sorted(versions.items())]
    rows = [
        ", ".join(named[k : k + LIBRARIES_A_ROW]) for k in range(0, len(named), LIBRARIES_A_ROW)
    ]
    return [("with" if k == 0 else "and", row) for k, row in enumerate(rows)]


def version_table(document: Mapping[str, Any]) -> Table:
    """Programs and image behind the plan."""
    image = document["image"]
    spacing = " × ".join(format_number(x, 3) for x in image["spacing_mm"])
    size = " × ".join(str(n) for n in image["size_ijk"])
    fixator = document["case"]["fixator"]
    rows = [
        ("HexaFix", document["hexafix_version"]),
        *_library_rows(document["versions"]),
        ("image", f"{image['kind']}, {size} voxels of {spacing} mm"),
        ("fixator", f"{fixator['id']}: {fixator['name']}"),
        ("source of its geometry", fixator.get("source") or "-"),
    ]
    return Table("Versions and sources", ("what", "which"), tuple(rows))


def surgeon_tables(document: Mapping[str, Any]) -> dict[str, Table | None]:
    """All tables of the surgeon's pages by name, in printing order."""
    return {
        "gates": gate_table(document),
        "rings": ring_table(document),
        "mechanism": mechanism_table(document),
        "witness": strut_witness_table(document),
        "deformity": deformity_table(document),
        "correction": correction_table(document),
        "motion": motion_table(document),
        "rates": rate_table(document),
        "struts": strut_plan_table(document),
        "layout": layout_table(document),
        "balls": ball_table(document),
        "rejected": rejected_table(document),
        "hashes": hash_table(document),
        "versions": version_table(document),
    }
