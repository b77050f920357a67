"""How exact N = 3 can be when only the installation errs: the floor under Table 1."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.recognition import mechanism_pose, ring_pose
from hexafix.study.experiment_trial import four_balls

Array = NDArray[np.float64]

DISTANCES_MM = (120.0, 140.0, 155.0, 170.0, 190.0)
"""Distances of the rings in the CT that the floor is told for."""

SAMPLES = 200_000
"""Normal numbers for the mean length of a vector of known covariance: exact to 0.2 %."""

SHARP_MM2 = 1e-12
"""Covariance of a ball centre without image error."""


@cache
def installation_floor(distance_mm: float) -> tuple[float, float]:
    """Mean volume errors of the mechanism's pose, straight rings, mm and radians.

    Notes
    -----
    Source: Eq. (4), (28). The distal ring's tilt moves the far ring's origin, so the floor grows
    with the distance.
    """
    rings = []
    for ring in (0, 1):
        layout = MarkerLayout(four_balls(ring).sites[:3])
        pose = Pose(np.eye(3), np.array([0.0, 0.0, (1 - ring) * distance_mm]))
        sharp = np.tile(SHARP_MM2 * np.eye(3), (3, 1, 1))
        rings.append(ring_pose(pose.apply(layout.points_mm), layout, covariances_mm2=sharp))
    covariance = mechanism_pose(proximal=rings[0], distal=rings[1]).covariance
    drawn = np.random.default_rng(0).normal(size=(SAMPLES, 6)) @ np.linalg.cholesky(covariance).T
    return (
        float(np.linalg.norm(drawn[:, :3], axis=1).mean()),
        float(np.linalg.norm(drawn[:, 3:], axis=1).mean()),
    )


def floor_document() -> list[dict[str, Any]]:
    """The floor at several distances of the rings."""
    found = []
    for distance in DISTANCES_MM:
        mm, rad = installation_floor(distance)
        found.append(
            {
                "ring_distance_mm": distance,
                "volume_mean_mm": mm,
                "volume_mean_deg": float(np.degrees(rad)),
            }
        )
    return found
