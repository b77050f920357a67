"""The correction while it is being drawn: where it leads, and fragment motions as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.case import Case
from hexafix.correction import (
    Compensation,
    FragmentMotion,
    RecognisedRings,
    compensate,
    motion_between,
    planned_motion,
    target_of,
)
from hexafix.errors import Fault, HexaFixError, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics import forward_kinematics, strut_lengths
from hexafix.pipeline.numbers import pose_document, rounded
from hexafix.pipeline.recognised import Recognised
from hexafix.pipeline.strut_witness import bring_together


def preview_target(case: Case, recognised: Recognised) -> dict[str, Any]:
    """Where a correction leads, quickly and without a word against it: for dragging.

    Parameters
    ----------
    case : Case
        With a correction; where it has readings and a schedule too, image and readings are
        brought together as the plan does it, else the rings are taken as recognised.
    recognised : Recognised

    Returns
    -------
    dict
        ``moving``; ``asked_lps``, the fragment's motion that the correction asks for (4×4, None
        where it settles none; what a transform widget shows); ``fragment_lps``, the motion that
        the frame makes of it from today's readings on, as the plan tells it (of a target pose
        both are this);
        ``target`` ({A} in {B}); ``struts_mm`` (scale values at the end, unrounded);
        ``within_stroke`` (of each strut, at the end; the way there is checked by the plan);
        ``faults``.
    """
    keys = ("moving", "asked_lps", "fragment_lps", "target", "struts_mm", "within_stroke")
    empty = dict.fromkeys(keys)
    if case.correction is None:
        missing = Fault(
            "needed-for-a-plan",
            "a plan needs this part of the case",
            where="correction",
            next_step="say what is to be corrected",
        )
        return {**empty, "faults": [missing.as_json()]}
    try:
        compensation = _compensation(case, recognised)
        goal = planned_motion(case.correction, side=case.limb.side)
        target = target_of(goal, compensation)
        moving = case.correction.moving
        motion = motion_between(compensation, target=target, moving=moving)
        lengths = strut_lengths(target, case.fixator)
        shown = pose_document(target)
    except HexaFixError as error:
        return {**empty, "faults": [fault.as_json() for fault in error.faults]}
    strut = case.fixator.strut
    inside = [bool(strut.min_mm <= length <= strut.max_mm) for length in lengths]
    faults = [
        _stroke_fault(k, float(length), case.fixator)
        for k, (length, ok) in enumerate(zip(lengths, inside, strict=True))
        if not ok
    ]
    return {
        "moving": moving,
        "asked_lps": rounded(
            (goal if isinstance(goal, FragmentMotion) else motion).motion.matrix, 12
        ),
        "fragment_lps": rounded(motion.motion.matrix, 12),
        "target": shown,
        "struts_mm": rounded(lengths - strut.scale_offset_mm, 6),
        "within_stroke": inside,
        "faults": [fault.as_json() for fault in faults],
    }


def _compensation(case: Case, recognised: Recognised) -> Compensation:
    """As the plan brings image and readings together; the rings as recognised without readings."""
    readings, seen = case.strut_readings_mm, recognised.mechanism.pose
    if readings is None or case.schedule is None:
        rings = RecognisedRings(
            proximal=recognised.proximal.pose,
            distal=recognised.distal.pose,
            proximal_covariance=recognised.proximal.covariance,
            distal_covariance=recognised.distal.covariance,
        )
        return compensate(rings, theoretical=seen, mode="none")
    lengths = readings + case.fixator.strut.scale_offset_mm
    forward = forward_kinematics(lengths, case.fixator, start=seen)
    return bring_together(
        case, recognised, case.schedule, readings_mm=readings, theoretical=forward.pose
    )[1]


def _stroke_fault(strut: int, length: float, fixator: Fixator) -> Fault:
    """A strut beyond its stroke at the end of the correction."""
    short, offset = length < fixator.strut.min_mm, fixator.strut.scale_offset_mm
    limit = fixator.strut.min_mm if short else fixator.strut.max_mm
    return Fault(
        "strut-out-of-range",
        f"strut {strut + 1} would be too {'short' if short else 'long'} at the end",
        value=f"{length:.2f} mm, reading {length - offset:.2f} mm",
        limit=f"{limit:g} mm, reading {limit - offset:g} mm",
        hazard="H27",
        where=f"strut {strut + 1}",
        next_step="correct less, plan a change of this strut, or mount the frame otherwise",
    )


def motion_matrix(
    *, translation_mm: ArrayLike, angles_deg: ArrayLike, center_lps_mm: ArrayLike
) -> list[list[float]]:
    """The rigid motion p ↦ R (p - c) + c + t of a fragment in the image.

    Parameters
    ----------
    translation_mm : array_like, shape (3,)
        t, how far the centre moves along L, P and S.
    angles_deg : array_like, shape (3,)
        X-Y-Z fixed angles of R about the L, P and S axes through the centre. Source: Eq. (2).
    center_lps_mm : array_like, shape (3,)
        c, LPS mm.

    Returns
    -------
    list of list of float
        4×4, LPS mm.

    Raises
    ------
    InputError
        If anything is not three finite numbers.
    """
    shift = _three("translation_mm", translation_mm)
    angles = np.radians(_three("angles_deg", angles_deg))
    center = _three("center_lps_mm", center_lps_mm)
    turn = Pose.from_xyz_fixed(position_mm=np.zeros(3), angles_rad=angles)
    moved = Pose(turn.rotation, center + shift - turn.rotation @ center)
    return moved.matrix.tolist()


def motion_numbers(
    matrix: Sequence[Sequence[float]] | ArrayLike, *, center_lps_mm: ArrayLike
) -> dict[str, list[float]]:
    """A fragment's motion as numbers: the other way round than `motion_matrix`.

    Parameters
    ----------
    matrix : array_like, shape (4, 4)
        Rigid, LPS mm.
    center_lps_mm : array_like, shape (3,)
        LPS mm.

    Returns
    -------
    dict
        ``translation_mm`` and ``angles_deg``, three each.

    Raises
    ------
    InputError
        If the matrix is not rigid, or its middle angle is ±90° (H35): then only the matrix tells
        the motion.
    """
    center = _three("center_lps_mm", center_lps_mm)
    motion = Pose.from_matrix(matrix)
    return {
        "translation_mm": rounded(motion.apply(center) - center),
        "angles_deg": rounded(np.degrees(motion.angles_rad)),
    }


def _three(name: str, values: ArrayLike) -> np.ndarray:
    array = np.asarray(values, float)
    if array.shape != (3,) or not np.all(np.isfinite(array)):
        raise InputError.of("three-numbers", "three finite numbers are needed", where=name)
    return array
