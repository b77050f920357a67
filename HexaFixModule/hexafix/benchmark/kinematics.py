"""How fast and how exact the forward kinematics is."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from hexafix.geometry import Pose, matrix_from_xyz_fixed
from hexafix.hardware import Fixator
from hexafix.kinematics import (
    forward_kinematics,
    forward_kinematics_batch,
    strut_lengths,
    strut_lengths_batch,
)

SINGLE_LIMIT_US, BATCH_LIMIT_US = 300.0, 5.0
"""Longest time for one solution alone and in a batch, microseconds."""

ROUND_TRIP_LIMIT_MM = 1e-9
"""Largest error of a pose that went through strut lengths and back."""

SHIFT_MM, TURN_DEG, HEIGHT_MM = 30.0, 20.0, 185.0
"""Random poses lie within this of the neutral one, which is every start."""

REPEATS = 7
"""Timings are the best of so many in processor time: other programs disturb them little."""


def speed(
    fixator: Fixator, *, batch: int = 10_000, singles: int = 300, seed: int = 0
) -> dict[str, Any]:
    """Time of forward kinematics, alone and in a batch, against a general solver in one run.

    Parameters
    ----------
    fixator : Fixator
    batch, singles : int
        Sets of strut lengths solved together, and one by one.
    seed : int

    Returns
    -------
    dict
        ``single_us``, ``batch_us``, ``least_squares_us``, ``single_ratio`` and ``batch_ratio``
        (against `scipy.optimize.least_squares`), ``iterations_mean``, ``passed``.
    """
    rotations, positions = random_poses(batch, seed)
    lengths = strut_lengths_batch(rotations=rotations, positions_mm=positions, fixator=fixator)
    neutral = Pose(np.eye(3), np.array([0.0, 0.0, HEIGHT_MM]))

    def alone() -> None:
        for q in lengths[:singles]:
            forward_kinematics(q, fixator, start=neutral)

    def together() -> None:
        forward_kinematics_batch(
            lengths, fixator, start_rotations=neutral.rotation, start_positions=neutral.position_mm
        )

    def general() -> None:
        for q in lengths[: max(singles // 30, 3)]:
            _by_least_squares(q, fixator)

    single = _best_us(alone) / singles
    each = _best_us(together) / batch
    other = _best_us(general) / max(singles // 30, 3)
    solved = forward_kinematics_batch(
        lengths, fixator, start_rotations=neutral.rotation, start_positions=neutral.position_mm
    )
    return {
        "single_us": single,
        "batch_us": each,
        "least_squares_us": other,
        "single_ratio": single / other,
        "batch_ratio": each / other,
        "iterations_mean": float(solved.iterations.mean()),
        "single_limit_us": SINGLE_LIMIT_US,
        "batch_limit_us": BATCH_LIMIT_US,
        "passed": single <= SINGLE_LIMIT_US and each <= BATCH_LIMIT_US,
    }


def round_trip(fixator: Fixator, *, poses: int = 10_000, seed: int = 1) -> dict[str, Any]:
    """Largest error of poses that went through strut lengths and back.

    Returns
    -------
    dict
        ``position_mm`` and ``rotation_rad`` in a batch, ``single_mm`` one by one over a
        hundredth of the poses, ``limit_mm``, ``passed``.
    """
    rotations, positions = random_poses(poses, seed)
    lengths = strut_lengths_batch(rotations=rotations, positions_mm=positions, fixator=fixator)
    neutral = Pose(np.eye(3), np.array([0.0, 0.0, HEIGHT_MM]))
    found = forward_kinematics_batch(
        lengths, fixator, start_rotations=neutral.rotation, start_positions=neutral.position_mm
    )
    apart = np.linalg.norm(found.positions_mm - positions, axis=1)
    single = max(
        Pose(rotations[k], positions[k]).difference(
            forward_kinematics(lengths[k], fixator, start=neutral).pose
        )[0]
        for k in range(0, poses, 100)
    )
    turned = np.linalg.norm(found.rotations - rotations, axis=(1, 2)) / np.sqrt(2.0)
    worst = max(float(apart.max()), single)
    return {
        "position_mm": float(apart.max()),
        "rotation_rad": float(turned.max()),
        "single_mm": single,
        "limit_mm": ROUND_TRIP_LIMIT_MM,
        "passed": worst <= ROUND_TRIP_LIMIT_MM,
    }


def random_poses(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Rotations (count, 3, 3) and positions (count, 3), mm, about the neutral pose."""
    rng = np.random.default_rng(seed)
    angles = np.radians(rng.uniform(-TURN_DEG, TURN_DEG, (count, 3)))
    shifts = rng.uniform(-SHIFT_MM, SHIFT_MM, (count, 3))
    return matrix_from_xyz_fixed(angles), np.add(shifts, (0.0, 0.0, HEIGHT_MM))


def _by_least_squares(lengths_mm: np.ndarray, fixator: Fixator) -> None:
    """Eq. (30) in pose vectors, as a general solver does it."""

    def residual(x: np.ndarray) -> np.ndarray:
        pose = Pose.from_xyz_fixed(position_mm=x[:3], angles_rad=x[3:])
        return strut_lengths(pose, fixator) - lengths_mm

    least_squares(residual, [0.0, 0.0, HEIGHT_MM, 0.0, 0.0, 0.0], method="lm")


def _best_us(work: Callable[[], None]) -> float:
    """Shortest processor time of `REPEATS` runs, microseconds."""
    times = []
    for _ in range(REPEATS):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return 1e6 * min(times)
