"""The bone in two pieces: where the CT shows them, and the ghost of where one shall go."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix import surfaces
from hexafix.mrml import models
from hexafix.mrml import transforms as places
from hexafix.mrml.geometry import lps_points
from hexafix.mrml.nodes import find
from hexafix.report.scene import BoneSample, SceneGeometry

NAMES = {"proximal": "Proximal bone fragment", "distal": "Distal bone fragment"}

MOVING_COLOUR = (0.93, 0.78, 0.52)
"""The fragment that moves is a little darker than the one that rests."""

GHOST_COLOUR = (0.20, 0.62, 0.30)
"""Where fragment and ring shall end: green, see-through."""

BONE_OPACITY, GHOST_OPACITY = 1.0, 0.3

CUT_END_MM = 15.0
"""The end of the moving fragment, about which its handles turn, is this long."""


def show_fragments(scene: Any, samples: Mapping[str, BoneSample], moving: str) -> None:
    """Both fragments and the ghost of the moving one; shapes in LPS mm, placed by transforms."""
    fragment = _kept(scene, places.FRAGMENT, "Moving fragment")
    target = _kept(scene, places.TARGET, "Target of the moving fragment")
    for side, sample in samples.items():
        shape = surfaces.bone_surface(sample)
        node = models.put_model(
            scene,
            f"model/bone/{side}",
            NAMES[side],
            shape,
            colour=MOVING_COLOUR if side == moving else surfaces.BONE_COLOUR,
            opacity=BONE_OPACITY,
            shine=0.05,
        )
        places.put_below(node, fragment if side == moving else None)
        if side == moving:
            ghost = models.put_model(
                scene,
                "model/target/bone",
                f"{NAMES[side]} at the end",
                shape,
                colour=GHOST_COLOUR,
                opacity=GHOST_OPACITY,
                shine=0.05,
            )
            places.put_below(ghost, target)
    _show_only_a_different_target(scene)


def show_target(
    scene: Any, geometry: SceneGeometry | None, fragment_lps: ArrayLike, moving: str
) -> None:
    """Where the moving fragment and its ring shall end."""
    target = places.put_transform(
        scene, places.TARGET, "Target of the moving fragment", fragment_lps
    )
    if geometry is not None:
        seen = places.put_transform(
            scene, places.TARGET_RING, "Moving ring in the CT", geometry.ring_pose(moving)
        )
        places.put_below(seen, target)
        still = dataclasses.replace(geometry, proximal_lps=np.eye(4), distal_lps=np.eye(4))
        ghost = models.put_model(
            scene,
            "model/target/ring",
            f"{moving.capitalize()} ring at the end",
            surfaces.ring_plate(still, moving),
            colour=GHOST_COLOUR,
            opacity=GHOST_OPACITY,
            shine=0.05,
        )
        places.put_below(ghost, seen)
    _show_only_a_different_target(scene)


def _kept(scene: Any, role: str, name: str) -> Any:
    """The transform of a role as it is; one that moves nothing if there is none."""
    node = find(scene, role)
    return node if node is not None else places.put_transform(scene, role, name, np.eye(4))


def _show_only_a_different_target(scene: Any) -> None:
    """Two shapes at one place flicker: a ghost that stands where its original stands is hidden."""
    target = find(scene, places.TARGET)
    moved = target is not None and not np.array_equal(places.motion_lps(target), np.eye(4))
    models.set_shown(scene, ("model/target",), bool(moved))


def set_handles(scene: Any, on: bool) -> None:
    """Show or hide the handles at the cut end of the moving fragment."""
    if on and find(scene, places.TARGET) is None:
        places.put_transform(scene, places.TARGET, "Target of the moving fragment", np.eye(4))
    places.set_handles(scene, shown=on, center_lps_mm=_cut_end_lps_mm(scene))
    if on:
        models.set_shown(scene, ("model/target",), True)
    else:
        _show_only_a_different_target(scene)


def _cut_end_lps_mm(scene: Any) -> NDArray[np.float64] | None:
    """The middle of the moving fragment's end that looks at the other fragment, shape (3,)."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    ghost = find(scene, "model/target/bone")
    sides = [find(scene, f"model/bone/{side}") for side in NAMES]
    shapes = [node for node in (ghost, *sides) if node is not None]
    if len(shapes) < 3:
        return None
    clouds = []
    for node in shapes:
        points = node.GetPolyData().GetPoints()
        if points is None or points.GetNumberOfPoints() == 0:
            return None
        clouds.append(lps_points(vtk_to_numpy(points.GetData())))
    own, others = clouds[0], clouds[1:]
    other = max(others, key=lambda cloud: float(np.linalg.norm(cloud.mean(0) - own.mean(0))))
    along = other.mean(0) - own.mean(0)
    height = own @ (along / np.linalg.norm(along))
    return own[height > height.max() - CUT_END_MM].mean(axis=0)
