"""Every computed number of a plan document, worked out again from its inputs."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexafix.verify import rigid
from hexafix.verify.check import Check, largest, stated
from hexafix.verify.rigid import Matrix
from hexafix.verify.target import target

POSE_MM, POSE_DEG = 1e-4, 1e-5
"""How well two roads to the same pose agree; far below what a strut can set."""

LENGTH_MM = 1e-4


@dataclass(frozen=True, eq=False)
class Recomputed:
    """The verdict on a document.

    Attributes
    ----------
    checks : tuple of Check
    distance_mm, rotation_deg : float
        Pose reached by the last printed row, by this road, against where the plan says it ends.
    """

    checks: tuple[Check, ...]
    distance_mm: float
    rotation_deg: float

    @property
    def agrees(self) -> bool:
        """Whether every check passed."""
        return all(check.passed for check in self.checks)


def recompute(document: dict[str, Any]) -> Recomputed:
    """Recompute ring poses, mechanism, compensation, target and schedule of a plan document.

    Parameters
    ----------
    document : dict
        ``plan.json``.
    """
    rings = {side: _ring(document, side) for side in ("proximal", "distal")}
    recognised = np.linalg.solve(rings["distal"], rings["proximal"])
    fixator = document["case"]["fixator"]
    offset = fixator["strut"].get("scale_offset_mm", 0.0)
    readings = np.array(document["case"]["strut_readings_mm"], float)
    struts = rigid.forward(readings + offset, fixator, recognised)
    checks = [
        *_pose_checks("proximal ring", rings["proximal"], document["rings"]["proximal"]),
        *_pose_checks("distal ring", rings["distal"], document["rings"]["distal"]),
        *_pose_checks("mechanism by CT", recognised, document["mechanism"]),
        *_pose_checks("mechanism by struts", struts, document["mechanism"]["from_struts"]),
        largest(
            "strut lengths by CT against the readings",
            rigid.strut_lengths(recognised, fixator)
            - readings
            - offset
            - document["mechanism"]["difference"]["struts_mm"],
            LENGTH_MM,
            "mm",
        ),
    ]
    planned = _compensated(document, rings, struts)
    goal = target(
        document["case"]["correction"],
        side=document["limb"]["side"],
        mode=document["correction"]["compensation"],
        rings=planned,
        recognised=recognised,
        struts=struts,
    )
    checks += _pose_checks("target", goal, document["correction"]["target"])
    resolution = document["mechanism"]["from_struts"]["reading_resolution_mm"]
    turns = readings / resolution
    checks.append(
        largest("readings in the resolution stated", turns - np.round(turns), 1e-5, "steps")
    )
    checks += _schedule_checks(document, fixator, offset, struts, goal, planned)
    last = np.array(document["schedule"]["rows"][-1]["strut_mm"], float) + offset
    reached = rigid.forward(last, fixator, goal)
    end = np.array(document["schedule"]["end"]["matrix"], float)
    away, turned = rigid.distance_mm(reached, end), rigid.angle_deg(reached, end)
    checks += [
        largest("pose reached by the last row", [away], POSE_MM, "mm"),
        largest("orientation reached by the last row", [turned], POSE_DEG, "deg"),
        stated(
            "gates",
            all(gate["passed"] for gate in document["gates"]),
            f"{len(document['gates'])} gates, none red",
        ),
    ]
    return Recomputed(tuple(checks), away, turned)


def _ring(document: dict[str, Any], side: str) -> Matrix:
    markers = document["case"]["markers"][side]
    balls = {ball["number"]: ball for ball in document["balls"]}
    chosen = [balls[marker["number"]] for marker in markers]
    return rigid.ring_pose(
        rigid.layout_points(markers),
        np.array([ball["center_mm"] for ball in chosen], float),
        np.array([ball["covariance_mm2"] for ball in chosen], float),
    )


def _pose_checks(name: str, pose: Matrix, entry: dict[str, Any]) -> list[Check]:
    """A recomputed pose against the matrix, the position and the angles that the plan states."""
    matrix = np.array(entry.get("matrix_lps", entry.get("matrix")), float)
    turned = (rigid.angles_deg(pose) - entry["angles_deg"] + 180.0) % 360.0 - 180.0
    return [
        largest(f"{name}, matrix position", [rigid.distance_mm(pose, matrix)], POSE_MM, "mm"),
        largest(f"{name}, matrix orientation", [rigid.angle_deg(pose, matrix)], POSE_DEG, "deg"),
        largest(f"{name}, position", pose[:3, 3] - entry["position_mm"], POSE_MM, "mm"),
        largest(f"{name}, angles", turned, POSE_DEG * 10, "deg"),
    ]


def _compensated(
    document: dict[str, Any], rings: dict[str, Matrix], struts: Matrix
) -> tuple[Matrix, Matrix]:
    """The ring poses that the plan was made with."""
    if document["correction"]["compensation"] != "fused":
        return rings["proximal"], rings["distal"]
    to_rad = np.array([1.0, 1.0, 1.0, *np.radians(np.ones(3))])
    of_proximal, of_distal = (
        np.array(document["rings"][side]["covariance"], float) * np.outer(to_rad, to_rad)
        for side in ("proximal", "distal")
    )
    resolution = document["mechanism"]["from_struts"]["reading_resolution_mm"]
    of_struts = rigid.reading_covariance(struts, document["case"]["fixator"], resolution)
    return rigid.fuse(
        rings=(rings["proximal"], rings["distal"]),
        struts=struts,
        covariances=(of_proximal, of_distal, of_struts),
    )


def _schedule_checks(
    document: dict[str, Any],
    fixator: dict[str, Any],
    offset: float,
    start: Matrix,
    goal: Matrix,
    planned: tuple[Matrix, Matrix],
) -> list[Check]:
    """Rows against the path, the strut's steps, the stroke, the rates and the calendar."""
    schedule = document["schedule"]
    rows = schedule["rows"]
    values = np.array([row["strut_mm"] for row in rows], float)
    step = schedule["strut_step_mm"]
    poses = rigid.along(start, goal, np.arange(len(rows)) / max(len(rows) - 1, 1))
    exact = np.array([rigid.strut_lengths(pose, fixator) for pose in poses]) - offset
    low, high = fixator["strut"]["min_mm"] - offset, fixator["strut"]["max_mm"] - offset
    outside = np.maximum(low - values, values - high).max()
    turns = values[1:] / step
    readings = np.array(document["case"]["strut_readings_mm"], float)
    return [
        largest("row of today against the readings", values[0] - readings, 0.0, "mm"),
        largest(
            "rows against the path, in steps", (values - exact)[1:] / step, 1.0 + 1e-6, "steps"
        ),
        largest("rows in whole steps", turns - np.round(turns), 1e-6, "steps"),
        largest("strut values beyond the scale", [max(outside, 0.0)], 1e-6, "mm"),
        *_rate_checks(document, fixator, poses, planned),
        _calendar_check(schedule),
    ]


def _rate_checks(
    document: dict[str, Any],
    fixator: dict[str, Any],
    poses: Matrix,
    planned: tuple[Matrix, Matrix],
) -> list[Check]:
    """Speeds of the watched points along the path, summed over fine chords."""
    rules, schedule = document["case"]["schedule"], document["schedule"]
    days = schedule["days"]
    if days == 0:
        return [stated("rates", len(poses) == 1, "nothing moves")]
    moving = document["correction"]["moving"]
    ring = planned[0] if moving == "proximal" else planned[1]
    risk = rules.get("structures_at_risk_lps_mm")
    if risk:
        points = np.linalg.solve(ring, np.hstack([risk, np.ones((len(risk), 1))]).T).T
    else:
        joints = np.vstack([np.zeros(3), fixator[moving]["joints_mm"]])
        points = np.hstack([joints, np.ones((7, 1))])
    fine = rigid.along(poses[0], poses[-1], np.linspace(0.0, 1.0, 65))
    seen = fine if moving == "proximal" else np.linalg.inv(fine)
    track = (points @ np.swapaxes(seen, 1, 2))[:, :, :3]
    way = np.linalg.norm(np.diff(track, axis=0), axis=2).sum(axis=0).max() / days
    turn = rigid.angle_deg(poses[0], poses[-1]) / days
    most_mm, most_deg = rules["max_rate_mm_per_day"], rules["max_rate_deg_per_day"]
    return [
        largest(
            "rate of the fastest point, over its limit", [max(way - most_mm, 0)], 1e-9, "mm/day"
        ),
        largest("rate of the rotation, over its limit", [max(turn - most_deg, 0)], 1e-6, "deg/day"),
        largest("rate stated", [way - schedule["rate_mm_per_day"]], 2e-3 * way + 1e-6, "mm/day"),
        largest("rotation stated", [turn - schedule["rate_deg_per_day"]], 1e-5, "deg/day"),
    ]


def _calendar_check(schedule: dict[str, Any]) -> Check:
    """Days, dates and adjustments run without gap or repetition."""
    per_day, start = schedule["adjustments_per_day"], schedule["start_date"]
    first = datetime.date.fromisoformat(start).toordinal()
    wrong = []
    for place, row in enumerate(schedule["rows"]):
        day = 0 if place == 0 else 1 + (place - 1) // per_day
        adjustment = 0 if place == 0 else 1 + (place - 1) % per_day
        date = datetime.date.fromordinal(first + max(day - 1, 0)).isoformat()
        if (row["day"], row["date"], row["adjustment"]) != (day, date, adjustment):
            wrong.append(place)
    complete = len(schedule["rows"]) == 1 + schedule["days"] * per_day
    return stated(
        "calendar",
        not wrong and complete,
        "days, dates and adjustments run on" if not wrong else f"rows {wrong[:5]} are out of order",
    )
