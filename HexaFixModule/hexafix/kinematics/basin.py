"""Proof that other starts lead forward kinematics to the same pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from hexafix.geometry import Pose, matrix_from_rotation_vector
from hexafix.hardware import Fixator
from hexafix.kinematics.newton import solve_rows

SPREAD_MM, SPREAD_RAD = 15.0, float(np.radians(10.0))
"""How far the second starts lie from the solution: ten times the largest error that the gate on
the difference between CT and struts lets through (1.5 mm, 1 degree)."""

AGREE_MM, AGREE_RAD = 1e-6, 1e-8
"""Second starts agree when they end within this of the solution."""


@dataclass(frozen=True)
class BasinCheck:
    """Whether perturbed starts agree with a forward solution.

    Attributes
    ----------
    agree : bool
        Every start arrived, at the same pose.
    worst_mm, worst_deg : float
        Largest distance and angle of an arrived pose from the solution.
    count : int
        Starts tried.
    not_arrived : int
        Starts from which Newton did not arrive.
    elsewhere : int
        Starts that arrived at another assembly mode.
    """

    agree: bool
    worst_mm: float
    worst_deg: float
    count: int
    not_arrived: int
    elsewhere: int


def second_starts(
    lengths_mm: ArrayLike, fixator: Fixator, *, solution: Pose, count: int = 20, seed: int = 0
) -> BasinCheck:
    """Solve again from perturbed starts and compare (gate G8, hazard H30).

    Parameters
    ----------
    lengths_mm : array_like, shape (6,)
        Strut lengths, mm.
    fixator : Fixator
    solution : Pose
        The forward solution, {A} in {B}.
    count : int
        Number of starts; they lie on the surface of a ball of `SPREAD_MM` and `SPREAD_RAD`.
    seed : int
        Of the starts' directions.
    """
    rng = np.random.default_rng(seed)
    shifts, turns = rng.normal(size=(2, count, 3))
    shifts *= SPREAD_MM / np.linalg.norm(shifts, axis=1, keepdims=True)
    turns *= SPREAD_RAD / np.linalg.norm(turns, axis=1, keepdims=True)
    lengths = np.broadcast_to(np.asarray(lengths_mm, float), (count, 6))
    batch = solve_rows(
        lengths,
        fixator,
        start_rotations=solution.rotation @ matrix_from_rotation_vector(turns),
        start_positions=solution.position_mm + shifts,
    )
    arrived = batch.arrived
    distance = np.linalg.norm(batch.positions_mm - solution.position_mm, axis=1)
    chord = np.linalg.norm(batch.rotations - solution.rotation, axis=(1, 2)) / np.sqrt(8.0)
    angle = 2.0 * np.arcsin(np.minimum(chord, 1.0))
    elsewhere = arrived & ((distance > AGREE_MM) | (angle > AGREE_RAD))
    return BasinCheck(
        agree=bool(arrived.all() and not elsewhere.any()),
        worst_mm=float(distance[arrived].max(initial=0.0)),
        worst_deg=float(np.degrees(angle[arrived].max(initial=0.0))),
        count=count,
        not_arrived=int(count - arrived.sum()),
        elsewhere=int(elsewhere.sum()),
    )
