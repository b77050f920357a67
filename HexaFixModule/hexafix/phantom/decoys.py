"""Things that are no marker balls of this frame but may be taken for one."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexafix.geometry import Pose
from hexafix.phantom.balls import ExactBall
from hexafix.phantom.hardware import JOINT_RADIUS_MM
from hexafix.phantom.scene import Scene
from hexafix.phantom.solids import Solid, ellipsoid, half_ball, hex_prism, slab_box
from hexafix.phantom.spec import ALUMINIUM_HU, STEEL_HU, PhantomSpec

SMALL_BALL_SHARE = 0.7
"""Diameter of the ball of another size, in marker diameters."""


def decoys_of(
    spec: PhantomSpec, scene: Scene
) -> tuple[list[Solid], list[ExactBall], list[dict[str, Any]]]:
    """Loose decoys to paint, balls of another size, and the list of all decoys for the truth."""
    listed = [
        {"kind": "ball-joint", "center_mm": center.tolist(), "diameter_mm": 2 * JOINT_RADIUS_MM}
        for center in (*scene.joints_b_mm, *scene.joints_a_mm)
    ]
    if not spec.decoys:
        return [], [], listed
    ring = scene.ring_b @ Pose(np.eye(3), np.array([0.0, 0.0, 0.5]))
    half_way = 0.5 * float(spec.mechanism_pose.position_mm[2])

    def place(radius: float, sweep_deg: float, z: float) -> Pose:
        angle = np.radians(sweep_deg)
        at = np.array([radius * np.cos(angle), radius * np.sin(angle), z])
        return Pose(ring.rotation, ring.apply(at))

    size = spec.ball_diameter_mm
    cap, nut = place(70.0, 30.0, half_way), place(70.0, 150.0, half_way)
    cube, stone = place(72.0, 210.0, half_way - 20.0), place(24.0, 250.0, half_way + 35.0)
    solids = [
        half_ball(cap, 0.5 * size, ALUMINIUM_HU),
        hex_prism(nut, -0.4 * size, 0.4 * size, size, STEEL_HU),
        slab_box(cube, (0.42 * size,) * 3, ((0.0, ALUMINIUM_HU),)),
        ellipsoid(stone, (3.6, 2.8, 4.4), 1250.0),
    ]
    small = place(74.0, 330.0, half_way + 15.0)
    listed += [
        {"kind": kind, "center_mm": pose.position_mm.tolist(), "diameter_mm": diameter}
        for kind, pose, diameter in (
            ("pin-cap", cap, size),
            ("hex-nut", nut, size),
            ("cube", cube, 0.84 * size),
            ("calcification", stone, 7.2),
            ("ball-of-another-size", small, SMALL_BALL_SHARE * size),
        )
    ]
    ball = ExactBall(small.position_mm, 0.5 * SMALL_BALL_SHARE * size, spec.ball_hu)
    return solids, [ball], listed
