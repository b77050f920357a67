"""What is corrected, how large, how fast, in which steps and over which days."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

from hexafix.hardware import shipped_fixator
from hexafix.hardware.fixator import Fixator
from hexafix.scenarios import changes, layouts
from hexafix.scenarios.limbs import pose
from hexafix.scenarios.scenario import CaseChange, Scenario

_scenario = partial(Scenario, theme="correction and schedule")


def _kind(
    number: int, kind: str, moving: str, side: str, compensation: str, **schedule: Any
) -> Scenario:
    step = schedule.get("strut_step_mm", 0.5)
    daily = schedule.get("adjustments_per_day", 4)
    return _scenario(
        number=number,
        title=f"{kind}, {moving} fragment moves, compensation {compensation}, {side}, steps of "
        f"{step:g} mm, {daily} a day",
        phantom={
            "correction": kind,
            "moving": moving,
            "side": side,
            "bone": "tibia",
            "strut_reading_step_mm": min(step, 0.5),
        },
        case=(changes.merged(schedule={"compensation": compensation, **schedule}),),
    )


def _starting(date: str) -> CaseChange:
    return changes.merged(schedule={"start_date": date})


def _long_struts() -> Fixator:
    """The generic frame with longer struts, whose scales read 40 mm less than their length."""
    given = shipped_fixator()
    strut = replace(given.strut, min_mm=130.0, max_mm=290.0, scale_offset_mm=40.0)
    return replace(given, id="long-struts", name="Long struts", strut=strut)


SCENARIOS = (
    _kind(65, "target-pose", "proximal", "left", "none", strut_step_mm=1.0),
    _kind(66, "fragment-motion", "distal", "right", "additive", adjustments_per_day=3),
    _kind(67, "landmarks", "proximal", "right", "none", strut_step_mm=0.25),
    _kind(68, "landmarks", "distal", "left", "fused", adjustments_per_day=2),
    _kind(69, "deformity", "proximal", "right", "additive", strut_step_mm=0.25),
    _kind(70, "deformity", "distal", "left", "none", adjustments_per_day=3),
    _kind(
        71,
        "fragment-motion",
        "proximal",
        "left",
        "fused",
        adjustments_per_day=1,
        strut_step_mm=0.25,
    ),
    _scenario(
        number=72,
        title="structures at risk named: they set the pace",
        phantom={"side": "left", "bone": "tibia", "correction": "deformity"},
        case=(changes.structures_at_risk,),
    ),
    _scenario(
        number=73,
        title="deformity of 19° (varus, recurvatum and rotation), both rings far askew",
        phantom={
            "side": "right",
            "bone": "tibia",
            "correction": "deformity",
            "moving": "distal",
            "mechanism_pose": pose(9, 6, 176, 14, -11, 8),
        },
    ),
    _scenario(
        number=74,
        title="27 mm of shortening, lengthened over a month's end",
        phantom={
            "side": "left",
            "bone": "femur",
            "correction": "landmarks",
            "mechanism_pose": pose(4, -3, 158, 2, -3, 4),
            "target_pose": pose(0, 0, 185, 0, 0, 0),
        },
        case=(_starting("2027-04-20"),),
        dates=("2027-04-30", "2027-05-01"),
    ),
    _scenario(
        number=75,
        title="leap day, and struts whose scales start 40 mm off",
        phantom={
            "side": "right",
            "bone": "tibia",
            "correction": "fragment-motion",
            "fixator": _long_struts(),
            "mechanism_pose": pose(12, 10, 205, 5, 6, -7),
            "target_pose": pose(0, 0, 212, 0, 0, 0),
        },
        case=(_starting("2028-02-20"),),
        dates=("2028-02-28", "2028-02-29", "2028-03-01"),
    ),
    _scenario(
        number=76,
        title="summer time begins, and the year's end of a slow correction of two months",
        phantom={
            "side": "left",
            "bone": "tibia",
            "correction": "deformity",
            "mechanism_pose": pose(8, -6, 170, 6, -5, 9),
            "target_pose": pose(0, 0, 188, 0, 0, 0),
        },
        case=(
            changes.merged(
                schedule={
                    "start_date": "2026-12-20",
                    "max_rate_mm_per_day": 0.25,
                    "max_rate_deg_per_day": 0.5,
                    "adjustments_per_day": 2,
                    "strut_step_mm": 0.25,
                }
            ),
        ),
        dates=("2026-12-31", "2027-01-01", "2027-03-28"),
    ),
    _scenario(
        number=77,
        title="22 mm of distraction and 16° together, 7 balls a ring, prone",
        phantom={
            "side": "right",
            "bone": "femur",
            "correction": "fragment-motion",
            "patient_position": "HFP",
            "mechanism_pose": pose(-7, 5, 163, -11, 10, -6),
            "target_pose": pose(0, 0, 185, 0, 0, 0),
            **layouts.balls(7, 7),
        },
    ),
    _scenario(
        number=78,
        title="already reduced: hardly a millimetre to go",
        phantom={
            "side": "left",
            "bone": "tibia",
            "correction": "target-pose",
            "mechanism_pose": pose(0.4, -0.3, 178.5, 0.2, -0.1, 0.3),
        },
    ),
)
