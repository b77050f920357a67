"""The rigid path from today's pose to the target, and how many days it takes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.correction.fragment import Moving
from hexafix.errors import InputError, Refused
from hexafix.geometry import Pose, matrix_from_rotation_vector
from hexafix.hardware import Fixator

MAX_DAYS = 365
"""A schedule longer than this is a mistake in the rate or in the target."""

NO_MOTION_MM, NO_MOTION_RAD = 1e-6, 1e-8
"""Less than this is no correction at all."""


class RateRules(Protocol):
    """What `days_needed` needs to know of the case's schedule."""

    @property
    def adjustments_per_day(self) -> int:
        """How often a day the patient turns."""
        ...

    @property
    def max_rate_mm_per_day(self) -> float:
        """Limit of the fastest watched point."""
        ...

    @property
    def max_rate_rad_per_day(self) -> float:
        """Limit of the rotation."""
        ...


@dataclass(frozen=True, eq=False)
class WatchedPoints:
    """Points that move with the moving ring, in its frame.

    Attributes
    ----------
    names : tuple of str
    points_mm : ndarray, shape (P, 3)
        The points whose speed is limited, mm.
    interest_mm : ndarray, shape (Q, 3), or None
        The points where an error of rounding counts, mm; None for the middle between the rings.
    """

    names: tuple[str, ...]
    points_mm: NDArray[np.float64]
    interest_mm: NDArray[np.float64] | None = None


def watched_points(
    fixator: Fixator,
    *,
    moving: Moving,
    moving_ring: Pose,
    structures_lps_mm: ArrayLike | None = None,
    fracture_lps_mm: ArrayLike | None = None,
) -> WatchedPoints:
    """Structures at risk, or else the moving ring's centre and its six joint centres.

    Parameters
    ----------
    fixator : Fixator
    moving : {'proximal', 'distal'}
    moving_ring : Pose
        The moving ring in LPS, as the compensation left it.
    structures_lps_mm : array_like, shape (P, 3), optional
        Points of the moving fragment, LPS, mm; their speed is limited and their error counts.
    fracture_lps_mm : array_like, shape (3,), optional
        Where an error of rounding counts if there are no structures, LPS, mm; without it, the
        middle between the rings' origins, the nearest to a fracture that is known.
    """
    to_ring = moving_ring.inverse()
    if structures_lps_mm is not None:
        points = np.asarray(structures_lps_mm, float)
        if points.ndim != 2 or points.shape[1] != 3 or not np.all(np.isfinite(points)):
            raise InputError.of(
                "structures-at-risk",
                "structures at risk are finite points (x, y, z) in LPS",
                value=f"shape {points.shape}",
                where="schedule.structures_at_risk_lps_mm",
                hazard="H55",
            )
        if len(points):
            names = tuple(f"structure at risk {k}" for k in range(1, len(points) + 1))
            in_ring = to_ring.apply(points)
            return WatchedPoints(names, in_ring, in_ring)
    joints = getattr(fixator, moving).joints_mm
    names = (
        f"centre of the {moving} ring",
        *(f"joint {k} of the {moving} ring" for k in range(1, 7)),
    )
    interest = None
    if fracture_lps_mm is not None:
        interest = to_ring.apply(np.asarray(fracture_lps_mm, float)[None])
    return WatchedPoints(names, np.vstack([np.zeros(3), joints]), interest)


@dataclass(frozen=True, eq=False)
class RigidPath:
    """A screw motion at constant body twist from the start to the target.

    Attributes
    ----------
    start, target : Pose
        {A} in {B}.
    moving : {'proximal', 'distal'}
        The ring that moves; the other one rests, and speeds are measured in its frame.
    watched : WatchedPoints

    Notes
    -----
    X(s) = X_0 exp(s ξ) for s in [0, 1]. Seen from the other ring it is X(s)⁻¹, again a constant
    twist, so both fragments see the same path. Every point of the moving ring runs at constant
    speed, so a rate limit that holds for one row holds at and between all rows. The price is that
    a point leaves the straight line between its ends sideways, on a helix, by about its way
    times the rotation over 8 (`sideways_mm`); a straight line with slerp has no such excursion
    for one point, but an uneven speed for all others.
    """

    start: Pose
    target: Pose
    moving: Moving
    watched: WatchedPoints

    @cached_property
    def twist(self) -> NDArray[np.float64]:
        """ξ of {A}, shape (6,), mm and radians over the whole path."""
        return (self.start.inverse() @ self.target).log()

    @cached_property
    def moving_twist(self) -> NDArray[np.float64]:
        """Twist of the moving ring in its own frame, shape (6,), mm and radians."""
        if self.moving == "proximal":
            return self.twist
        return (self.start @ self.target.inverse()).log()

    @property
    def rotation_rad(self) -> float:
        """Rotation over the whole path, radians."""
        return float(np.linalg.norm(self.twist[3:]))

    @cached_property
    def ways_mm(self) -> NDArray[np.float64]:
        """Length of each watched point's way in the resting ring's frame, shape (P,), mm."""
        shift, turn = self.moving_twist[:3], self.moving_twist[3:]
        return np.linalg.norm(shift + np.cross(turn, self.watched.points_mm), axis=1)

    def poses(self, s: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Rotations (S, 3, 3) and positions (S, 3), mm, of {A} in {B} at path parameters s."""
        return _screw(self.start, self.twist, np.atleast_1d(np.asarray(s, float)))

    @cached_property
    def interest_mm(self) -> NDArray[np.float64]:
        """Where an error of rounding counts, in the moving ring's frame, shape (Q, 3), mm."""
        if self.watched.interest_mm is not None:
            return self.watched.interest_mm
        ring = self.start if self.moving == "proximal" else self.start.inverse()
        return 0.5 * ring.inverse().position_mm[None]

    def in_proximal(self, points_mm: NDArray[np.float64], s: ArrayLike) -> NDArray[np.float64]:
        """Points of the moving ring's frame in {A} at path parameters s, shape (S, P, 3), mm."""
        rotations, positions = self.poses(s)
        if self.moving == "proximal":
            return np.broadcast_to(points_mm, (len(rotations), *points_mm.shape))
        return (points_mm - positions[:, None, :]) @ rotations

    @cached_property
    def sideways_mm(self) -> NDArray[np.float64]:
        """Largest distance of each watched point from the line between its ends, shape (P,)."""
        rotations, positions = self.poses(np.linspace(0.0, 1.0, 65))
        points = self.watched.points_mm
        if self.moving == "proximal":
            ways = np.einsum("sij,pj->psi", rotations, points) + positions
        else:
            ways = np.einsum("sji,psj->psi", rotations, points[:, None, :] - positions)
        chord = ways[:, -1:] - ways[:, :1]
        along = chord / np.maximum(np.linalg.norm(chord, axis=-1, keepdims=True), 1e-12)
        from_start = ways - ways[:, :1]
        across = from_start - np.sum(from_start * along, axis=-1, keepdims=True) * along
        return np.linalg.norm(across, axis=-1).max(axis=1)


@dataclass(frozen=True)
class Pace:
    """How the path is spread over the days.

    Attributes
    ----------
    days : int
        Whole days; 0 if there is nothing to correct.
    ruling : str
        The point, or the rotation, that asked for so many days.
    rate_mm_per_day : float
        Speed of the fastest watched point, constant along the path.
    rate_rad_per_day : float
        Speed of the rotation.
    sideways_mm : float
        Largest distance of any watched point from the straight line between its ends.
    """

    days: int
    ruling: str
    rate_mm_per_day: float
    rate_rad_per_day: float
    sideways_mm: float


def days_needed(path: RigidPath, rules: RateRules) -> Pace:
    """The fewest whole days that keep both rate limits.

    Parameters
    ----------
    path : RigidPath
    rules : RateRules

    Raises
    ------
    InputError
        If a rate is not positive.
    Refused
        If it would take longer than `MAX_DAYS`.
    """
    for name in ("max_rate_mm_per_day", "max_rate_rad_per_day"):
        rate = getattr(rules, name)
        if not 0.0 < rate < np.inf:
            raise InputError.of(
                "rate",
                "a rate limit must be positive",
                value=f"{rate:g}",
                where=f"schedule.{name.replace('rad', 'deg')}",
                hazard="H28",
            )
    fastest = int(np.argmax(path.ways_mm))
    way, turn = float(path.ways_mm[fastest]), path.rotation_rad
    if way < NO_MOTION_MM and turn < NO_MOTION_RAD:
        return Pace(0, "nothing moves", 0.0, 0.0, 0.0)
    by_way, by_turn = way / rules.max_rate_mm_per_day, turn / rules.max_rate_rad_per_day
    ruling = path.watched.names[fastest] if by_way >= by_turn else "rotation"
    # a limit met to rounding error is met
    exact = max(by_way, by_turn) * (1.0 - 1e-12)
    if exact > MAX_DAYS:
        raise Refused.of(
            "absurd-duration",
            f"the correction would take too long; {ruling} decides",
            value=f"{exact:.0f} days for {way:.1f} mm and {np.degrees(turn):.1f} degrees",
            limit=f"{MAX_DAYS} days",
            hazard="H28",
            where="schedule",
            next_step="check the target and the rates",
        )
    days = max(1, int(np.ceil(exact)))
    return Pace(days, ruling, way / days, turn / days, float(np.max(path.sideways_mm)))


def path_parameters(days: int, adjustments_per_day: int) -> NDArray[np.float64]:
    """S of today's row and of every adjustment, shape (days × adjustments_per_day + 1,)."""
    count = days * adjustments_per_day
    return np.arange(count + 1) / max(count, 1)


def _screw(
    start: Pose, twist: NDArray[np.float64], s: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Start · exp(s twist) for all s at once."""
    shift, turn = twist[:3], twist[3:]
    angle = float(np.linalg.norm(turn))
    rotations = matrix_from_rotation_vector(s[:, None] * turn)
    if angle < 1e-9:
        moved = s[:, None] * shift
    else:
        axis = turn / angle
        along = np.dot(axis, shift) * axis
        across = (shift - along) / angle
        swept = s[:, None] * angle
        moved = (
            s[:, None] * along
            + np.sin(swept) * across
            + (1 - np.cos(swept)) * np.cross(axis, across)
        )
    return start.rotation @ rotations, moved @ start.rotation.T + start.position_mm
