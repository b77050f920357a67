"""Strut rows rounded to the steps of the scale, by the best of the 64 floor and ceil choices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import StrutOutOfRange
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics import strut_jacobian_batch, strut_lengths_batch
from hexafix.kinematics.newton import solve_rows

ROTATION_WEIGHT_MM = 60.0
"""Length that weighs a rotation error against a shift at the point of interest.

Half the distance over which a limb shows it: with it the best choice halves the shift that plain
rounding leaves at a fracture and turns the bone no more; at 0 it would turn it twice as much.
"""

FINALISTS = 24
"""How many of the 64 choices, ranked by the linear model, are solved exactly."""

_OUTSIDE = 1e6  # cost of a choice outside the stroke

_CHOICES = np.array([[(k >> strut) & 1 for strut in range(6)] for k in range(64)])


@dataclass(frozen=True, eq=False)
class RoundedRows:
    """Scale readings in whole steps, with the poses that they really give.

    Attributes
    ----------
    steps : ndarray of int, shape (S, 6)
        Readings in steps of the scale.
    readings_mm : ndarray, shape (S, 6)
    rotations : ndarray, shape (S, 3, 3)
    positions_mm : ndarray, shape (S, 3)
        Poses {A} in {B} that the rounded readings give, mm.
    shift_mm : ndarray, shape (S,)
        Largest displacement of a watched point from where the path has it.
    turn_rad : ndarray, shape (S,)
        Angle between the axes as rounded and on the path, radians.
    """

    steps: NDArray[np.int64]
    readings_mm: NDArray[np.float64]
    rotations: NDArray[np.float64]
    positions_mm: NDArray[np.float64]
    shift_mm: NDArray[np.float64]
    turn_rad: NDArray[np.float64]


def round_rows(
    *,
    rotations: ArrayLike,
    positions_mm: ArrayLike,
    interest_in_a_mm: ArrayLike,
    fixator: Fixator,
    step_mm: float,
    watched_in_a_mm: ArrayLike | None = None,
    most_way_mm: float | None = None,
    rows_a_day: int = 1,
) -> RoundedRows:
    """Round every row by itself, so that no error is carried from row to row.

    Parameters
    ----------
    rotations : array_like, shape (S, 3, 3)
    positions_mm : array_like, shape (S, 3)
        Ideal poses {A} in {B}, mm; row 0 is today and is not rounded here.
    interest_in_a_mm : array_like, shape (S, Q, 3)
        Points whose displacement counts, in the frame {A}, mm.
    fixator : Fixator
    step_mm : float
        Step of the struts' scale; readings are its multiples, length = reading + offset.
    watched_in_a_mm : array_like, shape (S, P, 3), optional
    most_way_mm : float, optional
        Way that no watched point should exceed within a day (`rows_a_day` rows). Among the
        finalists of a row the best one that keeps it is taken, the best one if none does.
    rows_a_day : int

    Notes
    -----
    The error of a choice is √(mean |δp|² + (w δθ)²) over the points, w = `ROTATION_WEIGHT_MM`.
    The Jacobian ranks all 64; the first `FINALISTS` are solved by forward kinematics and ranked
    again, so the result is the exact best.
    """
    r, p = np.asarray(rotations, float), np.asarray(positions_mm, float)
    points = np.asarray(interest_in_a_mm, float)
    offset, strut = fixator.strut.scale_offset_mm, fixator.strut
    ideal = strut_lengths_batch(rotations=r, positions_mm=p, fixator=fixator)
    in_steps = (ideal - offset) / step_mm
    below = np.floor(in_steps + 1e-9).astype(np.int64)
    # a reading that is a whole number of steps stays: its two choices are the same
    open_ = (in_steps - below > 1e-9).astype(np.int64)
    steps = below[:, None, :] + _CHOICES * open_[:, None, :]
    lengths = np.asarray(steps * step_mm + offset, np.float64)
    outside = np.any((lengths < strut.min_mm - 1e-9) | (lengths > strut.max_mm + 1e-9), axis=-1)
    cost = _linear_cost(lengths - ideal[:, None, :], r, p, points, fixator) + _OUTSIDE * outside
    finalists = np.argsort(cost, axis=1, kind="stable")[:, :FINALISTS]
    chosen_lengths = np.take_along_axis(lengths, finalists[:, :, None], axis=1)
    exact = _Exact.of(chosen_lengths, r, p, points, fixator)
    exact.cost[np.take_along_axis(outside, finalists, axis=1)] += _OUTSIDE
    best = exact.cost.argmin(axis=1)
    if watched_in_a_mm is not None and most_way_mm is not None:
        best = _choose(exact, np.asarray(watched_in_a_mm, float), most_way_mm, rows_a_day)
    rows = np.arange(len(r))
    _refuse_impossible(exact.cost[rows, best], step_mm, fixator)
    chosen_steps = steps[rows, finalists[rows, best]]
    return RoundedRows(
        steps=chosen_steps,
        readings_mm=np.round(chosen_steps.astype(np.float64) * step_mm, 9),
        rotations=exact.rotations[rows, best],
        positions_mm=exact.positions[rows, best],
        shift_mm=exact.shift[rows, best],
        turn_rad=exact.turn[rows, best],
    )


def displacements(
    *,
    points_in_a_mm: NDArray[np.float64],
    from_rotations: NDArray[np.float64],
    from_positions: NDArray[np.float64],
    to_rotations: NDArray[np.float64],
    to_positions: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Distances between points of {A}, shape (..., P, 3), at two poses, shape (..., P), mm."""

    def at(r: NDArray[np.float64], p: NDArray[np.float64]) -> NDArray[np.float64]:
        return points_in_a_mm @ np.swapaxes(r, -1, -2) + p[..., None, :]

    moved = at(to_rotations, to_positions) - at(from_rotations, from_positions)
    return np.sqrt(np.sum(moved * moved, axis=-1))


@dataclass(frozen=True, eq=False)
class _Exact:
    """Finalists solved by forward kinematics, arrays of shape (S, F, ...)."""

    rotations: NDArray[np.float64]
    positions: NDArray[np.float64]
    shift: NDArray[np.float64]
    turn: NDArray[np.float64]
    cost: NDArray[np.float64]

    @classmethod
    def of(
        cls,
        lengths: NDArray[np.float64],
        r: NDArray[np.float64],
        p: NDArray[np.float64],
        points: NDArray[np.float64],
        fixator: Fixator,
    ) -> _Exact:
        rows, count = lengths.shape[:2]
        batch = solve_rows(
            lengths.reshape(-1, 6),
            fixator,
            start_rotations=np.repeat(r, count, axis=0),
            start_positions=np.repeat(p, count, axis=0),
        )
        rotations = batch.rotations.reshape(rows, count, 3, 3)
        positions = batch.positions_mm.reshape(rows, count, 3)
        moved = displacements(
            points_in_a_mm=points[:, None],
            from_rotations=r[:, None],
            from_positions=p[:, None],
            to_rotations=rotations,
            to_positions=positions,
        )
        chord = np.sqrt(np.sum((rotations - r[:, None]) ** 2, axis=(-1, -2)) / 8.0)
        turn = 2.0 * np.arcsin(np.minimum(chord, 1.0))
        cost = np.sqrt(np.mean(moved**2, axis=-1) + (ROTATION_WEIGHT_MM * turn) ** 2)
        cost[~batch.arrived.reshape(rows, count)] = np.inf
        return cls(rotations, positions, moved.max(axis=-1), turn, cost)


def _linear_cost(
    errors: NDArray[np.float64],
    r: NDArray[np.float64],
    p: NDArray[np.float64],
    points: NDArray[np.float64],
    fixator: Fixator,
) -> NDArray[np.float64]:
    """Cost of length errors, shape (S, 64, 6), by the Jacobian, shape (S, 64)."""
    jacobian = strut_jacobian_batch(rotations=r, positions_mm=p, fixator=fixator)
    twists = errors @ np.swapaxes(np.linalg.inv(jacobian), -1, -2)
    shift, turn = twists[..., :3], twists[..., 3:]
    moved = shift[:, :, None, :] + np.cross(turn[:, :, None, :], points[:, None])
    square = np.mean(np.sum(moved**2, axis=-1), axis=-1)
    return np.sqrt(square + ROTATION_WEIGHT_MM**2 * np.sum(turn**2, axis=-1))


def _choose(
    exact: _Exact, watched: NDArray[np.float64], most_way_mm: float, rows_a_day: int
) -> NDArray[np.int64]:
    """Best finalist of each row; where possible one that keeps the day's way."""
    order = np.argsort(exact.cost, axis=1, kind="stable")
    best = order[:, 0].copy()
    for row in range(1, len(best)):
        before = max(row - rows_a_day, 0)
        way = displacements(
            points_in_a_mm=watched[row],
            from_rotations=exact.rotations[before, best[before]],
            from_positions=exact.positions[before, best[before]],
            to_rotations=exact.rotations[row],
            to_positions=exact.positions[row],
        ).max(axis=-1)
        keeps = [k for k in order[row] if way[k] <= most_way_mm and exact.cost[row, k] < _OUTSIDE]
        best[row] = keeps[0] if keeps else order[row, 0]
    return best


def _refuse_impossible(cost: NDArray[np.float64], step_mm: float, fixator: Fixator) -> None:
    """Refuse where no choice of a row can be set within the stroke; row 0 is today's."""
    wrong = np.flatnonzero(~(cost[1:] < _OUTSIDE))
    if len(wrong):
        strut = fixator.strut
        raise StrutOutOfRange.of(
            "no-settable-reading",
            "no reading in whole steps keeps every strut within its stroke",
            value=f"row {int(wrong[0]) + 1}, step {step_mm:g} mm",
            limit=f"{strut.min_mm:g} to {strut.max_mm:g} mm",
            hazard="H27",
            next_step="take a smaller step, or plan a change of the strut at its limit",
        )


def pose_of_row(rows: RoundedRows, row: int) -> Pose:
    """Pose that a rounded row really gives, {A} in {B}."""
    return Pose(rows.rotations[row], rows.positions_mm[row])
