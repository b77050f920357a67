"""From the recognised poses to a checked plan and its export."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix import gates
from hexafix.accuracy import LayoutCheck, check_layouts, layout_faults
from hexafix.case import Case
from hexafix.correction import (
    Deformity,
    FragmentMotion,
    Landmarks,
    RigidPath,
    StrutSchedule,
    make_schedule,
    motion_between,
    subtraction_departure_mm,
    target_of,
    watched_points,
)
from hexafix.correction.targets import planned_motion
from hexafix.errors import HexaFixError, LayoutRejected
from hexafix.geometry import Pose
from hexafix.imaging import Volume
from hexafix.markers import BallSet
from hexafix.pipeline.recognise import read_case_image, recognise
from hexafix.pipeline.recognised import Recognised
from hexafix.pipeline.strut_witness import WeighedStruts, weigh_struts
from hexafix.progress import Progress, silent
from hexafix.selftest import require_self_test


@dataclass(frozen=True, eq=False)
class Plan:
    """Everything that was computed for one case.

    Attributes
    ----------
    case : Case
    recognised : Recognised
    layout : LayoutCheck
    struts : WeighedStruts
        What the readings say, and image and readings brought together.
    target : Pose
        {A} in {B} at the end.
    motion : FragmentMotion
        What that does to the moving fragment in the image.
    schedule : StrutSchedule
    gates : tuple of Gate
        All that were decided so far.
    """

    case: Case
    recognised: Recognised
    layout: LayoutCheck
    struts: WeighedStruts
    target: Pose
    motion: FragmentMotion
    schedule: StrutSchedule
    gates: tuple[gates.Gate, ...]


def plan_correction(
    case: Case,
    *,
    volume: Volume | None = None,
    accept_relaxed_layout: bool = False,
    progress: Progress = silent,
) -> Plan:
    """Read the image, recognise, compensate and schedule; nothing is written.

    Parameters
    ----------
    case : Case
        With readings, correction and schedule.
    volume : Volume, optional
        The CT, where a program holds it already; else it is read from the case's path.
    accept_relaxed_layout : bool
        Whether the user accepts a layout that keeps only the relaxed angle rule (H17).
    progress : Progress, optional

    Raises
    ------
    Refused
        If the self-test fails, a gate is red or a step refuses.
    """
    require_self_test()
    recognised = recognise_checked(
        case, volume=volume, accept_relaxed_layout=accept_relaxed_layout, progress=progress
    )
    progress("plan the correction", 0.0)
    plan = plan_recognised(case, recognised, accept_relaxed_layout=accept_relaxed_layout)
    progress("plan the correction", 1.0)
    return plan


def recognise_checked(
    case: Case,
    *,
    volume: Volume | None = None,
    balls: BallSet | None = None,
    accept_relaxed_layout: bool = False,
    progress: Progress = silent,
) -> Recognised:
    """The first half of `plan_correction`: the layout's rules, the image, the poses, their gates.

    Parameters
    ----------
    case, volume, accept_relaxed_layout, progress
        As in `plan_correction`.
    balls : BallSet, optional
        As in `recognise`.

    Raises
    ------
    Refused
        If a layout breaks its rules (then the image is not even read) or a gate is red.
    """
    layout = check_layouts(case.proximal, case.distal)
    faults = layout_faults(layout, accept_relaxed=accept_relaxed_layout, numbering_settled=True)
    if faults:
        raise LayoutRejected(*faults)
    if volume is None:
        volume = read_case_image(case, progress=progress)
    recognised = recognise(case, volume, balls=balls, progress=progress)
    gates.decide(recognised.gates)
    return recognised


def plan_recognised(
    case: Case, recognised: Recognised, *, accept_relaxed_layout: bool = False
) -> Plan:
    """The second half of `plan_correction`: struts, compensation, target, schedule, their gates.

    Raises
    ------
    Refused
        If a gate is red or a step refuses.
    """
    if case.correction is None or case.schedule is None or case.strut_readings_mm is None:
        raise HexaFixError.of("not-plannable", "a plan needs readings, correction and schedule")
    struts = weigh_struts(case, recognised)
    compensation = struts.compensation
    goal = planned_motion(case.correction, side=case.limb.side)
    target = target_of(goal, compensation)
    moving = case.correction.moving
    path = RigidPath(
        start=struts.forward.pose,
        target=target,
        moving=moving,
        watched=watched_points(
            case.fixator,
            moving=moving,
            moving_ring=compensation.proximal if moving == "proximal" else compensation.distal,
            structures_lps_mm=case.schedule.structures_at_risk_mm,
            fracture_lps_mm=_point_of_interest(case),
        ),
    )
    schedule = make_schedule(path, case.fixator, case.schedule, readings_mm=case.strut_readings_mm)
    found = [
        gates.well_conditioned(schedule.stroke.condition_number),
        gates.realised_rate(
            schedule.realised_max_mm_per_day,
            case.schedule.max_rate_mm_per_day,
            case.schedule.strut_step_mm,
        ),
    ]
    if compensation.mode == "additive":
        departure = subtraction_departure_mm(goal, compensation, case.fixator)
        found.append(gates.subtraction_near_composition(departure))
    layout = _layout_as_measured(case, recognised)
    found += _layout_gates(layout, accept_relaxed_layout)
    gates.decide(found)
    return Plan(
        case=case,
        recognised=recognised,
        layout=layout,
        struts=struts,
        target=target,
        motion=motion_between(compensation, target=target, moving=moving),
        schedule=schedule,
        gates=(*recognised.gates, *struts.gates, *found),
    )


def _point_of_interest(case: Case) -> NDArray | None:
    """The moving fragment's point, LPS mm, at which rounding shall hurt least; None: unknown."""
    match case.correction:
        case Deformity() as deformity:
            return deformity.corresponding_point_lps_mm(side=case.limb.side)
        case Landmarks() as landmarks:
            return landmarks.moving_points_mm.mean(axis=0)
    return None


def _layout_as_measured(case: Case, recognised: Recognised) -> LayoutCheck:
    """The layout check with the balls' own uncertainty instead of the paper's."""
    used = recognised.numbering.ball_of_number.values()
    variances = [np.diag(recognised.balls.balls[k].covariance_mm2) for k in used]
    return check_layouts(
        case.proximal, case.distal, sigma_image_mm=float(np.sqrt(np.mean(variances)))
    )


def _layout_gates(layout: LayoutCheck, accepted: bool) -> list[gates.Gate]:
    return [
        gates.layout_rule(
            ring,
            verdict.rule,
            float(np.degrees(verdict.included_angles_rad.min())),
            relaxed_accepted=accepted,
        )
        for ring, verdict in (("proximal", layout.proximal), ("distal", layout.distal))
    ]
