"""A plan against the phantom's truth, and a refusal against the one that was due."""

from __future__ import annotations

import datetime
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexafix.errors import Fault
from hexafix.geometry import Pose
from hexafix.phantom import PhantomSpec
from hexafix.scenarios import limits
from hexafix.scenarios.limits import Array
from hexafix.scenarios.scenario import Refusal
from hexafix.verify.rigid import forward


@dataclass(frozen=True, slots=True)
class Finding:
    """One comparison with its limit.

    Attributes
    ----------
    name : str
    value, limit : float
    unit : str
    """

    name: str
    value: float
    limit: float
    unit: str = ""

    @property
    def passed(self) -> bool:
        """Whether the value is a number within the limit."""
        return bool(np.isfinite(self.value) and self.value <= self.limit)

    def as_json(self) -> dict[str, Any]:
        """The finding as the report's JSON holds it."""
        return {
            "name": self.name,
            "value": float(self.value) if np.isfinite(self.value) else None,
            "limit": float(self.limit),
            "unit": self.unit,
            "passed": self.passed,
        }


def must(name: str, right: bool) -> Finding:
    """A finding without a number."""
    return Finding(name, 0.0 if right else 1.0, 0.0)


def judge_recognition(
    document: Mapping[str, Any], truth: Mapping[str, Any], spec: PhantomSpec
) -> Iterator[Finding]:
    """Balls by their numbers, ring poses and mechanism of a plan or recognition document.

    Parameters
    ----------
    document : mapping
        ``plan.json``.
    truth : mapping
        ``truth.json`` of the phantom.
    spec : PhantomSpec
    """
    centers = {ball["number"]: ball["center_mm"] for ball in truth["balls"]}
    found = {ball["number"]: ball["center_mm"] for ball in document["balls"]}
    yield must("every ball under its number", sorted(found) == sorted(centers))
    away = [_distance(found[number], centers[number]) for number in found if number in centers]
    yield Finding("ball centre", max(away, default=np.inf), limits.ball_mm(spec), "mm")
    expected = limits.pose_limits(spec, compensation="none", in_image=False)
    for ring, covariance in (("proximal", expected.proximal), ("distal", expected.distal)):
        true = truth["rings"][ring]["matrix_lps"]
        pose = document["rings"][ring]["matrix_lps"]
        yield from _pose_findings(f"{ring} ring", pose, true, covariance)
    true = truth["mechanism"]["matrix"]
    yield from _pose_findings(
        "mechanism", document["mechanism"]["matrix"], true, expected.mechanism
    )


def judge_plan(
    document: Mapping[str, Any],
    truth: Mapping[str, Any],
    spec: PhantomSpec,
    *,
    dates: Sequence[str] = (),
) -> Iterator[Finding]:
    """Everything that stands in a plan; see `judge_recognition`.

    Parameters
    ----------
    document, truth, spec
        As there.
    dates : sequence of str
        ISO dates that must be among the rows.
    """
    yield from judge_recognition(document, truth, spec)
    schedule, case = document["schedule"], document["case"]
    expected = limits.pose_limits(
        spec,
        compensation=case["schedule"]["compensation"],
        in_image=case["correction"]["kind"] != "target-pose",
    )
    struts = document["mechanism"]["from_struts"]["matrix"]
    true = truth["mechanism"]["matrix"]
    yield from _pose_findings("mechanism by struts", struts, true, expected.readings)
    rows = np.array([row["strut_mm"] for row in schedule["rows"]], float)
    poses = _poses(rows + spec.fixator.strut.scale_offset_mm, spec, np.array(true, float))
    yield from _end_findings(poses[-1], expected.end, schedule["strut_step_mm"], truth, spec)
    yield from _strut_findings(rows, schedule, spec)
    yield from _rate_findings(poses, case, truth, spec)
    yield from _calendar_findings(schedule, dates)


def judge_refusal(
    refusal: Refusal, faults: Sequence[Fault], exit_code: int, *, left_behind: Sequence[str]
) -> Iterator[Finding]:
    """Whether a refusal tells exactly what was due, and wrote nothing.

    Parameters
    ----------
    refusal : Refusal
        The one that was due.
    faults : sequence of Fault
    exit_code : int
    left_behind : sequence of str
        Names of whatever stands where the export would be.
    """
    told = {(fault.code, fault.hazard) for fault in faults}
    due = set(refusal.faults.items())
    yield must("every fault that was due is told", due <= told)
    yield must("no other fault is told", told <= due)
    yield must("every fault tells the next step", all(fault.next_step for fault in faults))
    yield must("the exit code", exit_code == refusal.exit_code)
    yield must("nothing was written", not left_behind)


def _pose_findings(name: str, pose: Any, true: Any, covariance: Array) -> Iterator[Finding]:
    """Origin and orientation of a 4×4 pose against the true one."""
    distance, angle = Pose.from_matrix(pose).difference(Pose.from_matrix(true))
    origin = limits.at_point_mm(covariance, np.zeros(3))
    yield Finding(name, distance, origin, "mm")
    yield Finding(name, float(np.degrees(angle)), limits.turn_deg(covariance), "deg")


def _end_findings(
    end: Array, covariance: Array, step_mm: float, truth: Mapping[str, Any], spec: PhantomSpec
) -> Iterator[Finding]:
    """Where the last row puts the true mechanism, against the reduced fracture."""
    goal = np.array(truth["target"]["mechanism"]["matrix"], float)
    distance, angle = Pose.from_matrix(end).difference(Pose.from_matrix(goal))
    origin = limits.at_point_mm(covariance, np.zeros(3))
    yield Finding("end", distance, limits.with_step(origin, step_mm), "mm")
    turn_step = float(np.degrees(step_mm / _arm_mm(spec)))
    turn = limits.with_step(limits.turn_deg(covariance), turn_step)
    yield Finding("end", float(np.degrees(angle)), turn, "deg")
    fracture = _fracture_in_a(truth)
    missed = _distance(_at(end, fracture), _at(goal, fracture))
    limit = limits.with_step(limits.at_point_mm(covariance, fracture), step_mm)
    yield Finding("fracture at the end", missed, limit, "mm")


def _arm_mm(spec: PhantomSpec) -> float:
    """Smallest distance of a moving joint from the ring's axis, mm."""
    return float(np.linalg.norm(spec.fixator.proximal.joints_mm[:, :2], axis=1).min())


def _poses(lengths_mm: Array, spec: PhantomSpec, start: Array) -> Array:
    """True mechanism pose after every row, shape (R, 4, 4), by the independent solution."""
    fixator = {
        ring: {"joints_mm": getattr(spec.fixator, ring).joints_mm}
        for ring in ("proximal", "distal")
    }
    poses = [start]
    for row in lengths_mm:
        poses.append(forward(row, fixator, poses[-1]))
    return np.array(poses[1:])


def _strut_findings(
    rows: Array, schedule: Mapping[str, Any], spec: PhantomSpec
) -> Iterator[Finding]:
    """Stroke and whole steps of every row."""
    stroke, step = spec.fixator.strut, schedule["strut_step_mm"]
    lengths = rows + stroke.scale_offset_mm
    over = max(float(lengths.max()) - stroke.max_mm, stroke.min_mm - float(lengths.min()))
    yield Finding("struts beyond their stroke", max(over, 0.0), 1e-6, "mm")
    turns = rows[1:] / step
    off = float(np.abs(turns - np.round(turns)).max(initial=0.0)) * step
    yield Finding("rows off the strut's scale", off, 1e-6, "mm")


def _rate_findings(
    poses: Array,
    case: Mapping[str, Any],
    truth: Mapping[str, Any],
    spec: PhantomSpec,
) -> Iterator[Finding]:
    """The fastest watched point and the turn within any day, on the true mechanism.

    Whole steps of the struts may add two steps to a day's way (gate H28), and as much at the
    joints to its turn. A target pose moves {A}, the proximal ring.
    """
    rules = case["schedule"]
    proximal_moves = case["correction"].get("moving", "proximal") == "proximal"
    seen = poses if proximal_moves else np.linalg.inv(poses)
    points = _watched(rules, truth, spec, "proximal" if proximal_moves else "distal")
    places = points @ seen[:, :3, :3].transpose(0, 2, 1) + seen[:, None, :3, 3]
    day = min(rules["adjustments_per_day"], len(seen) - 1)
    way = np.linalg.norm(places[day:] - places[:-day], axis=-1).max()
    turned = np.einsum("nij,nij->n", seen[day:, :3, :3], seen[:-day, :3, :3])
    angle = np.degrees(np.arccos(np.clip(0.5 * (turned - 1.0), -1.0, 1.0))).max()
    extra = 2.0 * rules["strut_step_mm"]
    yield Finding("way within a day", float(way), rules["max_rate_mm_per_day"] + extra, "mm")
    yield Finding(
        "turn within a day",
        float(angle),
        rules["max_rate_deg_per_day"] + float(np.degrees(extra / _arm_mm(spec))),
        "deg",
    )


def _watched(
    rules: Mapping[str, Any], truth: Mapping[str, Any], spec: PhantomSpec, ring: str
) -> Array:
    """Structures at risk, else the moving ring's centre and joints, in its frame, (P, 3), mm."""
    named = rules.get("structures_at_risk_lps_mm")
    if named is None:
        return np.vstack([np.zeros(3), getattr(spec.fixator, ring).joints_mm])
    pose = Pose.from_matrix(truth["rings"][ring]["matrix_lps"])
    return pose.inverse().apply(np.array(named, float))


def _calendar_findings(schedule: Mapping[str, Any], dates: Sequence[str]) -> Iterator[Finding]:
    """Every day of the calendar once, from the start date on, and the dates asked for."""
    told = [datetime.date.fromisoformat(row["date"]) for row in schedule["rows"][1:]]
    first = datetime.date.fromisoformat(schedule["start_date"])
    due = [first + datetime.timedelta(days=day) for day in range(schedule["days"])]
    per_day = schedule["adjustments_per_day"]
    yield must("calendar", told == [day for day in due for _ in range(per_day)])
    for date in dates:
        yield must(f"{date} is in the calendar", date in {day.isoformat() for day in told})


def _fracture_in_a(truth: Mapping[str, Any]) -> Array:
    """Middle of the proximal fragment's fracture in {A}, shape (3,), mm."""
    ring = Pose.from_matrix(truth["rings"]["proximal"]["matrix_lps"])
    return ring.inverse().apply(np.array(truth["fracture"]["center_proximal_lps_mm"], float))


def _at(pose: Array, point_mm: Array) -> Array:
    return pose[:3, :3] @ point_mm + pose[:3, 3]


def _distance(one: Any, other: Any) -> float:
    return float(np.linalg.norm(np.subtract(one, other)))
