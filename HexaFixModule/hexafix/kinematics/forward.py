"""Forward kinematics of the 6-SPS mechanism: Newton with a twist update from a known pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import Fault, ForwardKinematicsDiverged, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics.inverse import condition_number, joint_radius_mm
from hexafix.kinematics.newton import (
    MAX_ITERATIONS,
    TOLERANCE_MM,
    ForwardBatch,
    solve_one,
    solve_rows,
)

MAX_CONDITION = 40.0
"""Scaled condition number above which a pose is too close to a singularity to be trusted.

Ten times that of a usual pose; at 40 a start 15 mm or 10 degrees away already leads elsewhere.
"""


@dataclass(frozen=True)
class ForwardSolution:
    """A mechanism pose from strut lengths.

    Attributes
    ----------
    pose : Pose
        X_t, {A} in {B}.
    iterations : int
        Newton steps taken.
    residual_mm : float
        Largest difference of a strut length from the given one.
    condition_number : float
        Of the Jacobian at the pose, rotation columns divided by the joint radius.
    """

    pose: Pose
    iterations: int
    residual_mm: float
    condition_number: float


def forward_kinematics(lengths_mm: ArrayLike, fixator: Fixator, *, start: Pose) -> ForwardSolution:
    """Mechanism pose of six strut lengths, on the branch of the start pose.

    Parameters
    ----------
    lengths_mm : array_like, shape (6,)
        Strut lengths joint centre to joint centre, mm.
    fixator : Fixator
    start : Pose
        {A} in {B} near the solution; the recognised pose X_r.

    Raises
    ------
    InputError
        If the lengths are not six positive finite numbers.
    ForwardKinematicsDiverged
        If Newton does not arrive, or arrives next to a singularity; no last iterate is returned.

    Notes
    -----
    Source: Eq. (30). Departs: the unknowns are a twist of the moving ring instead of X-Y-Z
    angles, so there is no gimbal lock; four steps are usual.
    """
    q = _checked_lengths(lengths_mm, (6,))
    end = solve_one(q, fixator, start=start)
    if not end.residual_mm <= TOLERANCE_MM:
        raise _diverged(end.residual_mm, end.iterations)
    # the frame of the axes turns the Jacobian's columns and leaves its singular values
    condition = float(condition_number(end.jacobian, length_mm=joint_radius_mm(fixator)))
    if not condition <= MAX_CONDITION:
        raise ForwardKinematicsDiverged.of(
            "near-singular",
            "the mechanism is next to a singular pose, where the struts do not settle its pose",
            value=f"condition number {condition:.3g}",
            limit=f"{MAX_CONDITION:g}",
            hazard="H31",
            next_step="check the strut readings and the fixator definition",
        )
    pose = Pose(end.rotation, end.position_mm)
    return ForwardSolution(pose, end.iterations, end.residual_mm, condition)


def forward_kinematics_batch(
    lengths_mm: ArrayLike,
    fixator: Fixator,
    *,
    start_rotations: ArrayLike,
    start_positions: ArrayLike,
) -> ForwardBatch:
    """`forward_kinematics` of many sets of lengths at once, without the condition number.

    Parameters
    ----------
    lengths_mm : array_like, shape (M, 6)
        mm.
    fixator : Fixator
    start_rotations : array_like, shape (M, 3, 3) or (3, 3)
    start_positions : array_like, shape (M, 3) or (3,)
        Start poses, {A} in {B}, mm.

    Raises
    ------
    InputError
        If a length is not a positive finite number.
    ForwardKinematicsDiverged
        If any row does not arrive; names how many and the first.
    """
    q = np.asarray(lengths_mm, float)
    q = _checked_lengths(q, (len(q), 6))
    batch = solve_rows(q, fixator, start_rotations=start_rotations, start_positions=start_positions)
    failed = np.flatnonzero(~batch.arrived)
    if len(failed):
        first = int(failed[0])
        raise _diverged(
            float(batch.residual_mm[first]),
            int(batch.iterations[first]),
            where=f"row {first} ({len(failed)} of {len(q)} rows)",
        )
    return batch


def _checked_lengths(lengths_mm: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    q = np.asarray(lengths_mm, float)
    # NaN is neither above 0 nor below infinity; six numbers are quicker by themselves
    if q.size == 6:
        sound = all(0.0 < length < np.inf for length in q.ravel().tolist())
    else:
        sound = not q.size or bool(q.min() > 0.0 and q.max() < np.inf)
    if q.shape != shape or not sound:
        raise InputError.of(
            "strut-lengths",
            "six positive finite strut lengths are needed",
            value=f"shape {q.shape}" if q.shape != shape else f"smallest {np.min(q):g} mm",
            limit="> 0 mm",
            hazard="H55",
            next_step="enter the six strut readings again",
        )
    return q


def _diverged(
    residual: float, iterations: int, where: str | None = None
) -> ForwardKinematicsDiverged:
    return ForwardKinematicsDiverged(
        Fault(
            "forward-kinematics-diverged",
            "no mechanism pose with these strut lengths was found near the recognised pose",
            value=f"residual {residual:.3g} mm after {iterations} iterations",
            limit=f"{TOLERANCE_MM:g} mm within {MAX_ITERATIONS} iterations",
            next_step="check the strut readings, their order and the marker numbers",
            hazard="H29",
            where=where,
        )
    )
