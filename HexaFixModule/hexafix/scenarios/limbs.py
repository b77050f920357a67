"""Bones, sides, and frames that sit askew on the limb or in the scanner."""

from __future__ import annotations

from functools import partial

import numpy as np

from hexafix.geometry import Pose
from hexafix.scenarios.scenario import Scenario

_scenario = partial(Scenario, theme="limb and frame")


def pose(*numbers: float) -> Pose:
    """Pose of x, y, z in mm and X-Y-Z fixed angles in degrees."""
    return Pose.from_xyz_fixed(position_mm=numbers[:3], angles_rad=np.radians(numbers[3:]))


SCENARIOS = (
    _scenario(
        number=1,
        title="left tibia, one of the usual frames",
        phantom={"side": "left", "bone": "tibia"},
    ),
    _scenario(
        number=2,
        title="right tibia, one of the usual frames",
        phantom={"side": "right", "bone": "tibia"},
    ),
    _scenario(
        number=3,
        title="left femur",
        phantom={"side": "left", "bone": "femur"},
    ),
    _scenario(
        number=4,
        title="right femur",
        phantom={"side": "right", "bone": "femur"},
    ),
    _scenario(
        number=5,
        title="left humerus, the arm lying across the body",
        phantom={
            "side": "left",
            "bone": "humerus",
            "ring_b_pose": pose(120, -60, 310, 12, 71, 35),
        },
    ),
    _scenario(
        number=6,
        title="right forearm raised over the head, hand first",
        phantom={
            "side": "right",
            "bone": "forearm",
            "ring_b_pose": pose(-140, 30, 560, 172, 9, -40),
        },
    ),
    _scenario(
        number=7,
        title="left foot",
        phantom={"side": "left", "bone": "foot"},
    ),
    _scenario(
        number=8,
        title="frame leaning 22° in the scanner (knee on a wedge)",
        phantom={
            "side": "right",
            "bone": "tibia",
            "ring_b_pose": pose(-75, 40, -820, 22, 3, -96),
        },
    ),
    _scenario(
        number=9,
        title="frame leaning 50° in the scanner (hip and knee bent)",
        phantom={
            "side": "left",
            "bone": "femur",
            "ring_b_pose": pose(85, -30, -610, -48, 14, -80),
        },
    ),
    _scenario(
        number=10,
        title="frame turned 175° about the limb, its front behind",
        phantom={
            "side": "left",
            "bone": "tibia",
            "ring_b_pose": pose(64, 12, -905, -4, 5, 85),
        },
    ),
    _scenario(
        number=11,
        title="rings 16° askew to each other and 14 mm out of line",
        phantom={
            "side": "right",
            "bone": "femur",
            "mechanism_pose": pose(11, -8.5, 179, 13, -9, 4),
        },
    ),
    _scenario(
        number=12,
        title="frame oblique in a volume that is itself oblique by 20°",
        phantom={
            "side": "left",
            "bone": "tibia",
            "ring_b_pose": pose(-31, 92, 144, 15, -18, -110),
            "image_angles_rad": (0.21, -0.17, 0.24),
        },
    ),
)
