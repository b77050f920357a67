"""Mechanism poses from strut lengths: HexaFix beside a general least-squares solver."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.benchmark.comparison_race import Raced, Tool
from hexafix.benchmark.kinematics import HEIGHT_MM, random_poses
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, shipped_fixator
from hexafix.kinematics import forward_kinematics, forward_kinematics_batch, strut_lengths_batch

Array = NDArray[np.float64]

WARM_MM, WARM_DEG = 1.0, 0.5
"""A warm start lies so far from the solution along, and about, each axis at most."""


def write_data(folder: Path, *, quick: bool, seed: int) -> dict[str, Any]:
    """Draw poses, their strut lengths and starts into a folder; return the settings."""
    count = 40 if quick else 400
    rotations, positions = random_poses(count, seed)
    rng = np.random.default_rng([seed, 1])
    turns = np.radians(rng.uniform(-WARM_DEG, WARM_DEG, (count, 3)))
    shifts = rng.uniform(-WARM_MM, WARM_MM, (count, 3))
    warm = [
        Pose(r, p) @ Pose.from_xyz_fixed(position_mm=s, angles_rad=t)
        for r, p, s, t in zip(rotations, positions, shifts, turns, strict=True)
    ]
    np.savez(
        folder / "poses.npz",
        rotations=rotations,
        positions=positions,
        lengths=strut_lengths_batch(
            rotations=rotations, positions_mm=positions, fixator=shipped_fixator()
        ),
        warm_rotations=np.array([pose.rotation for pose in warm]),
        warm_positions=np.array([pose.position_mm for pose in warm]),
    )
    return {"poses": count, "warm_mm": WARM_MM, "warm_deg": WARM_DEG}


def judge(raced: dict[str, Raced], folder: Path) -> dict[str, list[dict[str, Any]]]:
    """Largest and RMS errors of the poses each tool found."""
    truth = np.load(folder / "poses.npz")
    return {
        name: [{"case": "all poses", **pose_errors(one.result, truth)}]
        for name, one in raced.items()
    }


def pose_errors(found: Array, truth: Any) -> dict[str, Any]:
    """Errors of poses, shape (n, 12): rotation row by row, then position, mm."""
    turn = np.linalg.norm(found[:, :9].reshape(-1, 3, 3) - truth["rotations"], axis=(1, 2))
    away = np.linalg.norm(found[:, 9:] - truth["positions"], axis=1)
    return {
        "poses": len(found),
        "wrong": int(np.sum(away > 1e-3)),
        "largest_mm": float(away.max()),
        "largest_deg": float(np.degrees(turn.max() / np.sqrt(2.0))),
    }


def _prepare(*, warm: bool) -> Callable[[Path], Any]:
    def prepare(folder: Path) -> tuple[Fixator, Array, Array, Array]:
        with np.load(folder / "poses.npz") as data:
            lengths = data["lengths"]
            if warm:
                return shipped_fixator(), lengths, data["warm_rotations"], data["warm_positions"]
        neutral = np.broadcast_to(np.eye(3), (len(lengths), 3, 3))
        height = np.tile([0.0, 0.0, HEIGHT_MM], (len(lengths), 1))
        return shipped_fixator(), lengths, neutral, height

    return prepare


def _one_by_one(held: tuple[Fixator, Array, Array, Array]) -> Array:
    fixator, lengths, rotations, positions = held
    found = []
    for q, rotation, position in zip(lengths, rotations, positions, strict=True):
        pose = forward_kinematics(q, fixator, start=Pose(rotation, position)).pose
        found.append(np.append(pose.rotation.ravel(), pose.position_mm))
    return np.array(found)


def _together(held: tuple[Fixator, Array, Array, Array]) -> Array:
    fixator, lengths, rotations, positions = held
    batch = forward_kinematics_batch(
        lengths, fixator, start_rotations=rotations, start_positions=positions
    )
    return np.concatenate([batch.rotations.reshape(-1, 9), batch.positions_mm], axis=1)


def _by_least_squares(held: tuple[Fixator, Array, Array, Array]) -> Array:
    """Eq. (30) in three positions and a rotation vector, Levenberg-Marquardt, pose by pose."""
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    fixator, lengths, rotations, positions = held
    a, b = fixator.proximal.joints_mm, fixator.distal.joints_mm
    found = []
    for q, rotation, position in zip(lengths, rotations, positions, strict=True):

        def residual(x: Array, q: Array = q) -> Array:
            vectors = a @ Rotation.from_rotvec(x[3:]).as_matrix().T + x[:3] - b
            return np.sqrt(np.sum(vectors * vectors, axis=1)) - q

        start = np.append(position, Rotation.from_matrix(rotation).as_rotvec())
        x = least_squares(residual, start, method="lm").x
        found.append(np.append(Rotation.from_rotvec(x[3:]).as_matrix().ravel(), x[:3]))
    return np.array(found)


def _tool(
    name: str, words: str, run: Callable[[Any], Array], against: str, *, warm: bool = False
) -> Tool:
    scipy = (("scipy", "scipy"),) if run is _by_least_squares else ()
    return Tool(name, words, against, run, np.asarray, _prepare(warm=warm), scipy)


TOOLS = (
    _tool("hexafix", "HexaFix: forward_kinematics, cold", _one_by_one, "hexafix"),
    _tool("least-squares", "scipy least_squares, cold", _by_least_squares, "hexafix"),
    _tool("hexafix-batch", "HexaFix: forward_kinematics_batch, cold", _together, "hexafix"),
    _tool(
        "hexafix-warm", "HexaFix: forward_kinematics, warm", _one_by_one, "hexafix-warm", warm=True
    ),
    _tool(
        "least-squares-warm",
        "scipy least_squares, warm",
        _by_least_squares,
        "hexafix-warm",
        warm=True,
    ),
)
"""Cold starts at the neutral pose, warm ones next to the solution."""
