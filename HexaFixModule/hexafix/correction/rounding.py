"""Strut rows rounded to the steps of the scale, by the best of the 64 floor and ceil choices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import StrutOutOfRange
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics import strut_lengths_batch
from hexafix.kinematics.newton import solve_rows

ROTATION_WEIGHT_MM = 60.0
"""Length that weighs a rotation error against a shift at the point of interest.

Half the distance over which a limb shows it: with it the best choice halves the shift that plain
rounding leaves at a fracture and turns the bone no more; at 0 it would turn it twice as much.
"""

EVENNESS = 4
"""Power of a row's error in the sum that a path's rows minimise: large errors weigh more."""

TRIES, PRICE = 24, 1.6
"""Sequences tried to keep the day's way, and the factor on the price of a row in a long day."""

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
    """Round every row to whole steps; no error is carried from row to row.

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
        With it and `most_way_mm` the rows follow one another in time: no strut is ever turned
        against the path's own direction, which a patient would misread (H42). Without, each row
        is for itself.
    most_way_mm : float, optional
        Way that no watched point should exceed within a day (`rows_a_day` rows); kept where the
        sequences tried keep it.
    rows_a_day : int

    Notes
    -----
    The error of a choice is √(mean |δp|² + (w δθ)²) over the points, w = `ROTATION_WEIGHT_MM`.
    All 64 choices of every row are solved by forward kinematics, so the best is exact.
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
    exact = _Exact.of(lengths, r, p, points, fixator)
    exact.cost[outside] += _OUTSIDE
    best = exact.cost.argmin(axis=1)
    if watched_in_a_mm is not None and most_way_mm is not None:
        ways = _DaysWays(exact, np.asarray(watched_in_a_mm, float), rows_a_day)
        best = _along_path(exact, steps, in_steps, ways, most_way_mm)
    rows = np.arange(len(r))
    _refuse_impossible(exact.cost[rows, best], step_mm, fixator)
    chosen_steps = steps[rows, best]
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
    """All choices solved by forward kinematics, arrays of shape (S, 64, ...)."""

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


@dataclass(frozen=True, eq=False)
class _DaysWays:
    """Ways of the watched points within a day for a sequence of choices."""

    exact: _Exact
    watched: NDArray[np.float64]
    rows_a_day: int

    def of(self, best: NDArray[np.int64]) -> NDArray[np.float64]:
        """Largest way from each row to the row a day later, mm."""
        rows, day = np.arange(len(best)), self.rows_a_day
        r, p = self.exact.rotations[rows, best], self.exact.positions[rows, best]
        return displacements(
            points_in_a_mm=self.watched[day:],
            from_rotations=r[:-day],
            from_positions=p[:-day],
            to_rotations=r[day:],
            to_positions=p[day:],
        ).max(axis=-1, initial=0.0)


def _along_path(
    exact: _Exact,
    steps: NDArray[np.int64],
    in_steps: NDArray[np.float64],
    ways: _DaysWays,
    most_way_mm: float,
) -> NDArray[np.int64]:
    """A sequence that turns no strut back and, where one is found, keeps the day's way.

    Sequences are tried with a growing price on the two ends of every day that is too long; the
    one with the shortest longest day counts.
    """
    loss, barred = exact.cost**EVENNESS, _turned_back(steps, in_steps)
    shortest, found = np.inf, exact.cost.argmin(axis=1)
    for _ in range(TRIES):
        best = _choose(loss, barred)
        way = ways.of(best)
        longest = float(way.max(initial=0.0))
        if longest < shortest:
            shortest, found = longest, best
        if longest <= most_way_mm:
            break
        starts = np.flatnonzero(way > most_way_mm)
        for rows in (starts, starts + ways.rows_a_day):
            loss[rows, best[rows]] = PRICE * loss[rows, best[rows]] + 1e-6
    return found


def _turned_back(
    steps: NDArray[np.int64], in_steps: NDArray[np.float64]
) -> list[NDArray[np.bool_]]:
    """For each row, which pairs (choice before, choice now) turn a strut back, 64 × 64 each.

    Today's row is as it was read, whatever is chosen there.
    """
    before: NDArray[np.floating] = np.broadcast_to(in_steps[0], steps[0].shape)
    barred = [np.zeros((len(steps[0]), len(steps[0])), bool)]
    for row in range(1, len(steps)):
        direction = in_steps[row] - in_steps[row - 1]
        moved = (steps[row][None, :, :] - before[:, None, :]) * direction
        barred.append(np.any(moved < -1e-9, axis=-1))
        before = steps[row].astype(float)
    return barred


def _choose(loss: NDArray[np.float64], barred: list[NDArray[np.bool_]]) -> NDArray[np.int64]:
    """The choices along a path that turn no strut back with the least sum of losses, shape (S,).

    By dynamic programming over all sequences in which every strut moves only where the path moves
    it. Such a sequence always exists: the floor of a strut that becomes shorter, the ceil of one
    that becomes longer.
    """
    price = [np.where(bar, np.inf, 0.0) for bar in barred]
    total = np.zeros(loss.shape[1])
    came_from = np.zeros(loss.shape, np.int64)
    for row in range(1, len(loss)):
        arrive = price[row] + total[:, None]
        came_from[row] = arrive.argmin(axis=0)
        total = arrive.min(axis=0) + loss[row]
    best = np.zeros(len(loss), np.int64)
    best[-1] = total.argmin()
    for row in range(len(loss) - 1, 0, -1):
        best[row - 1] = came_from[row, best[row]]
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
