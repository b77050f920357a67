import datetime
import json
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hexafix.correction import RigidPath, watched_points
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, Ring, StrutType
from hexafix.paths import resources


@dataclass(frozen=True)
class Rules:
    start_date: datetime.date = datetime.date(2026, 12, 1)
    adjustments_per_day: int = 4
    strut_step_mm: float = 0.5
    max_rate_mm_per_day: float = 1.0
    max_rate_rad_per_day: float = float(np.radians(1.0))


@pytest.fixture(scope="session")
def rules():
    def make(**changes):
        return replace(Rules(), **changes)

    return make


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
def with_strut(fixator):
    def make(**strut) -> Fixator:
        return replace(fixator, strut=replace(fixator.strut, **strut))

    return make


@pytest.fixture(scope="session")
def pose():
    def make(position=(0.0, 0.0, 185.0), angles_deg=(0.0, 0.0, 0.0)) -> Pose:
        return Pose.from_xyz_fixed(position_mm=position, angles_rad=np.radians(angles_deg))

    return make


@pytest.fixture(scope="session")
def random_pose():
    def make(rng, *, mm=15.0, deg=10.0, height=185.0) -> Pose:
        return Pose.from_xyz_fixed(
            position_mm=np.array([0.0, 0.0, height]) + rng.uniform(-mm, mm, 3),
            angles_rad=np.radians(rng.uniform(-deg, deg, 3)),
        )

    return make


@pytest.fixture(scope="session")
def path_of(fixator):
    def make(start, target, moving="proximal", *, structures=None, fracture=None) -> RigidPath:
        ring = start if moving == "proximal" else Pose.identity()
        watched = watched_points(
            fixator,
            moving=moving,
            moving_ring=ring,
            structures_lps_mm=structures,
            fracture_lps_mm=fracture,
        )
        return RigidPath(start, target, moving, watched)

    return make
