"""From a volume to the recognised poses of both rings and of the mechanism."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix import gates
from hexafix.case import Case
from hexafix.hardware import Fixator, MarkerLayout
from hexafix.imaging import Volume, read_volume
from hexafix.kinematics import strut_lengths
from hexafix.markers import BallSet, find_balls
from hexafix.pipeline import document
from hexafix.pipeline.look import find_case_balls
from hexafix.pipeline.recognised import Recognised
from hexafix.progress import Progress, silent
from hexafix.recognition import (
    MechanismPose,
    Numbering,
    RingPose,
    check_user_numbering,
    mechanism_pose,
    number_balls,
    ring_pose,
    ring_pose_by_groups,
)

StrutJudge = Callable[[RingPose, RingPose], float]
"""RMS difference in mm between strut lengths of two ring poses (proximal, distal) and readings."""


def find_markers(
    image: Path,
    *,
    ball_diameter_mm: float,
    series_instance_uid: str | None = None,
    progress: Progress = silent,
) -> BallSet:
    """Find the balls of an image on disk; what its reader warns of stands before their warnings."""
    volume = read_volume(image, series_instance_uid=series_instance_uid, progress=progress)
    balls = find_balls(volume, ball_diameter_mm=ball_diameter_mm, progress=progress)
    return replace(balls, warnings=(*volume.source.warnings, *balls.warnings))


def read_case_image(case: Case, *, progress: Progress = silent) -> Volume:
    """The case's CT."""
    return read_volume(
        case.image_path, series_instance_uid=case.series_instance_uid, progress=progress
    )


def case_balls(case: Case, volume: Volume, *, progress: Progress = silent) -> BallSet:
    """The case's balls in its image, with the user's corrections."""
    edits = case.marker_edits
    return find_case_balls(
        volume,
        ball_diameter_mm=case.ball_diameter_mm,
        added_lps_mm=edits.added_lps_mm,
        removed_lps_mm=edits.removed_lps_mm,
        progress=progress,
    )


def recognise(
    case: Case, volume: Volume, *, balls: BallSet | None = None, progress: Progress = silent
) -> Recognised:
    """Find, number and locate; the gates are computed, not yet decided.

    Parameters
    ----------
    case : Case
        Its corrections of the balls are followed.
    volume : Volume
    balls : BallSet, optional
        What `case_balls` gave for this case and volume; then they are not searched again.
    progress : Progress, optional

    Raises
    ------
    MarkersNotFound, NumberingAmbiguous, ImageRefused, LayoutRejected
        As the steps find them.
    """
    if balls is None:
        balls = case_balls(case, volume, progress=progress)
    progress("number the balls", 0.0)
    numbering = _number(case, balls)
    progress("number the balls", 1.0)
    poses = {}
    for side, layout in (("proximal", case.proximal), ("distal", case.distal)):
        chosen = _of_layout(layout, numbering)
        points = balls.centers_mm[chosen]
        covariances = np.array([balls.balls[index].covariance_mm2 for index in chosen])
        for method in (ring_pose, ring_pose_by_groups):
            poses[side, method] = method(points, layout, covariances_mm2=covariances)
    proximal, distal = poses["proximal", ring_pose], poses["distal", ring_pose]
    mechanism = mechanism_pose(proximal=proximal, distal=distal)
    return Recognised(
        volume,
        balls,
        numbering,
        proximal,
        distal,
        poses["proximal", ring_pose_by_groups],
        poses["distal", ring_pose_by_groups],
        mechanism,
        _gates(case, volume, balls, numbering, proximal, distal, mechanism),
        case.fixator,
    )


def recognise_case(
    case: Case, *, volume: Volume | None = None, progress: Progress = silent
) -> dict[str, Any]:
    """Read the case's image, recognise and decide the gates; the document of `recognise`.

    Parameters
    ----------
    case : Case
    volume : Volume, optional
        The CT, where a program holds it already; else it is read from the case's path.
    progress : Progress, optional

    Raises
    ------
    Refused
        If a gate is red.
    """
    if volume is None:
        volume = read_case_image(case, progress=progress)
    recognised = recognise(case, volume, progress=progress)
    gates.decide(recognised.gates)
    return document.recognition(case, recognised)


def _number(case: Case, balls: BallSet) -> Numbering:
    centers = balls.centers_mm
    if case.numbering is not None:
        return check_user_numbering(
            dict(case.numbering), centers, proximal=case.proximal, distal=case.distal
        )
    return number_balls(
        centers,
        proximal=case.proximal,
        distal=case.distal,
        judge=judge_by_struts(case.fixator, case.strut_readings_mm),
    )


def judge_by_struts(fixator: Fixator | None, readings_mm: ArrayLike | None) -> StrutJudge | None:
    """RMS of the CT's strut lengths against the readings, for a choice of ring poses.

    Parameters
    ----------
    fixator : Fixator or None
    readings_mm : array_like, shape (6,), or None
        Scale readings, mm; without fixator or readings there is no judge.
    """
    if fixator is None or readings_mm is None:
        return None
    known, lengths = fixator, np.asarray(readings_mm, float) + fixator.strut.scale_offset_mm

    def judge(proximal: RingPose, distal: RingPose) -> float:
        pose = distal.pose.inverse() @ proximal.pose
        return float(np.sqrt(np.mean((strut_lengths(pose, known) - lengths) ** 2)))

    return judge


def _of_layout(layout: MarkerLayout, numbering: Numbering) -> list[int]:
    """Ball indices in the order of the layout's sites."""
    ball = numbering.ball_of_number
    return [ball[number] for number in layout.numbers]


def _gates(
    case: Case,
    volume: Volume,
    balls: BallSet,
    numbering: Numbering,
    proximal: RingPose,
    distal: RingPose,
    mechanism: MechanismPose,
) -> tuple[gates.Gate, ...]:
    """G2 to G5, G7 and the side."""
    sizes = []
    for side, layout in (("proximal", case.proximal), ("distal", case.distal)):
        chosen = [balls.balls[index] for index in _of_layout(layout, numbering)]
        sizes.append(
            gates.ball_diameters(
                side,
                [ball.diameter_mm for ball in chosen],
                case.ball_diameter_mm,
                clipped=any(ball.clipped for ball in chosen),
            )
        )
    found = [
        gates.ring_rms("proximal", proximal.rms_mm),
        gates.ring_rms("distal", distal.rms_mm),
        *sizes,
        gates.moving_ring_above(mechanism.pose),
        gates.rings_face_each_other(proximal.pose, distal.pose),
        gates.angles_rebuild("proximal ring", proximal.pose),
        gates.angles_rebuild("distal ring", distal.pose),
        gates.angles_rebuild("mechanism", mechanism.pose),
        gates.towards_the_head(case.limb.bone, proximal.pose, distal.pose),
        gates.numbering_unique(numbering.margin_mm, numbering.settled_by),
        gates.sides_agree(case.limb.side, volume.source.laterality),
        gates.limbs_agree(case.limb.bone, volume.source.body_part),
    ]
    return tuple(gate for gate in found if gate is not None)
