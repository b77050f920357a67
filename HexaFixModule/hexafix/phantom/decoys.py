"""Things that are no marker balls of this frame but may be taken for one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose
from hexafix.phantom.balls import ExactBall
from hexafix.phantom.hardware import JOINT_RADIUS_MM
from hexafix.phantom.limb import skin_radius_mm
from hexafix.phantom.scene import Scene, distance_to_struts_mm
from hexafix.phantom.solids import Solid, ellipsoid, half_ball, hex_prism, slab_box
from hexafix.phantom.spec import ALUMINIUM_HU, STEEL_HU, PhantomSpec

SMALL_BALL_SHARE = 0.7
"""Diameter of the ball of another size, in marker diameters."""
SKIN_GAP_MM = 2.0


def decoys_of(
    spec: PhantomSpec, scene: Scene
) -> tuple[list[Solid], list[ExactBall], list[dict[str, Any]]]:
    """Loose decoys to paint, balls of another size, and the list of all decoys for the truth."""
    listed: list[dict[str, Any]] = [
        {"kind": "ball-joint", "center_mm": center.tolist(), "diameter_mm": 2 * JOINT_RADIUS_MM}
        for center in (*scene.joints_b_mm, *scene.joints_a_mm)
    ]
    if not spec.decoys:
        return [], [], listed
    size = spec.ball_diameter_mm
    cap, nut, cube, small = (
        Pose(scene.ring_b.rotation, place) for place in free_places(spec, scene, 4)
    )
    stone = Pose(scene.ring_b.rotation, scene.bone_b.apply(np.array([-26.0, 12.0, -25.0])))
    edge = 0.42 * size
    solids = [
        half_ball(cap, 0.5 * size, ALUMINIUM_HU),
        hex_prism(nut, -0.4 * size, 0.4 * size, size, STEEL_HU),
        slab_box(cube, (edge, edge, edge), ((0.0, ALUMINIUM_HU),)),
        ellipsoid(stone, (3.6, 2.8, 4.4), 1250.0),
    ]
    listed += [
        {"kind": kind, "center_mm": pose.position_mm.tolist(), "diameter_mm": diameter}
        for kind, pose, diameter in (
            ("pin-cap", cap, size),
            ("hex-nut", nut, size),
            ("cube", cube, 2.0 * edge),
            ("calcification", stone, 7.2),
            ("ball-of-another-size", small, SMALL_BALL_SHARE * size),
        )
    ]
    ball = ExactBall(small.position_mm, 0.5 * SMALL_BALL_SHARE * size, spec.ball_hu)
    return solids, [ball], listed


def free_places(spec: PhantomSpec, scene: Scene, count: int) -> list[NDArray[np.float64]]:
    """Points just off the skin between the rings, far from struts, balls and each other, LPS mm."""
    length = float(spec.mechanism_pose.position_mm[2])
    tries = []
    for z in length * np.array([0.3, 0.45, 0.6]):
        for sweep in np.radians(np.arange(0.0, 360.0, 12.0)):
            radius = skin_radius_mm(spec, scene, sweep, z) + SKIN_GAP_MM
            radius += 0.5 * spec.ball_diameter_mm
            tries.append(scene.ring_b.apply([radius * np.cos(sweep), radius * np.sin(sweep), z]))
    points = np.array(tries)
    room = distance_to_struts_mm(scene, points)
    taken = list(scene.balls_mm.values())
    chosen = []
    for _ in range(count):
        others = np.linalg.norm(points[:, None] - np.array(taken), axis=-1).min(axis=1)
        best = points[int(np.argmax(np.minimum(room, 0.5 * others)))]
        chosen.append(best)
        taken.append(best)
    return chosen
