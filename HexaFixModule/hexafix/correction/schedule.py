"""The strut schedule: dates, adjustments and scale values."""

from __future__ import annotations

import datetime
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.correction.path import Pace, RateRules, RigidPath, days_needed, path_parameters
from hexafix.correction.rounding import RoundedRows, displacements, pose_of_row, round_rows
from hexafix.correction.stroke import StrokeCheck, stroke_along
from hexafix.errors import Fault, InputError, Refused, StrutOutOfRange
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics import MAX_CONDITION

STROKE_TOLERANCE_MM = 1e-6
"""A strut at its limit to rounding error is within it."""

MORE_DAYS = 10
"""Days added at most so that whole steps of the struts keep a day's way (rate and one step)."""

MAX_ADJUSTMENTS_PER_DAY = 24
"""More than one adjustment an hour is a motor's work, not a patient's."""


class ScheduleRules(RateRules, Protocol):
    """What `make_schedule` needs to know of the case's schedule."""

    @property
    def start_date(self) -> datetime.date:
        """Date of day 1."""
        ...

    @property
    def strut_step_mm(self) -> float:
        """Step of the struts' scale."""
        ...


@dataclass(frozen=True)
class ScheduleRow:
    """One adjustment.

    Attributes
    ----------
    day : int
        0 for today's readings, then from 1.
    date : datetime.date
        Day 0 and day 1 are the start date.
    adjustment : int
        0 for today's readings, then 1 to the adjustments per day.
    strut_mm : tuple of float
        Scale values to set, struts 1 to 6.
    """

    day: int
    date: datetime.date
    adjustment: int
    strut_mm: tuple[float, ...]


@dataclass(frozen=True, eq=False)
class StrutSchedule:
    """What the patient turns, and what it does.

    Attributes
    ----------
    rows : tuple of ScheduleRow
        Row 0 holds today's readings as given; without a correction it is the only row.
    start_date : datetime.date
    adjustments_per_day, days : int
    strut_step_mm : float
    pace : Pace
        Days, ruling point and the rates of the path.
    stroke : StrokeCheck
        Extremes of the strut lengths (joint to joint) along the path.
    realised_max_mm_per_day : float
        Largest way of a watched point within one day's adjustments as rounded.
    realised_max_rad_per_day : float
        Largest turn within one day's adjustments as rounded.
    rounding_max_mm, rounding_max_rad : float
        Largest error of any row by rounding, at the points of interest and of the axes.
    end_error_mm, end_error_rad : float
        Error of the last row against the target, at the points of interest and of the axes.
    end : Pose
        Where the last row's readings really put {A} in {B}.
    """

    rows: tuple[ScheduleRow, ...]
    start_date: datetime.date
    adjustments_per_day: int
    days: int
    strut_step_mm: float
    pace: Pace
    stroke: StrokeCheck
    realised_max_mm_per_day: float
    realised_max_rad_per_day: float
    rounding_max_mm: float
    rounding_max_rad: float
    end_error_mm: float
    end_error_rad: float
    end: Pose

    @property
    def nothing_to_correct(self) -> bool:
        """Whether the start is the target already."""
        return self.days == 0


def make_schedule(
    path: RigidPath, fixator: Fixator, rules: ScheduleRules, *, readings_mm: ArrayLike
) -> StrutSchedule:
    """Spread a path over days and adjustments, round it, and check every strut.

    Parameters
    ----------
    path : RigidPath
        From the pose that today's readings give to the target.
    fixator : Fixator
    rules : ScheduleRules
    readings_mm : array_like, shape (6,)
        Today's scale readings, mm.

    Raises
    ------
    InputError
        If a rule is no possible value.
    StrutOutOfRange
        If a strut leaves its stroke at or between rows; names every such strut.
    Refused
        If the path is absurdly long or comes too close to a singular pose.
    """
    _check_rules(rules)
    readings = np.asarray(readings_mm, float)
    pace = days_needed(path, rules)
    stroke = stroke_along(path, fixator)
    _check_stroke(stroke, fixator, pace.days)
    if not stroke.condition_number <= MAX_CONDITION:
        raise Refused.of(
            "near-singular-path",
            "the path comes too close to a singular pose, where the struts lose their hold",
            value=f"condition number {stroke.condition_number:.3g}",
            limit=f"{MAX_CONDITION:g}",
            hazard="H31",
            next_step="plan the correction in two stages, or mount the frame otherwise",
        )
    most = rules.max_rate_mm_per_day + rules.strut_step_mm
    shortest = schedule = _rounded(path, fixator, rules, readings, pace, stroke)
    for _ in range(MORE_DAYS):
        if schedule.realised_max_mm_per_day <= most:
            return schedule
        pace = _one_more_day(pace)
        schedule = _rounded(path, fixator, rules, readings, pace, stroke)
    # where whole steps are coarse for so small a way, more days do not help
    return schedule if schedule.realised_max_mm_per_day <= most else shortest


def _rounded(
    path: RigidPath,
    fixator: Fixator,
    rules: ScheduleRules,
    readings: NDArray[np.float64],
    pace: Pace,
    stroke: StrokeCheck,
) -> StrutSchedule:
    """The schedule in whole steps over the days of `pace`."""
    s = path_parameters(pace.days, rules.adjustments_per_day)
    rotations, positions = path.poses(s)
    watched = path.in_proximal(path.watched.points_mm, s)
    rounded = round_rows(
        rotations=rotations,
        positions_mm=positions,
        interest_in_a_mm=path.in_proximal(path.interest_mm, s),
        fixator=fixator,
        step_mm=rules.strut_step_mm,
        watched_in_a_mm=watched,
        most_way_mm=rules.max_rate_mm_per_day + rules.strut_step_mm,
        rows_a_day=rules.adjustments_per_day,
    )
    return _assemble(path, rules, readings, pace, stroke, rounded, watched)


def _one_more_day(pace: Pace) -> Pace:
    """The same path over one day more, because whole steps of the struts need it."""
    slower = pace.days / (pace.days + 1)
    return replace(
        pace,
        days=pace.days + 1,
        ruling="whole strut steps",
        rate_mm_per_day=pace.rate_mm_per_day * slower,
        rate_rad_per_day=pace.rate_rad_per_day * slower,
    )


def _assemble(
    path: RigidPath,
    rules: ScheduleRules,
    readings: NDArray[np.float64],
    pace: Pace,
    stroke: StrokeCheck,
    rounded: RoundedRows,
    watched: NDArray[np.float64],
) -> StrutSchedule:
    """The schedule from its rounded rows; row 0 keeps today's readings."""
    per_day = rules.adjustments_per_day
    today = ScheduleRow(0, rules.start_date, 0, tuple(readings.tolist()))
    rows = [today] + [_row(k, rounded, rules) for k in range(1, len(rounded.steps))]
    moving = pace.days > 0
    mm, rad = _realised(path, rounded, watched, per_day) if moving else (0.0, 0.0)
    return StrutSchedule(
        rows=tuple(rows),
        start_date=rules.start_date,
        adjustments_per_day=per_day,
        days=pace.days,
        strut_step_mm=rules.strut_step_mm,
        pace=pace,
        stroke=stroke,
        realised_max_mm_per_day=mm,
        realised_max_rad_per_day=rad,
        rounding_max_mm=float(rounded.shift_mm[1:].max(initial=0.0)),
        rounding_max_rad=float(rounded.turn_rad[1:].max(initial=0.0)),
        end_error_mm=float(rounded.shift_mm[-1]) if moving else 0.0,
        end_error_rad=float(rounded.turn_rad[-1]) if moving else 0.0,
        end=pose_of_row(rounded, -1) if moving else path.start,
    )


def _row(k: int, rounded: RoundedRows, rules: ScheduleRules) -> ScheduleRow:
    """Row k ≥ 1 of the schedule."""
    day, adjustment = divmod(k - 1, rules.adjustments_per_day)
    return ScheduleRow(
        day=day + 1,
        date=rules.start_date + datetime.timedelta(days=day),
        adjustment=adjustment + 1,
        strut_mm=tuple(rounded.readings_mm[k].tolist()),
    )


def _realised(
    path: RigidPath, rounded: RoundedRows, watched: NDArray[np.float64], per_day: int
) -> tuple[float, float]:
    """Largest way of a watched point and largest turn over `per_day` rows as rounded."""
    rotations, positions = rounded.rotations.copy(), rounded.positions_mm.copy()
    rotations[0], positions[0] = path.start.rotation, path.start.position_mm
    way = displacements(
        points_in_a_mm=watched[per_day:],
        from_rotations=rotations[:-per_day],
        from_positions=positions[:-per_day],
        to_rotations=rotations[per_day:],
        to_positions=positions[per_day:],
    )
    chord = np.sqrt(np.sum((rotations[per_day:] - rotations[:-per_day]) ** 2, axis=(1, 2)) / 8.0)
    return float(way.max()), float(2.0 * np.arcsin(chord.max()))


def _check_rules(rules: ScheduleRules) -> None:
    """All impossible rules at once."""
    faults = []
    per_day, step = rules.adjustments_per_day, rules.strut_step_mm
    if not 1 <= per_day <= MAX_ADJUSTMENTS_PER_DAY or int(per_day) != per_day:
        faults.append(
            Fault(
                "adjustments-per-day",
                "the adjustments per day must be a whole number",
                value=f"{per_day:g}",
                limit=f"1 to {MAX_ADJUSTMENTS_PER_DAY}",
                where="schedule.adjustments_per_day",
                hazard="H28",
            )
        )
    if not 0.0 < step < 10.0:
        faults.append(
            Fault(
                "strut-step",
                "the strut's step must be the length of one click or mark",
                value=f"{step:g} mm",
                limit="above 0, below 10 mm",
                where="schedule.strut_step_mm",
                hazard="H43",
            )
        )
    if faults:
        raise InputError(*faults)


def _check_stroke(stroke: StrokeCheck, fixator: Fixator, days: int) -> None:
    """Refuse with one fault for each strut and end of the stroke that is passed."""
    strut, faults = fixator.strut, []
    for k in range(6):
        if stroke.min_mm[k] < strut.min_mm - STROKE_TOLERANCE_MM:
            worst = stroke.min_mm[k], stroke.min_at[k]
            faults.append(_stroke_fault(k, worst, "short", days, fixator))
        if stroke.max_mm[k] > strut.max_mm + STROKE_TOLERANCE_MM:
            worst = stroke.max_mm[k], stroke.max_at[k]
            faults.append(_stroke_fault(k, worst, "long", days, fixator))
    if faults:
        raise StrutOutOfRange(*faults)


def _stroke_fault(
    strut: int, worst: tuple[float, float], end: str, days: int, fixator: Fixator
) -> Fault:
    """One strut beyond one end of its stroke, at its worst moment (length, path parameter)."""
    length, at = worst
    day = int(min(np.floor(at * days), max(days - 1, 0))) + 1 if at > 0.0 else 0
    limit = fixator.strut.min_mm if end == "short" else fixator.strut.max_mm
    offset = fixator.strut.scale_offset_mm
    return Fault(
        "strut-out-of-range",
        f"strut {strut + 1} would be too {end} on day {day}" + (" (today)" if day == 0 else ""),
        value=f"{length:.2f} mm, reading {length - offset:.2f} mm",
        limit=f"{limit:g} mm, reading {limit - offset:g} mm",
        hazard="H27",
        where=f"strut {strut + 1}",
        next_step="plan a change of this strut, or another mounting of the frame",
    )
