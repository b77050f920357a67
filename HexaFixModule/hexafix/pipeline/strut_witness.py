"""CT and strut readings as two witnesses of the same mechanism."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from hexafix.gates import STRUT_LIMIT_MM
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics import strut_lengths


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
    if np.max(np.abs(differences)) > STRUT_LIMIT_MM:
        order = _better_order(by_ct, lengths_mm)
    return StrutWitness(differences, order)


def _better_order(by_ct: NDArray, lengths: NDArray) -> str | None:
    """The best of the 720 orders, if it agrees where the given one does not."""
    orders = np.array(list(permutations(range(6))))
    worst = np.max(np.abs(by_ct - lengths[orders]), axis=1)
    best = orders[int(np.argmin(worst))]
    if worst.min() > STRUT_LIMIT_MM:
        return None
    given = ", ".join(str(k + 1) for k in best)
    return f"the readings would fit in the order {given}"
