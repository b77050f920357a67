"""From a volume to the recognised poses of both rings and of the mechanism."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hexafix import gates
from hexafix.case import Case
from hexafix.hardware import MarkerLayout
from hexafix.imaging import Volume, read_volume
from hexafix.kinematics import strut_lengths
from hexafix.markers import BallSet, find_balls
from hexafix.pipeline import document
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


def recognise(case: Case, volume: Volume, *, progress: Progress = silent) -> Recognised:
    """Find, number and locate; the gates are computed, not yet decided.

    Parameters
    ----------
    case : Case
    volume : Volume
    progress : Progress, optional

    Raises
    ------
    MarkersNotFound, NumberingAmbiguous, ImageRefused, LayoutRejected
        As the steps find them.
    """
    balls = find_balls(volume, ball_diameter_mm=case.ball_diameter_mm, progress=progress)
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
    )


def recognise_case(case: Case, *, progress: Progress = silent) -> dict[str, Any]:
    """Read the case's image, recognise and decide the gates; the document of `recognise`.

    Raises
    ------
    Refused
        If a gate is red.
    """
    recognised = recognise(case, read_case_image(case, progress=progress), progress=progress)
    gates.decide(recognised.gates)
    return document.recognition(case, recognised)


def _number(case: Case, balls: BallSet) -> Numbering:
    centers = balls.centers_mm
    if case.numbering is not None:
        return check_user_numbering(
            dict(case.numbering), centers, proximal=case.proximal, distal=case.distal
        )
    return number_balls(
        centers, proximal=case.proximal, distal=case.distal, judge=_strut_judge(case)
    )


def _strut_judge(case: Case) -> Callable[[RingPose, RingPose], float] | None:
    """RMS of the CT's strut lengths against the readings, for a choice of ring poses."""
    readings = case.strut_readings_mm
    if readings is None:
        return None
    lengths = readings + case.fixator.strut.scale_offset_mm

    def judge(proximal: RingPose, distal: RingPose) -> float:
        pose = distal.pose.inverse() @ proximal.pose
        return float(np.sqrt(np.mean((strut_lengths(pose, case.fixator) - lengths) ** 2)))

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
