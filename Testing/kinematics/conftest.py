import json

import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, Ring, StrutType
from hexafix.paths import resources


@pytest.fixture(scope="session")
def fixator() -> Fixator:
    path = resources() / "Hardware" / "Frames" / "generic-6sps-160.json"
    data = json.loads(path.read_text(encoding="utf-8"))
    rings = [
        Ring(
            np.array(data[side]["joints_mm"]),
            data[side]["thickness_mm"],
            data[side]["outer_radius_mm"],
        )
        for side in ("proximal", "distal")
    ]
    return Fixator(data["id"], data["name"], data["source"], *rings, StrutType(**data["strut"]))


@pytest.fixture(scope="session")
def neutral() -> Pose:
    return Pose(np.eye(3), np.array([0.0, 0.0, 185.0]))


@pytest.fixture(scope="session")
def random_poses():
    def make(count: int, seed: int, *, mm: float = 30.0, deg: float = 20.0) -> list[Pose]:
        rng = np.random.default_rng(seed)
        return [
            Pose.from_xyz_fixed(
                position_mm=np.array([0.0, 0.0, 185.0]) + rng.uniform(-mm, mm, 3),
                angles_rad=np.radians(rng.uniform(-deg, deg, 3)),
            )
            for _ in range(count)
        ]

    return make
