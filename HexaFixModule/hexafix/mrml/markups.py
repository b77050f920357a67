"""The balls as points to see and to drag: numbered by ring, without number, rejected."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.hardware import MarkerLayout
from hexafix.markers import BallSet
from hexafix.mrml.geometry import lps_points, ras_points
from hexafix.mrml.models import keep_colour
from hexafix.mrml.nodes import PREFIX, ensure_displayed, find
from hexafix.surfaces import ring_colour

ROWS = f"{PREFIX}rows"
"""What a list shows, so that it is rebuilt only when that changes."""

BALL_INDEX = f"{PREFIX}ball_index"
"""JSON: control point id to index among the balls found."""

STILL_MM = 1e-6
"""A point that is nearer to its old place was not dragged, but rounded by a file."""

LISTS = {
    "proximal": "Balls of the proximal ring",
    "distal": "Balls of the distal ring",
    "unnumbered": "Balls without a number",
    "rejected": "Rejected candidates",
}
"""Lists of points and their names."""

UNNUMBERED_COLOUR, REJECTED_COLOUR = (0.85, 0.10, 0.38), (0.55, 0.55, 0.55)

SELECTED_COLOUR = (0.0, 0.38, 1.0)
"""A ball that is chosen in a table or view; its number stays legible on the white label."""

LANDMARK_COLOURS = {"moving": (0.20, 0.62, 0.30), "fixed": (0.13, 0.35, 0.72)}

CLASS = "vtkMRMLMarkupsFiducialNode"

TEXT_SCALE = 4.5
"""Height of a label, in hundredths of the view."""

GLYPH_MM = 8.0
"""Size of the cross at a ball's centre."""

PAPER = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Point:
    """One point of a list: LPS mm, label, description, and the ball it stands for."""

    position_lps_mm: tuple[float, float, float]
    label: str
    description: str
    ball: int | None


def list_role(name: str) -> str:
    """The role of one of `LISTS`."""
    return f"markups/{name}"


def colour_of(name: str) -> tuple[float, float, float]:
    """The colour of one of `LISTS`."""
    if name in ("proximal", "distal"):
        return ring_colour(name)
    return UNNUMBERED_COLOUR if name == "unnumbered" else REJECTED_COLOUR


def sort_balls(
    balls: BallSet,
    judged: Mapping[str, Any] | None,
    layouts: Mapping[str, MarkerLayout | Iterable[int]],
) -> dict[str, list[Point]]:
    """The points of each list.

    Parameters
    ----------
    balls : BallSet
    judged : mapping or None
        A judgement of the numbering; None: no ball has a number yet.
    layouts : mapping of str
        The layout, or the numbers alone, of ring ``proximal`` and ``distal``.
    """
    assigned = {int(n): int(index) for n, index in ((judged or {}).get("assigned") or {}).items()}
    sorted_: dict[str, list[Point]] = {name: [] for name in LISTS}
    for ring in ("proximal", "distal"):
        layout = layouts.get(ring, ())
        numbers = layout.numbers if isinstance(layout, MarkerLayout) else layout
        about = ((judged or {}).get("rings") or {}).get(ring) or {}
        residuals = about.get("residuals_mm") or {}
        for number in sorted(set(numbers) & set(assigned)):
            if assigned[number] >= len(balls.balls):
                continue
            words = f"{ring} ring"
            residual = residuals.get(str(number))
            if residual is not None:
                words += f", {residual:.2f} mm from its place in the layout"
            sorted_[ring].append(_point(balls, assigned[number], str(number), words))
    used = {point.ball for points in sorted_.values() for point in points}
    for index in range(len(balls.balls)):
        if index not in used:
            sorted_["unnumbered"].append(_point(balls, index, "?", f"ball {index + 1} of the list"))
    for other in balls.rejected:
        sorted_["rejected"].append(Point(triple(other.center_mm), "", other.reason, None))
    return sorted_


def _point(balls: BallSet, index: int, label: str, words: str) -> Point:
    return Point(triple(balls.balls[index].center_mm), label, words, index)


def triple(point: ArrayLike) -> tuple[float, float, float]:
    """Three plain numbers of a point, shape (3,)."""
    x, y, z = (float(value) for value in np.asarray(point, float))
    return x, y, z


def put_points(
    scene: Any,
    role: str,
    name: str,
    points: Sequence[Point],
    *,
    colour: tuple[float, float, float],
    locked: bool = False,
    glyph: bool = True,
    in_slices: bool = True,
    paper: tuple[float, float, float] | None = None,
) -> Any:
    """The markups node of a role with exactly these points; untouched if it has them already.

    Parameters
    ----------
    scene : vtkMRMLScene
    role, name : str
    points : sequence of Point
        In the node's own frame, LPS mm.
    colour : tuple of float
        Red, green, blue from 0 to 1.
    locked : bool
        Whether the user may not drag them.
    glyph : bool
        Whether a cross marks each point, or its label alone.
    in_slices : bool
        Whether slice views show them.
    paper : tuple of float, optional
        What the label stands on; white with a frame by default.
    """
    node, display = ensure_displayed(scene, CLASS, role, name)
    rows = json.dumps([[p.position_lps_mm, p.label, p.description, p.ball] for p in points])
    if node.GetAttribute(ROWS) is None:
        style(display, colour, glyph=glyph, paper=paper)
        display.SetVisibility2D(in_slices)
        if paper is None:
            keep_colour(node, colour)
    if node.GetAttribute(ROWS) != rows or not _as_given(node, points):
        _fill(node, points, rows)
    node.SetLocked(locked)
    return node


def _fill(node: Any, points: Sequence[Point], rows: str) -> None:
    """Put the points into the node; as many as before are moved, not made anew.

    A view may be in the middle of a drag: its point must not vanish under it.
    """
    state = node.StartModify()
    if node.GetNumberOfControlPoints() != len(points):
        node.RemoveAllControlPoints()
    indices = {}
    for at, point in enumerate(points):
        x, y, z = (float(value) for value in ras_points(point.position_lps_mm))
        if at == node.GetNumberOfControlPoints():
            node.AddControlPoint([x, y, z], point.label)
        else:
            node.SetNthControlPointPosition(at, x, y, z)
        node.SetNthControlPointLabel(at, point.label)
        node.SetNthControlPointDescription(at, point.description)
        if point.ball is not None:
            indices[node.GetNthControlPointID(at)] = point.ball
    node.SetAttribute(BALL_INDEX, json.dumps(indices))
    node.SetAttribute(ROWS, rows)
    node.EndModify(state)


def _as_given(node: Any, points: Sequence[Point]) -> bool:
    """Whether the points still stand where they were put; a drag may have moved them."""
    if node.GetNumberOfControlPoints() != len(points):
        return False
    given = np.array([point.position_lps_mm for point in points], float).reshape(-1, 3)
    return bool(np.allclose(positions_lps_mm(node), given, rtol=0.0, atol=STILL_MM))


def moved_balls(node: Any) -> dict[int, list[float]]:
    """Balls that were dragged since they were shown: index, and where to, LPS mm."""
    given = json.loads(node.GetAttribute(ROWS) or "[]")
    indices = ball_indices(node)
    moved = {}
    for at, now in enumerate(positions_lps_mm(node)):
        index = indices.get(node.GetNthControlPointID(at))
        before = next((row[0] for row in given if row[3] == index), None)
        if index is not None and before is not None and _apart(now, before):
            moved[index] = now.tolist()
    return moved


def _apart(now: NDArray[np.float64], before: Sequence[float]) -> bool:
    return bool(np.abs(now - np.asarray(before, float)).max() > STILL_MM)


def removed_balls(node: Any) -> list[int]:
    """Balls whose points were deleted since they were shown."""
    held = {node.GetNthControlPointID(k) for k in range(node.GetNumberOfControlPoints())}
    return sorted(ball for point, ball in ball_indices(node).items() if point not in held)


def positions_lps_mm(node: Any) -> NDArray[np.float64]:
    """The control points of a markups node in its own frame, LPS mm, shape (N, 3)."""
    found = np.zeros((node.GetNumberOfControlPoints(), 3))
    at = [0.0, 0.0, 0.0]
    for index in range(len(found)):
        node.GetNthControlPointPosition(index, at)
        found[index] = at
    return lps_points(found)


def ball_indices(node: Any) -> dict[str, int]:
    """Which ball each control point, by its id, stands for."""
    return json.loads(node.GetAttribute(BALL_INDEX) or "{}")


def style(
    display: Any,
    colour: tuple[float, float, float],
    *,
    glyph: bool = True,
    paper: tuple[float, float, float] | None = None,
) -> None:
    """Big bold numbers on white beside a small cross; the ball itself is a model."""
    # Every point is a selected one, but the one the user chose: it takes the plain colour.
    display.SetColor(*SELECTED_COLOUR)
    display.SetSelectedColor(*colour)
    display.SetActiveColor(*SELECTED_COLOUR)
    display.SetGlyphTypeFromString("CrossDot2D")
    display.SetUseGlyphScale(False)
    display.SetGlyphSize(GLYPH_MM if glyph else 0.01)
    display.SetPropertiesLabelVisibility(False)
    display.SetPointLabelsVisibility(True)
    display.SetTextScale(TEXT_SCALE)
    # A ball hides its own centre; what hides a number would hide the reason for looking.
    display.SetOccludedVisibility(True)
    display.SetOccludedOpacity(1.0)
    text = display.GetTextProperty()
    text.SetBold(True)
    text.SetShadow(False)
    text.SetBackgroundColor(*(paper or PAPER))
    text.SetBackgroundOpacity(0.85 if paper is None else 1.0)
    text.SetFrame(True)
    text.SetFrameWidth(2)
    text.SetFrameColor(*colour)


def show_lists(scene: Any, lists: Mapping[str, Sequence[Point]]) -> dict[str, Any]:
    """All of `LISTS` as nodes, by name; rejected candidates are hidden when first made."""
    nodes = {}
    for name, title in LISTS.items():
        role = list_role(name)
        new = find(scene, role) is None
        node = put_points(
            scene, role, title, lists[name], colour=colour_of(name), locked=name == "rejected"
        )
        if new and name == "rejected":
            display = node.GetDisplayNode()
            display.SetVisibility(False)
            display.SetGlyphSize(3.0)
            display.SetPointLabelsVisibility(False)
        nodes[name] = node
    return nodes


def nearest_ball(scene: Any, point_lps_mm: ArrayLike, *, within_mm: float) -> int | None:
    """The ball whose centre lies nearest to a point, LPS mm, if within reach."""
    best, found = within_mm, None
    for name in ("proximal", "distal", "unnumbered"):
        node = find(scene, list_role(name))
        if node is None:
            continue
        indices = ball_indices(node)
        away = np.linalg.norm(positions_lps_mm(node) - np.asarray(point_lps_mm, float), axis=1)
        for at, distance in enumerate(away):
            index = indices.get(node.GetNthControlPointID(at))
            if index is not None and distance <= best:
                best, found = float(distance), index
    return found


def select(scene: Any, index: int | None) -> list[float] | None:
    """Mark the ball of an index; its place in LPS mm, None if there is no such ball."""
    place = None
    for name in ("proximal", "distal", "unnumbered"):
        node = find(scene, list_role(name))
        if node is None:
            continue
        for at, (x, y, z) in enumerate(positions_lps_mm(node)):
            chosen = (
                index is not None and ball_indices(node).get(node.GetNthControlPointID(at)) == index
            )
            node.SetNthControlPointSelected(at, not chosen)
            if chosen:
                place = [float(x), float(y), float(z)]
    return place


def show_landmarks(scene: Any, moving: ArrayLike, fixed: ArrayLike) -> None:
    """Landmark points, LPS mm, shape (N, 3) each, as two lists of their own colours."""
    for name, letter, points in (("moving", "m", moving), ("fixed", "f", fixed)):
        role = f"markups/landmarks/{name}"
        rows = [
            Point(
                triple(point), f"{letter}{place}", f"landmark {place} of the {name} fragment", None
            )
            for place, point in enumerate(np.asarray(points, float).reshape(-1, 3), start=1)
        ]
        if not rows and find(scene, role) is None:
            continue
        title = f"Landmarks of the {name} fragment"
        put_points(scene, role, title, rows, colour=LANDMARK_COLOURS[name], locked=True)
