"""Scenes on slicer-core, offscreen, and one of the phantom's whole plan."""

import os

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.imaging import Volume
from hexafix.mrml import HeadlessMrmlApp, SceneLogic
from hexafix.mrml.nodes import ROLE, nodes_of


@pytest.fixture
def app():
    with HeadlessMrmlApp() as made:
        yield made


@pytest.fixture
def logic(app):
    return SceneLogic(app.scene, app_logic=app.app_logic)


@dataclass
class Planned:
    """A scene after `SceneLogic.plan` on the phantom."""

    app: Any
    logic: SceneLogic
    case: Any
    document: dict
    export: Path
    volume_node: Any


@pytest.fixture(scope="session")
def planned(a_phantom, a_read_case, tmp_path_factory):
    """Volume node in, nodes and export out; do not change it."""
    app = HeadlessMrmlApp()
    logic = SceneLogic(app.scene, app_logic=app.app_logic)
    node = logic.add_volume(a_phantom.volume)
    folder = tmp_path_factory.mktemp("plan") / "export"
    document = logic.plan(node, a_read_case, folder)
    yield Planned(app, logic, a_read_case, document, folder, node)
    app.close()


@pytest.fixture(scope="session")
def a_judged(a_recognised):
    """The numbering of the phantom as the live judgement tells it."""
    numbers = a_recognised.numbering.ball_of_number
    return {"assigned": {str(number): index for number, index in numbers.items()}}


@pytest.fixture
def layouts(a_phantom_case):
    case = a_phantom_case()
    return {"proximal": case.proximal, "distal": case.distal}


@pytest.fixture(scope="session")
def oblique_volume():
    """`oblique_volume(dtype, mirrored)`: random voxels on an oblique, anisotropic grid far off."""

    def make(dtype=np.int16, *, mirrored=False, size=(9, 8, 7)):
        rng = np.random.default_rng(5)
        pose = Pose.from_xyz_fixed(
            position_mm=[-321.7, 654.3, -1203.9], angles_rad=[0.31, -0.22, 0.47]
        )
        affine = pose.matrix.copy()
        affine[:3, :3] = affine[:3, :3] @ np.diag([0.61, 0.83, -1.27 if mirrored else 1.27])
        k, j, i = size[::-1]
        voxels = rng.uniform(-1000, 3000, (k, j, i)).astype(dtype)
        return Volume(voxels, affine)

    return make


@pytest.fixture
def roles_of():
    """The roles of our nodes in a scene, and what is visible of each."""

    def read(scene):
        return {node.GetAttribute(ROLE): node for node in nodes_of(scene)}

    return read
