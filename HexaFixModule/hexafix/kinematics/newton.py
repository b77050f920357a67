"""Newton's method on the strut lengths, for one pose and for many.

Both work in {B} on rows of numbers (component, strut) rather than on objects: half of the time of
a single solution would else go into the overhead of small arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import sqrt

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from hexafix.geometry import Pose
from hexafix.hardware import Fixator

TOLERANCE_MM = 1e-11
"""Newton has arrived when every strut length agrees to this."""

MAX_ITERATIONS = 30
"""Newton from a recognised pose needs 3 to 5."""

STEP_LIMIT_MM, STEP_LIMIT_RAD = 60.0, 0.6
"""Longest Newton step; keeps a bad linearisation from leaping to another assembly mode."""

_CHUNK = 1024  # rows solved together, so that their arrays stay in the cache


@dataclass(frozen=True, eq=False)
class ForwardBatch:
    """Mechanism poses from many sets of strut lengths.

    Attributes
    ----------
    rotations : ndarray, shape (M, 3, 3)
        Orientations of {A} in {B}.
    positions_mm : ndarray, shape (M, 3)
        Origins of {A} in {B}, mm.
    iterations : ndarray of int, shape (M,)
    residual_mm : ndarray, shape (M,)
        Largest difference of a strut length from the given one.
    """

    rotations: NDArray[np.float64]
    positions_mm: NDArray[np.float64]
    iterations: NDArray[np.int64]
    residual_mm: NDArray[np.float64]

    @property
    def arrived(self) -> NDArray[np.bool_]:
        """Rows that reached the tolerance, shape (M,)."""
        return self.residual_mm <= TOLERANCE_MM


@dataclass(frozen=True, eq=False)
class Newton:
    """Where Newton ended on one set of lengths, arrived or not.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
    position_mm : ndarray, shape (3,)
    iterations : int
    residual_mm : float
    jacobian : ndarray, shape (6, 6)
        dq by a shift and a turn along the axes of {B} about the origin of {A}.
    """

    rotation: NDArray[np.float64]
    position_mm: NDArray[np.float64]
    iterations: int
    residual_mm: float
    jacobian: NDArray[np.float64]


def solve_one(lengths_mm: NDArray[np.float64], fixator: Fixator, *, start: Pose) -> Newton:
    """Newton from the start pose; the caller must look at the residual.

    Parameters
    ----------
    lengths_mm : ndarray, shape (6,)
        mm.
    fixator : Fixator
    start : Pose
        {A} in {B}.
    """
    a, b = fixator.proximal.joints_mm.T, fixator.distal.joints_mm.T
    r, p = orthonormal(start.rotation), start.position_mm[:, None]
    columns = np.empty((6, 6))  # the transposed Jacobian: one row per unknown
    worst, iteration = np.inf, 0
    for iteration in range(MAX_ITERATIONS + 1):
        arms = r @ a
        vectors = arms + (p - b)
        lengths = np.sqrt((vectors * vectors).sum(axis=0))
        missing = lengths_mm - lengths
        columns[:3] = vectors / lengths
        _moments(arms, columns[:3], out=columns[3:])
        worst = max(map(abs, missing.tolist()))
        if worst <= TOLERANCE_MM or not worst < np.inf or iteration == MAX_ITERATIONS:
            break
        # LAPACK without numpy's wrapper, whose overhead is longer than the solution of six rows
        *_, step, singular = scipy.linalg.lapack.dgesv(columns.T, missing)
        if singular:
            break
        x, y, z, u, v, w = step.tolist()
        shift, angle = sqrt(x * x + y * y + z * z), sqrt(u * u + v * v + w * w)
        excess = max(shift / STEP_LIMIT_MM, angle / STEP_LIMIT_RAD, 1.0)
        p = p + step[:3, None] / excess
        r = _rotation(u / excess, v / excess, w / excess) @ r
    return Newton(r, p[:, 0], iteration, worst, columns.T)


def solve_rows(
    lengths_mm: NDArray[np.float64],
    fixator: Fixator,
    *,
    start_rotations: ArrayLike,
    start_positions: ArrayLike,
) -> ForwardBatch:
    """Newton on every row; rows that do not arrive keep their large residual.

    Parameters
    ----------
    lengths_mm : ndarray, shape (M, 6)
        mm.
    fixator : Fixator
    start_rotations : array_like, shape (M, 3, 3) or (3, 3)
    start_positions : array_like, shape (M, 3) or (3,)
        {A} in {B}, mm.
    """
    m = len(lengths_mm)
    # the row index comes last inside, so that every operation runs along memory
    r = orthonormal(np.asarray(start_rotations, float))
    r = np.array(np.moveaxis(np.broadcast_to(r, (m, 3, 3)), 0, -1), order="C")
    p = np.array(np.broadcast_to(np.asarray(start_positions, float), (m, 3)).T)
    q = np.ascontiguousarray(lengths_mm.T)
    iterations, residual = np.zeros(m, np.int64), np.full(m, np.inf)
    # a singular row becomes NaN and fails by itself
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        for first in range(0, m, _CHUNK):
            rows = slice(first, min(first + _CHUNK, m))
            _solve_chunk(
                q[:, rows], fixator, r[..., rows], p[:, rows], iterations[rows], residual[rows]
            )
    return ForwardBatch(
        np.ascontiguousarray(np.moveaxis(r, -1, 0)),
        np.ascontiguousarray(p.T),
        iterations,
        residual,
    )


def _solve_chunk(
    q: NDArray[np.float64],
    fixator: Fixator,
    rotations: NDArray[np.float64],
    positions: NDArray[np.float64],
    iterations: NDArray[np.int64],
    residual: NDArray[np.float64],
) -> None:
    """Newton in place on q (6, m), rotations (3, 3, m), positions (3, m); arrived rows leave."""
    a, b = fixator.proximal.joints_mm, fixator.distal.joints_mm.T[:, :, None]
    active = np.arange(q.shape[1])
    r, p = rotations.copy(), positions.copy()
    arms, columns = np.empty((3, 6, len(active))), np.empty((6, 6, len(active)))
    for iteration in range(MAX_ITERATIONS + 1):
        m = len(active)
        np.matmul(a, r, out=arms)  # arms[i, l] = Σ_j a[l, j] r[i, j]
        vectors = p[:, None, :] - b
        vectors += arms
        lengths = np.sqrt((vectors * vectors).sum(axis=0))
        missing = q - lengths
        worst = np.abs(missing).max(axis=0)
        going = (worst > TOLERANCE_MM) & np.isfinite(worst)
        rotations[..., active], positions[:, active] = r, p
        residual[active] = worst
        iterations[active[going]] = min(iteration + 1, MAX_ITERATIONS)
        count = int(going.sum())
        if iteration == MAX_ITERATIONS or not count:
            return
        np.divide(vectors, lengths, out=columns[:3])
        _moments(arms, columns[:3], out=columns[3:])
        if 2 * count < m:  # a row that has arrived may take a step more, but not many
            active, q, r, p = active[going], q[:, going], r[..., going], p[:, going]
            missing, columns = missing[:, going], columns[..., going]
            arms = np.empty((3, 6, count))
        step = _solve_systems(columns, missing)
        p = p + step[:3]
        turn = _rotations(step[3], step[4], step[5])
        # r[i, k] = Σ_j turn[i, j] r[j, k]
        r = (
            turn[:, 0, None] * r[None, 0]
            + turn[:, 1, None] * r[None, 1]
            + turn[:, 2, None] * r[None, 2]
        )


def _solve_systems(
    columns: NDArray[np.float64], missing: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Newton steps (6, m) of transposed Jacobians (6, 6, m), limited in length.

    Elimination of the normal equations, which need no pivots, for all rows at once. Their
    squared condition number costs digits that the next step brings back.
    """
    m = missing.shape[1]
    system = np.empty((6, 7, m))
    right = system[:, 6]
    for i in range(6):
        products = columns[i:] * columns[i]
        system[i, i:6] = products.sum(axis=1)
    (columns * missing).sum(axis=1, out=right)
    for k in range(5):
        factors = system[k, k + 1 : 6] / system[k, k]
        for i in range(k + 1, 6):
            system[i, i:] -= factors[i - k - 1] * system[k, i:]
    step = np.empty((6, m))
    for k in range(5, -1, -1):
        known = (system[k, k + 1 : 6] * step[k + 1 :]).sum(axis=0)
        step[k] = (right[k] - known) / system[k, k]
    shift = np.sqrt((step[:3] ** 2).sum(axis=0))
    angle = np.sqrt((step[3:] ** 2).sum(axis=0))
    return step / np.maximum(np.maximum(shift / STEP_LIMIT_MM, angle / STEP_LIMIT_RAD), 1.0)


def _moments(
    arms: NDArray[np.float64], axes: NDArray[np.float64], *, out: NDArray[np.float64]
) -> None:
    """Cross products arms × axes along the first axis, both shape (3, 6, ...), written to `out`."""
    ax, ay, az = arms
    sx, sy, sz = axes
    np.subtract(ay * sz, az * sy, out=out[0])
    np.subtract(az * sx, ax * sz, out=out[1])
    np.subtract(ax * sy, ay * sx, out=out[2])


def _rotation(u: float, v: float, w: float) -> NDArray[np.float64]:
    """Proper rotation that equals exp((u, v, w)×) to third order, shape (3, 3).

    The Cayley map costs no sine and no cosine, and Newton does not see the difference.
    """
    u, v, w = 0.5 * u, 0.5 * v, 0.5 * w
    c = 2.0 / (1.0 + u * u + v * v + w * w)
    k = c - 1.0
    return np.array(
        (
            (k + c * u * u, c * (u * v - w), c * (u * w + v)),
            (c * (u * v + w), k + c * v * v, c * (v * w - u)),
            (c * (u * w - v), c * (v * w + u), k + c * w * w),
        )
    )


def _rotations(
    u: NDArray[np.float64], v: NDArray[np.float64], w: NDArray[np.float64]
) -> NDArray[np.float64]:
    """`_rotation` of many vectors, each component of shape (M,); shape (3, 3, M)."""
    u, v, w = 0.5 * u, 0.5 * v, 0.5 * w
    c = 2.0 / (1.0 + u * u + v * v + w * w)
    cu, cv, cw = c * u, c * v, c * w
    out = np.empty((3, 3, len(u)))
    k, uv, uw, vw = c - 1.0, cu * v, cu * w, cv * w
    out[0, 0], out[1, 1], out[2, 2] = k + cu * u, k + cv * v, k + cw * w
    out[0, 1], out[1, 0] = uv - cw, uv + cw
    out[0, 2], out[2, 0] = uw + cv, uw - cv
    out[1, 2], out[2, 1] = vw - cu, vw + cu
    return out


def orthonormal(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations to the last bit: a matrix read from a file is orthonormal to 1e-6 only.

    Two steps of R ← R (3 I − Rᵀ R) / 2 take 1e-6 to 1e-16.
    """
    for _ in range(2):
        gram = np.swapaxes(rotations, -1, -2) @ rotations
        rotations = 1.5 * rotations - 0.5 * rotations @ gram
    return rotations
