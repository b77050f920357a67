"""Is the ring pose exact on exact centres: random layouts, heights unequal, γ all around."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexafix.errors import LayoutRejected
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.recognition import ring_pose, ring_pose_by_groups
from hexafix.recognition.groups import marker_groups

LIMIT = 1e-9
"""Largest error in mm and in radians."""

MARKERS = (3, 8)
"""Fewest and most markers of a random ring."""


def random_layout(rng: np.random.Generator) -> MarkerLayout:
    """A layout of random count, radii, angles and heights that holds a pose."""
    while True:
        count = int(rng.integers(MARKERS[0], MARKERS[1] + 1))
        layout = MarkerLayout.of(
            radius_mm=rng.uniform(60.0, 140.0, count),
            sweep_deg=rng.uniform(-180.0, 360.0, count),
            height_mm=rng.uniform(-40.0, 60.0, count),
        )
        try:
            marker_groups(layout)
        except LayoutRejected:
            continue
        return layout


def random_pose(rng: np.random.Generator) -> Pose:
    """A ring pose anywhere in a scan, γ over the full circle, α and β to ±80°."""
    angles = np.radians([*rng.uniform(-80.0, 80.0, 2), rng.uniform(-180.0, 180.0)])
    return Pose.from_xyz_fixed(position_mm=rng.uniform(-500.0, 500.0, 3), angles_rad=angles)


def exactness(layouts: int = 1000, seed: int = 0) -> dict[str, Any]:
    """Largest errors of both methods over random layouts and poses.

    Returns
    -------
    dict
        ``layouts``, for each method ``position_mm``, ``rotation_rad`` and ``angles_rad``,
        ``limit`` and ``passed``.
    """
    rng = np.random.default_rng(seed)
    worst = {"least_squares": np.zeros(3), "groups": np.zeros(3)}
    for _ in range(layouts):
        layout, truth = random_layout(rng), random_pose(rng)
        centers = truth.apply(layout.points_mm)
        for name, method in (("least_squares", ring_pose), ("groups", ring_pose_by_groups)):
            pose = method(centers, layout).pose
            turn = np.abs(pose.angles_rad - truth.angles_rad)
            angles = np.minimum(turn, 2 * np.pi - turn).max()
            worst[name] = np.maximum(worst[name], [*pose.difference(truth), angles])
    keys = ("position_mm", "rotation_rad", "angles_rad")
    return {
        "layouts": layouts,
        **{n: dict(zip(keys, map(float, v), strict=True)) for n, v in worst.items()},
        "limit": LIMIT,
        "passed": bool(max(v.max() for v in worst.values()) <= LIMIT),
    }
