"""Rings, struts and marker balls as nodes, where the CT shows them or at a row of the schedule.

Plates, joints, axes and planes stand in their ring's frame below the ring's transform: a moment of
the schedule moves two transforms and makes only the six struts anew.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from hexafix import surfaces
from hexafix.hardware.definition import fixator_from_document
from hexafix.markers import BallSet
from hexafix.mrml import markups, models
from hexafix.mrml import transforms as places
from hexafix.mrml.geometry import require_rigid
from hexafix.mrml.nodes import PREFIX, find, remove
from hexafix.mrml.parameter_node import stored_document
from hexafix.report.scene import SceneGeometry
from hexafix.report.words import STRUT_COLOURS

if TYPE_CHECKING:
    from hexafix.pipeline import PlaybackRow

LETTERS = {"proximal": "A", "distal": "B"}

STRUT_LABELS = "markups/frame/strut"

IN_THE_CT = f"{PREFIX}in_the_ct_lps"
"""Where the CT shows a ring, whatever row of the schedule is shown now: JSON, 4×4, LPS mm."""

DISC_OPACITY, PLATE_OPACITY = 0.12, 0.9

AXIS_SHARE = 0.45
"""Length of a ring's drawn axes over its outer radius."""


def show_frame(scene: Any, geometry: SceneGeometry) -> None:
    """Rings and struts of one geometry."""
    still = dataclasses.replace(geometry, proximal_lps=np.eye(4), distal_lps=np.eye(4))
    for ring in ("proximal", "distal"):
        title = f"{ring.capitalize()} ring"
        pose = places.put_transform(scene, places.RING[ring], title, geometry.ring_pose(ring))
        pose.SetAttribute(IN_THE_CT, json.dumps(geometry.ring_pose(ring).tolist()))
        for node in _ring_models(scene, still, ring, title):
            places.put_below(node, pose)
    show_struts(scene, geometry)


def _ring_models(scene: Any, still: SceneGeometry, ring: str, title: str) -> list[Any]:
    """The nodes of one ring in its own frame."""
    role, colour = f"model/ring/{ring}", surfaces.ring_colour(ring)
    plate = models.put_model(
        scene,
        f"{role}/plate",
        f"{title} plate",
        surfaces.ring_plate(still, ring),
        colour=colour,
        opacity=PLATE_OPACITY,
    )
    joints = models.put_model(
        scene,
        f"{role}/joints",
        f"{title} joints",
        surfaces.joint_spheres(still, ring),
        colour=surfaces.STEEL_COLOUR,
    )
    radius = still.ring(ring).outer_radius_mm
    disc = models.put_model(
        scene,
        f"{role}/plane",
        f"{title} plane",
        models.ring_disc(radius),
        colour=colour,
        opacity=DISC_OPACITY,
        shine=0.0,
    )
    arrows = surfaces.axes(np.eye(4), length_mm=AXIS_SHARE * radius)
    axes = [
        models.put_model(
            scene, f"{role}/axis/{name}", f"{title} {name} axis", shape, colour=rgb, in_slices=False
        )
        for name, shape, rgb in zip("xyz", arrows, surfaces.AXIS_COLOURS, strict=True)
    ]
    front = (radius + 22.0, 0.0, -still.ring(ring).thickness_mm / 2)
    word = f"{LETTERS[ring]} front"
    mark = markups.put_points(
        scene,
        f"markups/frame/{ring}",
        f"{title} front",
        [markups.Point(front, word, f"the x axis of the {ring} ring points here", None)],
        colour=colour,
        locked=True,
        glyph=False,
    )
    return [plate, joints, disc, *axes, mark]


def stored_geometry(scene: Any) -> SceneGeometry | None:
    """The geometry that a scene was made of, without balls and bone; None if it shows none."""
    nodes = {ring: find(scene, role) for ring, role in places.RING.items()}
    document = stored_document(scene)
    if document is None or not isinstance(document.get("fixator"), dict):
        return None
    poses = {}
    for ring, node in nodes.items():
        text = node.GetAttribute(IN_THE_CT) if node is not None else None
        if text is None:
            return None
        poses[ring] = require_rigid(
            np.array(json.loads(text), float).reshape(4, 4), what=f"pose of the {ring} ring"
        )
    fixator = fixator_from_document(document["fixator"])
    side = document["limb"]["side"]
    return SceneGeometry(poses["proximal"], poses["distal"], fixator, (), side)


def show_struts(scene: Any, geometry: SceneGeometry) -> None:
    """The six struts and their numbers, in the colours of the prescription."""
    for number, shape in enumerate(surfaces.strut_tubes(geometry), start=1):
        models.put_model(
            scene,
            f"model/strut/{number}",
            f"Strut {number}",
            shape,
            colour=surfaces.strut_colour(number),
            in_slices=False,
        )
    upper, lower = (geometry.joints_mm(ring) for ring in ("proximal", "distal"))
    # Not at the middle: there two neighbours' numbers would stand close to each other.
    spots = lower + np.array([0.35, 0.65] * 3)[:, None] * (upper - lower)
    for number, spot in enumerate(spots, start=1):
        colour = STRUT_COLOURS[number - 1]
        markups.put_points(
            scene,
            f"{STRUT_LABELS}/{number}",
            f"Strut {number} number",
            [markups.Point(markups.triple(spot), str(number), f"strut {number}", None)],
            colour=_rgb(colour.ink),
            paper=surfaces.strut_colour(number),
            locked=True,
            glyph=False,
            in_slices=False,
        )


def show_ball_models(
    scene: Any, balls: BallSet, lists: Mapping[str, Sequence[markups.Point]]
) -> None:
    """A sphere of each ball's fitted place and size: in slices its outline lies on the image."""
    for name in ("proximal", "distal", "unnumbered"):
        chosen = [balls.balls[point.ball] for point in lists[name] if point.ball is not None]
        role = f"model/balls/{name}"
        if not chosen:
            remove(scene, role)
            continue
        shape = surfaces.spheres(
            [ball.center_mm for ball in chosen], diameters_mm=[ball.diameter_mm for ball in chosen]
        )
        models.put_model(
            scene,
            role,
            f"{markups.LISTS[name]}, fitted",
            shape,
            colour=markups.colour_of(name),
            shine=0.6,
        )


def show_moment(
    scene: Any, geometry: SceneGeometry, row: PlaybackRow | None, moving: str | None
) -> None:
    """Rings, struts, balls and moving fragment at a row of the schedule; None: as in the CT."""
    if row is None:
        now, motion = geometry, np.eye(4)
    else:
        poses = {"proximal_lps": row.proximal_lps, "distal_lps": row.distal_lps}
        now = dataclasses.replace(geometry, **{k: np.array(v, float) for k, v in poses.items()})
        motion = np.array(row.fragment_lps, float)
    for ring in ("proximal", "distal"):
        title = f"{ring.capitalize()} ring"
        places.put_transform(scene, places.RING[ring], title, now.ring_pose(ring))
    fragment = places.put_transform(scene, places.FRAGMENT, "Moving fragment", motion)
    for ring in ("proximal", "distal"):
        for role in (markups.list_role(ring), f"model/balls/{ring}"):
            node = find(scene, role)
            if node is not None:
                places.put_below(node, fragment if ring == moving and row is not None else None)
    show_struts(scene, now)


def _rgb(colour: str) -> tuple[float, float, float]:
    """Red, green, blue from 0 to 1 of ``#rrggbb``."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue
