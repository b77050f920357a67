"""A correction from pairs of points picked on the two fragments."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.correction.fragment import FragmentMotion, Moving
from hexafix.errors import InputError, Refused
from hexafix.geometry import Pose

MIN_SPREAD_MM = 3.0
"""Smallest RMS width of the points across their longest line; below it they are collinear: a
picking error of 1 mm would then turn the fragment about that line by 20 degrees."""

MAX_RMS_MM = 5.0
"""Largest RMS distance of the fitted pairs; more means wrongly paired points."""

MIRROR_GAIN_MM = 1.0
"""A mirrored fit that is better by this, and by half, means that a side has been mixed up."""


@dataclass(frozen=True, eq=False)
class Landmarks:
    """Pairs of points that shall come together.

    Attributes
    ----------
    moving : {'proximal', 'distal'}
    moving_points_mm : ndarray, shape (N, 3)
        Points on the moving fragment, LPS, mm, N ≥ 3, read-only.
    fixed_points_mm : ndarray, shape (N, 3)
        Where they shall go, in the same order, read-only.

    Raises
    ------
    InputError
        If there are fewer than three pairs, unequal counts or numbers that are not finite.
    """

    moving: Moving
    moving_points_mm: NDArray[np.float64]
    fixed_points_mm: NDArray[np.float64]

    def __post_init__(self) -> None:
        shapes = []
        for name in ("moving_points_mm", "fixed_points_mm"):
            points = np.array(getattr(self, name), float)
            points.setflags(write=False)
            object.__setattr__(self, name, points)
            shapes.append(points.shape)
        moving, fixed = self.moving_points_mm, self.fixed_points_mm
        if (
            shapes[0] != shapes[1]
            or moving.ndim != 2
            or moving.shape[1] != 3
            or len(moving) < 3
            or not np.all(np.isfinite(moving))
            or not np.all(np.isfinite(fixed))
        ):
            raise InputError.of(
                "landmark-pairs",
                "landmarks come in pairs of finite points, moving and fixed in the same order",
                value=f"shapes {shapes[0]} and {shapes[1]}",
                limit="at least 3 pairs of (x, y, z)",
                where="correction",
                hazard="H55",
                next_step="pick at least three pairs that are not in one line",
            )


@dataclass(frozen=True, eq=False)
class LandmarkFit:
    """The rigid motion that brings the landmarks together.

    Attributes
    ----------
    motion : FragmentMotion
    rms_mm : float
        RMS distance that remains between the pairs.
    residuals_mm : ndarray, shape (N,)
        Distance that remains between each pair.
    """

    motion: FragmentMotion
    rms_mm: float
    residuals_mm: NDArray[np.float64]


def fit_landmarks(landmarks: Landmarks) -> LandmarkFit:
    """Least-squares rigid motion of the moving points onto the fixed ones.

    Raises
    ------
    InputError
        If the points of one side are collinear, so that the turn about their line is open.
    Refused
        If only a mirrored fit would match, or the pairs do not match at all.
    """
    moving, fixed = landmarks.moving_points_mm, landmarks.fixed_points_mm
    for name, points in (("moving", moving), ("fixed", fixed)):
        _refuse_collinear(name, points)
    a, b = moving - moving.mean(axis=0), fixed - fixed.mean(axis=0)
    u, _, vt = np.linalg.svd(b.T @ a)
    handed = float(np.sign(np.linalg.det(u @ vt)))
    rotation = u @ np.diag([1.0, 1.0, handed]) @ vt
    rest = np.linalg.norm(b - a @ rotation.T, axis=1)
    rms = float(np.sqrt(np.mean(rest**2)))
    if handed < 0:
        mirrored = float(np.sqrt(np.mean(np.sum((b - a @ (u @ vt).T) ** 2, axis=1))))
        if rms - mirrored > MIRROR_GAIN_MM and mirrored < 0.5 * rms:
            raise Refused.of(
                "landmarks-mirrored",
                "the landmarks match as mirror images only: sides or names are mixed up",
                value=f"RMS {rms:.2f} mm as they are, {mirrored:.2f} mm mirrored",
                limit=f"mirrored fit better by less than {MIRROR_GAIN_MM:g} mm",
                where="correction",
                hazard="H01",
                next_step="check the pairing, and the side if they come from the other limb",
            )
    if rms > MAX_RMS_MM:
        raise Refused.of(
            "landmarks-disagree",
            "the landmark pairs do not fit together as a rigid body",
            value=f"RMS {rms:.2f} mm, worst pair {int(np.argmax(rest)) + 1}",
            limit=f"{MAX_RMS_MM:g} mm",
            where="correction",
            hazard="H33",
            next_step="check the order of the pairs and pick the worst one again",
        )
    pose = Pose(rotation, fixed.mean(axis=0) - rotation @ moving.mean(axis=0))
    return LandmarkFit(FragmentMotion(landmarks.moving, pose), rms, rest)


def _refuse_collinear(name: str, points: NDArray[np.float64]) -> None:
    centred = points - points.mean(axis=0)
    spread = float(np.linalg.svd(centred, compute_uv=False)[1] / np.sqrt(len(centred)))
    if spread < MIN_SPREAD_MM:
        raise InputError.of(
            "landmarks-collinear",
            "the landmarks lie in one line, the turn about it is open",
            value=f"RMS width {spread:.2f} mm",
            limit=f"at least {MIN_SPREAD_MM:g} mm",
            where=f"correction.{name}_points_lps_mm",
            hazard="H16",
            next_step="pick a further landmark away from that line",
        )
