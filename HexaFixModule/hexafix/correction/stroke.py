"""Extreme strut lengths along a path, at the rows and between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.correction.path import RigidPath
from hexafix.hardware import Fixator
from hexafix.kinematics import (
    condition_number,
    joint_radius_mm,
    strut_jacobian_batch,
    strut_lengths_batch,
)

UNSEEN_MM = 1e-3
"""Excursions smaller than this may hide between two samples."""


@dataclass(frozen=True, eq=False)
class StrokeCheck:
    """Extremes of each strut along the path.

    Attributes
    ----------
    min_mm, max_mm : ndarray, shape (6,)
        Shortest and longest length, joint centre to joint centre.
    min_at, max_at : ndarray, shape (6,)
        Path parameters s in [0, 1] where they occur.
    condition_number : float
        Largest along the path.
    """

    min_mm: NDArray[np.float64]
    max_mm: NDArray[np.float64]
    min_at: NDArray[np.float64]
    max_at: NDArray[np.float64]
    condition_number: float


def stroke_along(path: RigidPath, fixator: Fixator) -> StrokeCheck:
    """Extremes of the strut lengths on the whole path.

    Notes
    -----
    Between two samples h apart a length leaves the chord by at most max |q''| h² / 8, which the
    number of samples keeps below `UNSEEN_MM`; where the slope changes sign the extreme is then
    found by bisection on the exact derivative dq/ds = J ξ.
    """
    s = np.linspace(0.0, 1.0, _sample_count(path, fixator) + 1)
    lengths, slopes, conditions = _lengths_and_slopes(path, fixator, s)
    turning = np.argwhere(slopes[:-1] * slopes[1:] < 0.0)
    candidates_s, candidates = [s], [lengths]
    if len(turning):
        at = _bisect(path, fixator, s, slopes, turning)
        candidates_s.append(at)
        candidates.append(_lengths_and_slopes(path, fixator, at)[0])
    all_s, all_lengths = np.concatenate(candidates_s), np.concatenate(candidates)
    return StrokeCheck(
        min_mm=all_lengths.min(axis=0),
        max_mm=all_lengths.max(axis=0),
        min_at=all_s[all_lengths.argmin(axis=0)],
        max_at=all_s[all_lengths.argmax(axis=0)],
        condition_number=float(conditions.max()),
    )


def _sample_count(path: RigidPath, fixator: Fixator) -> int:
    """Samples that keep an unseen excursion below `UNSEEN_MM`.

    |q''| ≤ |v|² / q + |a| with v, a speed and acceleration of the moving joint: on a screw
    |v| ≤ |ρ| + |θ| |a_l| and |a| ≤ |θ| |v|; q is at least a third of the shortest length at the
    ends for any path that could pass the stroke limits.
    """
    shift, turn = np.linalg.norm(path.twist[:3]), np.linalg.norm(path.twist[3:])
    speed = shift + turn * np.linalg.norm(fixator.proximal.joints_mm, axis=1).max()
    shortest = max(fixator.strut.min_mm / 3.0, 1.0)
    second = speed**2 / shortest + turn * speed
    return int(np.clip(np.ceil(np.sqrt(second / (8.0 * UNSEEN_MM))), 64, 20_000))


def _lengths_and_slopes(
    path: RigidPath, fixator: Fixator, s: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Lengths and dq/ds, shape (S, 6), and condition numbers, shape (S,)."""
    rotations, positions = path.poses(s)
    lengths = strut_lengths_batch(rotations=rotations, positions_mm=positions, fixator=fixator)
    jacobian = strut_jacobian_batch(rotations=rotations, positions_mm=positions, fixator=fixator)
    conditions = condition_number(jacobian, length_mm=joint_radius_mm(fixator))
    return lengths, jacobian @ path.twist, conditions


def _bisect(
    path: RigidPath,
    fixator: Fixator,
    s: NDArray[np.float64],
    slopes: NDArray[np.float64],
    turning: NDArray[np.int64],
) -> NDArray[np.float64]:
    """Path parameters where the slope of a strut is zero, one for each (sample, strut)."""
    sample, strut = turning.T
    low, high = s[sample], s[sample + 1]
    sign = np.sign(slopes[sample, strut])
    rows = np.arange(len(strut))
    for _ in range(40):
        middle = 0.5 * (low + high)
        here = np.sign(_lengths_and_slopes(path, fixator, middle)[1][rows, strut])
        low = np.where(here == sign, middle, low)
        high = np.where(here == sign, high, middle)
    return 0.5 * (low + high)
