"""Forward kinematics of the 6-SPS mechanism: Newton with a twist update from a known pose."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import Fault, ForwardKinematicsDiverged, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Fixator
from hexafix.kinematics.inverse import (
    condition_number,
    joint_radius_mm,
    strut_jacobian,
    strut_vectors,
)

TOLERANCE_MM = 1e-11
"""Newton has arrived when every strut length agrees to this."""

MAX_ITERATIONS = 30
"""Newton from a recognised pose needs 3 to 5."""

MAX_CONDITION = 40.0
"""Scaled condition number above which a pose is too close to a singularity to be trusted.

Ten times that of a usual pose; at 40 a start 15 mm or 10 degrees away already leads elsewhere.
"""

STEP_LIMIT_MM, STEP_LIMIT_RAD = 60.0, 0.6
"""Longest Newton step; keeps a bad linearisation from leaping to another assembly mode."""

_CHUNK = 1024  # rows solved together, so that their arrays stay in the cache


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


@dataclass(frozen=True, eq=False)
class ForwardBatch:
    """Mechanism poses from many sets of strut lengths.

    Attributes
    ----------
    rotations : ndarray, shape (M, 3, 3)
    positions_mm : ndarray, shape (M, 3)
    iterations : ndarray of int, shape (M,)
    residual_mm : ndarray, shape (M,)
    """

    rotations: NDArray[np.float64]
    positions_mm: NDArray[np.float64]
    iterations: NDArray[np.int64]
    residual_mm: NDArray[np.float64]


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
    r, p, iterations, residual = _newton(q, fixator, start)
    if not residual <= TOLERANCE_MM:
        raise _diverged(residual, iterations)
    pose = Pose(r, p)
    condition = float(
        condition_number(strut_jacobian(pose, fixator), length_mm=joint_radius_mm(fixator))
    )
    if not condition <= MAX_CONDITION:
        raise ForwardKinematicsDiverged.of(
            "near-singular",
            "the mechanism is next to a singular pose, where the struts do not settle its pose",
            value=f"condition number {condition:.3g}",
            limit=f"{MAX_CONDITION:g}",
            hazard="H31",
            next_step="check the strut readings and the fixator definition",
        )
    return ForwardSolution(pose, iterations, residual, condition)


def forward_kinematics_batch(
    lengths_mm: ArrayLike,
    fixator: Fixator,
    *,
    start_rotations: ArrayLike,
    start_positions: ArrayLike,
) -> ForwardBatch:
    """`forward_kinematics` of many sets of lengths at once.

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
    ForwardKinematicsDiverged
        If any row does not arrive; names how many and the first.
    """
    q = np.asarray(lengths_mm, float)
    q = _checked_lengths(q, (len(q), 6))
    batch = _solve_rows(q, fixator, start_rotations, start_positions)
    failed = np.flatnonzero(~(batch.residual_mm <= TOLERANCE_MM))
    if len(failed):
        first = int(failed[0])
        raise _diverged(
            float(batch.residual_mm[first]),
            int(batch.iterations[first]),
            where=f"row {first} ({len(failed)} of {len(q)} rows)",
        )
    return batch


def _solve_rows(
    q: NDArray[np.float64], fixator: Fixator, rotations: ArrayLike, positions: ArrayLike
) -> ForwardBatch:
    """Newton on all rows, chunk by chunk; rows that fail keep their large residual."""
    m = len(q)
    r = np.array(np.broadcast_to(np.asarray(rotations, float), (m, 3, 3)))
    p = np.array(np.broadcast_to(np.asarray(positions, float), (m, 3)))
    iterations = np.zeros(m, np.int64)
    residual = np.full(m, np.inf)
    for first in range(0, m, _CHUNK):
        rows = slice(first, min(first + _CHUNK, m))
        r[rows] = _orthonormal(r[rows])
        _newton_rows(q[rows], fixator, r[rows], p[rows], iterations[rows], residual[rows])
    return ForwardBatch(r, p, iterations, residual)


def _newton(
    q: NDArray[np.float64], fixator: Fixator, start: Pose
) -> tuple[NDArray[np.float64], NDArray[np.float64], int, float]:
    """Newton on one set of lengths; written for little overhead, not for beauty."""
    a, b = fixator.proximal.joints_mm, fixator.distal.joints_mm
    r, p = _orthonormal(start.rotation), start.position_mm
    jacobian = np.empty((6, 6))
    worst = np.inf
    for iteration in range(MAX_ITERATIONS + 1):
        arms = a @ r.T
        vectors = arms + (p - b)
        lengths = np.sqrt(np.einsum("ij,ij->i", vectors, vectors))
        residual = q - lengths
        worst = float(np.abs(residual).max())
        if worst <= TOLERANCE_MM or not worst < np.inf or iteration == MAX_ITERATIONS:
            return r, p, iteration, worst
        s = vectors / lengths[:, None]
        jacobian[:, :3] = s
        jacobian[:, 3] = arms[:, 1] * s[:, 2] - arms[:, 2] * s[:, 1]
        jacobian[:, 4] = arms[:, 2] * s[:, 0] - arms[:, 0] * s[:, 2]
        jacobian[:, 5] = arms[:, 0] * s[:, 1] - arms[:, 1] * s[:, 0]
        try:
            step = np.linalg.solve(jacobian, residual)
        except np.linalg.LinAlgError:
            return r, p, iteration, worst
        x, y, z, u, v, w = step.tolist()
        shift, angle = sqrt(x * x + y * y + z * z), sqrt(u * u + v * v + w * w)
        excess = max(shift / STEP_LIMIT_MM, angle / STEP_LIMIT_RAD, 1.0)
        p = p + step[:3] / excess
        r = _rotation(u / excess, v / excess, w / excess, angle / excess) @ r
    raise AssertionError("unreachable")


def _rotation(u: float, v: float, w: float, angle: float) -> NDArray[np.float64]:
    """Rotation matrix of the rotation vector (u, v, w), radians."""
    if angle < 1e-8:
        s, c = 1.0, 0.5
    else:
        s, c = sin(angle) / angle, 2.0 * (sin(angle / 2) / angle) ** 2
    k = cos(angle)
    return np.array(
        (
            (k + c * u * u, c * u * v - s * w, c * u * w + s * v),
            (c * u * v + s * w, k + c * v * v, c * v * w - s * u),
            (c * u * w - s * v, c * v * w + s * u, k + c * w * w),
        )
    )


def _newton_rows(
    q: NDArray[np.float64],
    fixator: Fixator,
    r: NDArray[np.float64],
    p: NDArray[np.float64],
    iterations: NDArray[np.int64],
    residual: NDArray[np.float64],
) -> None:
    """Newton on many rows in place; rows that have arrived leave the work."""
    a = fixator.proximal.joints_mm
    active = np.arange(len(q))
    for _ in range(MAX_ITERATIONS + 1):
        ra, pa = r[active], p[active]
        vectors = strut_vectors(rotations=ra, positions_mm=pa, fixator=fixator)
        lengths = np.sqrt(np.einsum("mij,mij->mi", vectors, vectors))
        missing = q[active] - lengths
        residual[active] = worst = np.abs(missing).max(axis=1)
        going = (worst > TOLERANCE_MM) & np.isfinite(worst)
        if not going.any() or iterations.max() >= MAX_ITERATIONS:
            return
        if not going.all():
            active, ra, pa = active[going], ra[going], pa[going]
            vectors, lengths, missing = vectors[going], lengths[going], missing[going]
        s = vectors / lengths[..., None]
        arms = a @ np.swapaxes(ra, 1, 2)
        jacobian = np.empty((len(active), 6, 6))
        jacobian[:, :, :3] = s
        jacobian[:, :, 3] = arms[..., 1] * s[..., 2] - arms[..., 2] * s[..., 1]
        jacobian[:, :, 4] = arms[..., 2] * s[..., 0] - arms[..., 0] * s[..., 2]
        jacobian[:, :, 5] = arms[..., 0] * s[..., 1] - arms[..., 1] * s[..., 0]
        try:
            step = np.linalg.solve(jacobian, missing[..., None])[..., 0]
        except np.linalg.LinAlgError:  # one singular row must not stop the others
            step = (np.linalg.pinv(jacobian) @ missing[..., None])[..., 0]
        shift = np.sqrt((step[:, :3] ** 2).sum(axis=1))
        angle = np.sqrt((step[:, 3:] ** 2).sum(axis=1))
        step /= np.maximum(np.maximum(shift / STEP_LIMIT_MM, angle / STEP_LIMIT_RAD), 1.0)[:, None]
        p[active] = pa + step[:, :3]
        r[active] = _rotations(step[:, 3:]) @ ra
        iterations[active] += 1


def _rotations(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation matrices of rotation vectors, shape (M, 3), radians."""
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


def _orthonormal(rotations: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotations to the last bit: a matrix read from a file is orthonormal to 1e-6 only.

    Two steps of R ← R (3 I − Rᵀ R) / 2 take 1e-6 to 1e-16.
    """
    for _ in range(2):
        rotations = 1.5 * rotations - 0.5 * rotations @ (np.swapaxes(rotations, -1, -2) @ rotations)
    return rotations


def _checked_lengths(lengths_mm: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    q = np.asarray(lengths_mm, float)
    if q.shape != shape or not np.all(np.isfinite(q)) or np.any(q <= 0):
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
