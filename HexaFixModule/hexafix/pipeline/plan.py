"""From the recognised poses to a checked plan and its export."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hexafix import export, gates
from hexafix.accuracy import LayoutCheck, check_layouts, layout_faults
from hexafix.case import Case
from hexafix.correction import (
    Compensation,
    FragmentMotion,
    RecognisedRings,
    RigidPath,
    StrutSchedule,
    compensate,
    make_schedule,
    motion_between,
    target_of,
    watched_points,
)
from hexafix.correction.targets import planned_motion
from hexafix.errors import HexaFixError, LayoutRejected
from hexafix.geometry import Pose
from hexafix.imaging import Volume
from hexafix.kinematics import BasinCheck, ForwardSolution, forward_kinematics, second_starts
from hexafix.pipeline import plan_document
from hexafix.pipeline.recognise import Recognised, read_case_image, recognise
from hexafix.pipeline.strut_witness import StrutWitness, compare_struts
from hexafix.progress import Progress, silent
from hexafix.report.pdf import prescription_pdf
from hexafix.report.picture import SceneRenderer
from hexafix.report.scene import BoneSample, SceneGeometry, sample_bone
from hexafix.report.tables import markers_mrk_json, schedule_csv
from hexafix.verify import check_printed, recompute


@dataclass(frozen=True, eq=False)
class Plan:
    """Everything that was computed for one case.

    Attributes
    ----------
    case : Case
    recognised : Recognised
    layout : LayoutCheck
    forward : ForwardSolution
        X_t, the mechanism pose from today's readings.
    basin : BasinCheck
    witness : StrutWitness
        Strut lengths by CT against the readings.
    compensation : Compensation
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
    forward: ForwardSolution
    basin: BasinCheck
    witness: StrutWitness
    compensation: Compensation
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
        If a gate is red or a step refuses.
    """
    layout = check_layouts(case.proximal, case.distal)
    faults = layout_faults(layout, accept_relaxed=accept_relaxed_layout, numbering_settled=True)
    if faults:
        raise LayoutRejected(*faults)
    if volume is None:
        volume = read_case_image(case, progress=progress)
    recognised = recognise(case, volume, progress=progress)
    gates.decide(recognised.gates)
    progress("plan the correction", 0.0)
    plan = _plan(case, recognised, accept_relaxed_layout=accept_relaxed_layout)
    progress("plan the correction", 1.0)
    return plan


def plan_and_export(
    case: Case,
    folder: Path,
    *,
    volume: Volume | None = None,
    accept_relaxed_layout: bool = False,
    progress: Progress = silent,
) -> dict[str, Any]:
    """The whole chain: plan, recompute by another road, print, read back, write.

    Parameters
    ----------
    case : Case
    folder : Path
        Where the export goes, all or nothing.
    volume, accept_relaxed_layout, progress
        As in `plan_correction`.

    Returns
    -------
    dict
        The plan document, as ``plan.json`` holds it.

    Raises
    ------
    Refused
        If a gate is red; nothing is written and an older export stays as it is.
    """
    export.check_target(folder)
    with SceneRenderer() as renderer:
        plan = plan_correction(
            case,
            volume=volume,
            accept_relaxed_layout=accept_relaxed_layout,
            progress=progress,
        )
        document = plan_document.plan(plan)
        renderer.show(_scene(document, plan))
        progress("recompute by another road", 0.0)
        document["gates"] += [gate.as_json() for gate in _recomputed(document)]
        progress("recompute by another road", 1.0)
        progress("set the prescription", 0.0)
        files = {
            "plan.json": json_bytes(document),
            "schedule.csv": schedule_csv(document),
            "markers.mrk.json": markers_mrk_json(document),
            "prescription.pdf": prescription_pdf(document, pictures=renderer.result()),
        }
    wrong = check_printed(document, files)
    if wrong:
        raise HexaFixError.of(
            "print-differs",
            "what would be printed differs from the plan: " + "; ".join(wrong[:3]),
            hazard="H41",
            next_step="report this case; nothing was written",
        )
    progress("set the prescription", 1.0)
    export.write_export(files, folder)
    return document


def json_bytes(document: dict[str, Any]) -> bytes:
    """A document as it is written: the same content gives the same bytes."""
    return (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()


def _scene(document: dict[str, Any], plan: Plan) -> SceneGeometry:
    bare = SceneGeometry.from_document(document)
    bone: BoneSample = sample_bone(plan.recognised.volume, bare)
    return SceneGeometry.from_document(document, bone=bone)


def _recomputed(document: dict[str, Any]) -> tuple[gates.Gate, ...]:
    """G9, decided."""
    result = recompute(document)
    found = gates.recomputed(result.distance_mm, result.rotation_deg)
    gates.decide(found)
    return found


def _plan(case: Case, recognised: Recognised, *, accept_relaxed_layout: bool) -> Plan:
    """The steps after recognition; `plan_correction` has checked that the case is plannable."""
    if case.strut_readings_mm is None or case.correction is None or case.schedule is None:
        raise HexaFixError.of("not-plannable", "a plan needs readings, correction and schedule")
    lengths = case.strut_readings_mm + case.fixator.strut.scale_offset_mm
    witness = compare_struts(recognised.mechanism.pose, case.fixator, lengths_mm=lengths)
    gates.decide([gates.struts_agree(witness.differences_mm, better_order=witness.better_order)])
    forward = forward_kinematics(lengths, case.fixator, start=recognised.mechanism.pose)
    basin = second_starts(lengths, case.fixator, solution=forward.pose)
    rings = RecognisedRings(
        proximal=recognised.proximal.pose,
        distal=recognised.distal.pose,
        proximal_covariance=recognised.proximal.covariance,
        distal_covariance=recognised.distal.covariance,
    )
    compensation = compensate(rings, theoretical=forward.pose, mode=case.schedule.compensation)
    basin_worst = basin.worst_mm if basin.agree else max(basin.worst_mm, np.inf)
    found = [
        gates.struts_agree(witness.differences_mm, better_order=witness.better_order),
        *gates.recognition_error(compensation.difference_mm, compensation.difference_rad),
        gates.forward_basin(basin_worst, basin.count),
    ]
    gates.decide(found)
    target = target_of(planned_motion(case.correction, side=case.limb.side), compensation)
    moving = case.correction.moving
    path = RigidPath(
        start=forward.pose,
        target=target,
        moving=moving,
        watched=watched_points(
            case.fixator,
            moving=moving,
            moving_ring=compensation.proximal if moving == "proximal" else compensation.distal,
            structures_lps_mm=case.schedule.structures_at_risk_mm,
        ),
    )
    schedule = make_schedule(path, case.fixator, case.schedule, readings_mm=case.strut_readings_mm)
    found.append(gates.well_conditioned(schedule.stroke.condition_number))
    layout = _layout_as_measured(case, recognised)
    found += _layout_gates(layout, accept_relaxed_layout)
    gates.decide(found)
    motion = motion_between(compensation, target=target, moving=moving)
    everything = (*recognised.gates, *found)
    return Plan(
        case, recognised, layout, forward, basin, witness, compensation, target, motion, schedule,
        everything,
    )  # fmt: skip


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
