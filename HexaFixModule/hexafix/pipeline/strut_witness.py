"""CT and strut readings as two witnesses of the same mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from hexafix import gates
from hexafix.case import Case, ScheduleRules
from hexafix.correction import (
    Compensation,
    RecognisedRings,
    compensate,
    reading_covariance,
    reading_resolution_mm,
)
from hexafix.errors import HexaFixError
from hexafix.gates import STRUT_WARNING_MM
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics import (
    BasinCheck,
    ForwardSolution,
    forward_kinematics,
    second_starts,
    strut_lengths,
)
from hexafix.pipeline.recognised import Recognised

ORDER_FACTOR = 3.0
"""Another order of the readings is told when its worst strut fits this many times better (H25)."""


@dataclass(frozen=True, eq=False)
class StrutWitness:
    """How far CT and readings agree.

    Attributes
    ----------
    differences_mm : ndarray, shape (6,)
        Length by CT minus length by reading.
    better_order : str or None
        Another order of the readings that agrees where the given one does not, in words (H25).
    """

    differences_mm: NDArray[np.float64]
    better_order: str | None


def compare_struts(recognised: Pose, fixator: Fixator, *, lengths_mm: NDArray) -> StrutWitness:
    """Compare strut lengths by CT with those of the readings.

    Parameters
    ----------
    recognised : Pose
        X_r, {A} in {B}.
    fixator : Fixator
    lengths_mm : ndarray, shape (6,)
        Reading plus scale offset, mm.

    Notes
    -----
    Forward kinematics can never show a mistyped reading: six equations have six unknowns.
    """
    by_ct = strut_lengths(recognised, fixator)
    differences = by_ct - lengths_mm
    order = None
    if np.max(np.abs(differences)) > STRUT_WARNING_MM:
        order = _better_order(by_ct, lengths_mm)
    return StrutWitness(differences, order)


def _better_order(by_ct: NDArray, lengths: NDArray) -> str | None:
    """The best of the 720 orders, if it fits far better than the given one."""
    orders = np.array(list(permutations(range(6))))
    worst = np.max(np.abs(by_ct - lengths[orders]), axis=1)
    best = orders[int(np.argmin(worst))]
    # the first of the orders is the given one
    if ORDER_FACTOR * worst.min() > worst[0]:
        return None
    given = ", ".join(str(k + 1) for k in best)
    return f"the readings would fit in the order {given}"


@dataclass(frozen=True, eq=False)
class WeighedStruts:
    """What the readings say, and image and readings brought together.

    Attributes
    ----------
    witness : StrutWitness
        Strut lengths by CT against the readings.
    forward : ForwardSolution
        X_t, the mechanism pose from today's readings.
    basin : BasinCheck
        Whether other starts of the forward kinematics agree.
    reading_resolution_mm : float
        How finely the readings were given.
    compensation : Compensation
    gates : tuple of Gate
        G6 and G8, decided.
    """

    witness: StrutWitness
    forward: ForwardSolution
    basin: BasinCheck
    reading_resolution_mm: float
    compensation: Compensation
    gates: tuple[gates.Gate, ...]


def weigh_struts(case: Case, recognised: Recognised) -> WeighedStruts:
    """Compare the readings with the image, solve the mechanism from them, and compensate.

    Raises
    ------
    Refused
        If readings and image disagree (G6) or the mechanism's pose is not certain (G8).
    """
    if case.strut_readings_mm is None or case.schedule is None:
        raise HexaFixError.of("not-plannable", "a plan needs strut readings and a schedule")
    readings, seen = case.strut_readings_mm, recognised.mechanism.pose
    lengths = readings + case.fixator.strut.scale_offset_mm
    witness = compare_struts(seen, case.fixator, lengths_mm=lengths)
    agree = gates.struts_agree(witness.differences_mm, better_order=witness.better_order)
    gates.decide([agree])
    forward = forward_kinematics(lengths, case.fixator, start=seen)
    basin = second_starts(lengths, case.fixator, solution=forward.pose)
    resolution, compensation = bring_together(
        case, recognised, case.schedule, readings_mm=readings, theoretical=forward.pose
    )
    found = (
        agree,
        *gates.recognition_error(compensation.difference_mm, compensation.difference_rad),
        gates.forward_basin(basin.worst_mm if basin.agree else np.inf, basin.count),
    )
    gates.decide(found)
    return WeighedStruts(witness, forward, basin, resolution, compensation, found)


def bring_together(
    case: Case,
    recognised: Recognised,
    rules: ScheduleRules,
    *,
    readings_mm: NDArray,
    theoretical: Pose,
) -> tuple[float, Compensation]:
    """How finely the readings were given, mm, and image and readings brought together.

    Parameters
    ----------
    case : Case
    recognised : Recognised
    rules : ScheduleRules
        Tells the struts' step and how to compensate.
    readings_mm : ndarray, shape (6,)
        Scale readings, mm.
    theoretical : Pose
        X_t from the readings, {A} in {B}.
    """
    resolution = reading_resolution_mm(readings_mm, step_mm=rules.strut_step_mm)
    compensation = compensate(
        RecognisedRings(
            proximal=recognised.proximal.pose,
            distal=recognised.distal.pose,
            proximal_covariance=recognised.proximal.covariance,
            distal_covariance=recognised.distal.covariance,
        ),
        theoretical=theoretical,
        mode=rules.compensation,
        theoretical_covariance=reading_covariance(
            theoretical, case.fixator, resolution_mm=resolution
        ),
    )
    return resolution, compensation
