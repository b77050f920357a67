"""What the views show of the presenter's values: meshes, colours, labels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexafix.presenter import Presenter, Snapshot, Step
from hexafix.surfaces import (
    AXIS_COLOURS,
    BALL_COLOUR,
    STALE_COLOUR,
    axes,
    ball_spheres,
    joint_spheres,
    ring_colour,
    ring_plate,
    spheres,
    strut_colour,
    strut_middles_mm,
    strut_tubes,
)

Colour = tuple[float, float, float]
Point = tuple[float, float, float]

BALL_LINE: Colour = (1.0, 0.78, 0.1)
REJECTED: Colour = (0.93, 0.45, 0.15)

FRONT_MM, UP_MM = 115.0, 45.0
"""Lengths of a ring's x axis, which reaches its rim at the front, and of its z axis, as drawn."""

RINGS = ("proximal", "distal")


@dataclass(frozen=True, eq=False)
class Outline:
    """A mesh in LPS mm and its colour."""

    mesh: Any
    colour: Colour
    opacity: float = 1.0


@dataclass(frozen=True, eq=False)
class ShownBalls:
    """All balls found: one mesh, centres in LPS mm, what is written beside each."""

    mesh: Any
    centers_mm: tuple[tuple[float, float, float], ...]
    labels: tuple[str, ...]
    colour: Colour
    diameter_mm: float


def _colour(own: Colour, stale: bool) -> Colour:
    return STALE_COLOUR if stale else own


def shown_balls(presenter: Presenter, snapshot: Snapshot) -> ShownBalls | None:
    """The balls found, with their numbers where they have them."""
    found = presenter.value(Step.MARKERS)
    table = snapshot.tables.get("balls")
    if found is None or table is None or len(found.balls) != len(table.rows):
        return None
    centers = tuple(_point(ball.center_mm) for ball in found.balls)
    diameters = [ball.diameter_mm for ball in found.balls]
    if not diameters:
        return None
    return ShownBalls(
        mesh=spheres(centers, diameters_mm=diameters),
        centers_mm=centers,
        labels=tuple(label_of(row[0], row[1]) for row in table.rows),
        colour=_colour(BALL_LINE, table.stale),
        diameter_mm=max(diameters),
    )


def label_of(ball: str, number: str) -> str:
    """What is written beside a ball: its number, else which ball it is."""
    return f"({ball})" if number in ("", "-") else number


def rejected(presenter: Presenter) -> Outline | None:
    """The candidates not accepted, as small spheres."""
    found = presenter.value(Step.MARKERS)
    if found is None or not found.rejected:
        return None
    centers = [other.center_mm for other in found.rejected]
    return Outline(spheres(centers, diameters_mm=5.0), REJECTED, 0.9)


def frame_meshes(scene: Any, *, stale: bool = False) -> Mapping[str, Outline]:
    """Rings, axes, joints, struts and numbered balls of a scene by name."""
    found: dict[str, Outline] = {}
    for ring in RINGS:
        colour = _colour(ring_colour(ring), stale)
        found[f"ring-{ring}"] = Outline(ring_plate(scene, ring), colour, 0.92)
        found[f"joints-{ring}"] = Outline(joint_spheres(scene, ring), _colour(BALL_COLOUR, stale))
        pose = scene.ring_pose(ring)
        front, _, _ = axes(pose, length_mm=FRONT_MM)
        _, _, up = axes(pose, length_mm=UP_MM)
        found[f"front-{ring}"] = Outline(front, _colour(AXIS_COLOURS[0], stale))
        found[f"up-{ring}"] = Outline(up, _colour(AXIS_COLOURS[2], stale))
    for strut, tube in enumerate(strut_tubes(scene), 1):
        found[f"strut-{strut}"] = Outline(tube, _colour(strut_colour(strut), stale))
    for number, ball in ball_spheres(scene).items():
        found[f"ball-{number}"] = Outline(ball, _colour(BALL_LINE, stale))
    return found


def ring_outlines(meshes: Mapping[str, Outline]) -> dict[str, Outline]:
    """What of the frame is drawn in the slices."""
    return {name: mesh for name, mesh in meshes.items() if name.startswith("ring-")}


def labels_of(scene: Any) -> tuple[tuple[str, Point], ...]:
    """The numbers of balls and struts, and where they are written, LPS mm."""
    balls = [(str(ball.number), _point(ball.center_mm)) for ball in scene.balls]
    struts = enumerate(strut_middles_mm(scene), 1)
    return (*balls, *((f"S{strut}", _point(middle)) for strut, middle in struts))


def _point(values: Any) -> Point:
    x, y, z = (float(value) for value in values)
    return x, y, z


def scene_of_case(presenter: Presenter) -> Any:
    """Rings, struts and numbered balls as the CT shows them; None without ring poses."""
    from hexafix.errors import HexaFixError
    from hexafix.pipeline import scene_of

    recognised = presenter.value(Step.POSES)
    if recognised is None:
        return None
    try:
        return scene_of(presenter.inputs.case_for(Step.POSES), recognised, bone=False)
    except (HexaFixError, KeyError):
        # the case was edited to what has no such part any more; the older scene stays
        return None
