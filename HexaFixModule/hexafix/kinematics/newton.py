"""Newton's method on the strut lengths, for one pose and for many.

Both work in {B} on rows of numbers (component, strut) rather than on objects: half of the time of
a single solution would else go into the overhead of small arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.geometry import Pose
from hexafix.hardware import Fixator

TOLERANCE_MM = 1e-11
"""Newton has arrived when every strut length agrees to this."""

MAX_ITERATIONS = 30
"""Newton from a recognised pose needs 3 to 5."""

STEP_LIMIT_MM, STEP_LIMIT_RAD = 60.0, 0.6
"""Longest Newton step; keeps a bad linearisation from leaping to another assembly mode."""

_CHUNK = 512  # rows solved together, so that their arrays stay in the cache


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
        try:
            step = np.linalg.solve(columns.T, missing)
        except np.linalg.LinAlgError:
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
    r = np.array(np.broadcast_to(np.asarray(start_rotations, float), (m, 3, 3)))
    r = np.ascontiguousarray(np.moveaxis(orthonormal(r), 0, -1))
    p = np.array(np.broadcast_to(np.asarray(start_positions, float), (m, 3)).T)
    q = np.ascontiguousarray(lengths_mm.T)
    iterations, residual = np.zeros(m, np.int64), np.full(m, np.inf)
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
    for iteration in range(MAX_ITERATIONS + 1):
        m = len(active)
        # arms[i, l] = Σ_j r[i, j] a[l, j]
        arms = np.stack([(a @ r[i].reshape(3, m)) for i in range(3)])
        vectors = arms + (p[:, None, :] - b)
        lengths = np.sqrt((vectors * vectors).sum(axis=0))
        missing = q - lengths
        worst = np.abs(missing).max(axis=0)
        rotations[..., active], positions[:, active] = r, p
        residual[active], iterations[active] = worst, iteration
        going = (worst > TOLERANCE_MM) & np.isfinite(worst)
        if iteration == MAX_ITERATIONS or not going.any():
            return
        if not going.all():
            active, q, r, p = active[going], q[:, going], r[..., going], p[:, going]
            arms, vectors = arms[..., going], vectors[..., going]
            lengths, missing = lengths[:, going], missing[:, going]
        columns = np.empty((6, 6, len(active)))
        columns[:3] = vectors / lengths
        _moments(arms, columns[:3], out=columns[3:])
        step = _solve_systems(columns, missing)
        p = p + step[:3]
        r = np.einsum("ijm,jkm->ikm", np.moveaxis(rotations_of(step[3:].T), 0, -1), r)


def _solve_systems(
    columns: NDArray[np.float64], missing: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Newton steps (6, m) of transposed Jacobians (6, 6, m), limited in length."""
    jacobians = np.ascontiguousarray(columns.transpose(2, 1, 0))
    right = np.ascontiguousarray(missing.T)[..., None]
    try:
        step = np.linalg.solve(jacobians, right)[..., 0].T
    except np.linalg.LinAlgError:  # one singular row must not stop the others
        step = (np.linalg.pinv(jacobians) @ right)[..., 0].T
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
    """Rotation matrix of the rotation vector (u, v, w), radians."""
    angle = sqrt(u * u + v * v + w * w)
    s = sin(angle) / angle if angle > 1e-8 else 1.0
    c = 2.0 * (sin(angle / 2) / angle) ** 2 if angle > 1e-8 else 0.5
    k = cos(angle)
    return np.array(
        (
            (k + c * u * u, c * u * v - s * w, c * u * w + s * v),
            (c * u * v + s * w, k + c * v * v, c * v * w - s * u),
            (c * u * w - s * v, c * v * w + s * u, k + c * w * w),
        )
    )


def rotations_of(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices, shape (M, 3, 3), of rotation vectors, shape (M, 3), radians."""
    u, v, w = vectors.T
    angle = np.sqrt(u * u + v * v + w * w)
    s = np.sinc(angle / np.pi)
    c = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    k = np.cos(angle)
    out = np.empty((len(vectors), 3, 3))
    out[:, 0, 0], out[:, 1, 1], out[:, 2, 2] = k + c * u * u, k + c * v * v, k + c * w * w
    out[:, 0, 1], out[:, 1, 0] = c * u * v - s * w, c * u * v + s * w
    out[:, 0, 2], out[:, 2, 0] = c * u * w + s * v, c * u * w - s * v
    out[:, 1, 2], out[:, 2, 1] = c * v * w - s * u, c * v * w + s * u
    return out


def orthonormal(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations to the last bit: a matrix read from a file is orthonormal to 1e-6 only.

    Two steps of R ← R (3 I − Rᵀ R) / 2 take 1e-6 to 1e-16.
    """
    for _ in range(2):
        gram = np.swapaxes(rotations, -1, -2) @ rotations
        rotations = 1.5 * rotations - 0.5 * rotations @ gram
    return rotations
