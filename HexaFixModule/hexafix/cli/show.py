"""Documents as text for a terminal."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def _vector(values: list[float], digits: int = 3) -> str:
    return "  ".join(f"{value:10.{digits}f}" for value in values)


def balls_document(balls: Any) -> dict[str, Any]:
    """What ``markers --json`` prints."""
    from hexafix.pipeline.document import found_balls

    return found_balls(balls)


def balls_text(balls: Any) -> str:
    """The balls as a table, and why other candidates were rejected."""
    document = balls_document(balls)
    lines = [f"{len(document['balls'])} balls (centres in LPS, mm)", ""]
    lines.append("          L           P           S   diameter   sigma   residual  HU")
    for ball in document["balls"]:
        sigma = max(ball["sigma_mm"])
        lines.append(
            f"{_vector(ball['center_mm'])}  {ball['diameter_mm']:9.3f}  {sigma:6.4f}"
            f"  {ball['rms_residual_mm']:9.4f}  {ball['core_hu']:.0f}"
        )
    if document["rejected"]:
        lines += ["", f"{len(document['rejected'])} candidates rejected:"]
        lines += [
            f"  {_vector(other['center_mm'], 1)}  {other['reason']}"
            for other in document["rejected"]
        ]
    return "\n".join([*lines, *_warnings(document["warnings"])])


def recognition_text(document: dict[str, Any]) -> str:
    """Numbers, ring poses and mechanism pose."""
    lines = [f"case {document['case_id']}: {document['limb']['side']} {document['limb']['bone']}"]
    lines.append(
        f"numbering settled by {document['numbering_settled_by']}, the next best stands off by "
        f"{document['numbering_margin_mm']:.2f} mm"
    )
    lines += [
        f"  ball {number:>2}  {_vector(center)}  LPS mm"
        for number, center in document["numbering"].items()
    ]
    for name, pose in document["rings"].items():
        lines.append(f"{name} ring in LPS, residual {pose['rms_mm']:.3f} mm")
        lines += _pose_lines(pose)
    lines.append("mechanism, proximal ring in the distal ring")
    lines += _pose_lines(document["mechanism"])
    return "\n".join(
        [*lines, *_gates(document["gates"]), *_warnings(document["image"]["warnings"])]
    )


def _pose_lines(pose: dict[str, Any]) -> list[str]:
    return [
        f"  position mm   {_vector(pose['position_mm'])}   ± {_vector(pose['sigma_position_mm'])}",
        f"  angles deg    {_vector(pose['angles_deg'])}   ± {_vector(pose['sigma_angles_deg'])}",
    ]


def _gates(gates: list[dict[str, Any]]) -> list[str]:
    lines = ["gates"]
    for gate in gates:
        mark = "pass" if gate["passed"] else "RED "
        value = f"{gate['value']:.4g} (limit {gate['limit']:.4g}) {gate['unit']}".rstrip()
        lines.append(f"  {mark}  {gate['gate']:<4} {gate['name']}: {value}")
    return lines


def _warnings(warnings: list[str]) -> list[str]:
    return [f"warning: {text}" for text in warnings]


def layout_text(document: dict[str, Any]) -> str:
    """Angles, rule, uniqueness and predicted error of both rings, and the advice."""
    lines = []
    for name in ("proximal", "distal"):
        ring = document[name]
        angles = "/".join(f"{angle:g}" for angle in ring["included_angles_deg"])
        lines.append(
            f"{name}: included angles {angles} deg ({ring['rule']}), "
            f"next numbering {ring['uniqueness_mm']:.2f} mm away, predicted error "
            f"{ring['predicted_error_mm']:.3f} mm and {ring['predicted_error_deg']:.3f} deg"
        )
    return "\n".join([*lines, *(f"advice: {text}" for text in document["advice"])])


def plan_text(document: dict[str, Any], names: Sequence[str]) -> str:
    """The plan in a few lines, and the files of the export; their folder's name may be private."""
    schedule, mechanism = document["schedule"], document["mechanism"]
    difference = mechanism["difference"]
    last = schedule["rows"][-1]
    lines = [
        f"case {document['case_id']}: {document['limb']['side']} {document['limb']['bone']}",
        f"{len(document['balls'])} balls found and numbered; CT and struts differ by "
        f"{difference['distance_mm']:.3f} mm and {difference['rotation_deg']:.3f} deg",
        f"{schedule['days']} days, {schedule['adjustments_per_day']} adjustments a day; ruled by "
        f"{schedule['ruling_point']}",
        "final strut values  " + "  ".join(f"{value:g}" for value in last["strut_mm"]),
        f"rounding leaves {schedule['end_error_mm']:.3f} mm and "
        f"{schedule['end_error_deg']:.3f} deg",
        *_gates(document["gates"]),
        *_warnings(document["image"]["warnings"]),
        f"approval: {document['approval']}. Research software, not a medical device.",
        f"the export is complete: {', '.join(names)}",
    ]
    return "\n".join(lines)


def verdict_text(verdict: dict[str, Any]) -> str:
    """Every check of a verification."""
    lines = [
        f"  {'pass' if check['passed'] else 'FAIL'}  {check['name']}: {check['message']}"
        for check in verdict["checks"]
    ]
    head = "verified" if verdict["verified"] else "NOT VERIFIED: do not use this export"
    return "\n".join([head, *lines])


def series_text(document: dict[str, Any]) -> str:
    """The series of a folder with their UIDs, what is left out and what would be refused."""
    lines = []
    for series in document["series"]:
        words = " ".join(series["image_type"]) or "no image type"
        lines += [
            f"{series['number']}  {series['description']}, {words}",
            f"   {series['series_instance_uid'] or 'no SeriesInstanceUID'}",
        ]
        lines += [
            f"   refused: {'[' + fault['hazard'] + '] ' if fault['hazard'] else ''}"
            f"{fault['message']}"
            for fault in series["refused"]
            if not series["left_out"]
        ]
    if document["patients"] > 1:
        lines.append(f"warning: the images are of {document['patients']} different patients")
    lines += [f"passed over: {row['files']} x {row['reason']}" for row in document["skipped"]]
    return "\n".join(lines)


def self_test_text(document: dict[str, Any]) -> str:
    """Every check of the self-test, its library and its time."""
    lines = []
    for check in document["checks"]:
        mark = "pass" if check["passed"] else "FAIL"
        lines.append(
            f"  {mark}  {check['name']}: {check['expected']}; {check['library']}, "
            f"{1000 * check['seconds']:.0f} ms"
        )
        if not check["passed"]:
            lines.append(f"        found: {check['found']}")
    head = "The installed libraries give the known answers."
    if not document["passed"]:
        faults = document["refused"]
        head = "\n".join(f"REFUSED [{fault['hazard']}] {fault['message']}" for fault in faults)
    return "\n".join([head, *lines])
