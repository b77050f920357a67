"""The words and numbers over every 3D picture, and the picture drawn by lines alone.

Both kinds of picture share the parallel `View`, so that a number stands at the same place over
the rendered picture as over the drawn one, sharp and readable as text.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from hexafix.report.figures import FAINT, INK, PAPER, badge
from hexafix.report.scene import ANATOMY, SceneGeometry, View, transform
from hexafix.report.svg import Canvas, shifted
from hexafix.report.words import RING_COLOURS, STRUT_COLOURS

STRUT_BADGE_MM, BALL_LABEL_MM = 8.0, 8.0
"""Half size of a strut's badge and radius of a ball's label, mm in the patient."""

RINGS = ("distal", "proximal")


class _Places:
    """Label places already taken, so that a new label keeps clear of the old ones."""

    def __init__(self, view: View, keep_clear: Iterable[NDArray[np.float64]]) -> None:
        self._view = view
        self._taken = [np.asarray(point, float)[:2] for point in keep_clear]

    def choose(self, candidates: Iterable[NDArray[np.float64]]) -> NDArray[np.float64]:
        """The candidate farthest from all taken places (35 mm is far enough); it is then taken."""
        points = np.array(list(candidates), float)
        apart = np.linalg.norm(points[:, None] - np.array(self._taken), axis=-1).min(axis=1)
        far_edge = np.array([self._view.width_mm, self._view.height_mm])
        edge = np.minimum(points, far_edge - points).min(axis=1)
        best = points[int(np.argmax(np.where(edge > 22.0, np.minimum(apart, 35.0), -1.0)))]
        self._taken.append(best)
        return best


def draw_labels(canvas: Canvas, view: View, scene: SceneGeometry) -> None:
    """Strut numbers, ball numbers, ring letters and front marks, patient words and a scale bar."""
    _front_marks(canvas, view, scene)
    letters = _ring_letters(canvas, view, scene)
    balls = [view.project(ball.center_mm) for ball in scene.balls]
    places = _Places(view, [*balls, *letters])
    _strut_badges(canvas, view, scene, places)
    _ball_labels(canvas, view, scene, places)
    if view.is_along_patient_axis:
        _edge_words(canvas, view)
    else:
        _triad(canvas, view)
    end = np.array([view.width_mm - 6.0, view.height_mm - 5.0])
    canvas.line(end - [50.0, 0], end, stroke=INK, stroke_width=1.2, stroke_linecap="butt")
    canvas.label(end - [25.0, 2.5], "50 mm", size_mm=7.0, fill=INK, text_anchor="middle")


def _edge_words(canvas: Canvas, view: View) -> None:
    """The patient's directions at the four edges of a view along a patient axis."""
    middle = np.array([view.width_mm, view.height_mm]) / 2
    for word, towards in view.words().items():
        sideways = abs(towards[0]) > 0.5
        at = middle + towards * (middle - [4.0, 6.0]) + [0, 3.0]
        anchor = "middle" if not sideways else "end" if towards[0] > 0 else "start"
        canvas.label(at, word.upper(), size_mm=9.0, fill=INK, text_anchor=anchor)


def _triad(canvas: Canvas, view: View) -> None:
    """Three arrows with the patient's directions in the lower left corner of an oblique view."""
    base = np.array([44.0, view.height_mm - 34.0])
    for word in ("head", "front", "left" if view.right[0] > 0 else "right"):
        direction = np.array(ANATOMY[word])
        flat = np.array([direction @ view.right, -(direction @ view.up)])
        tip = base + 22.0 * flat
        canvas.line(base, tip, stroke=INK, stroke_width=1.2)
        at = base + 22.0 * flat + 6.0 * flat / np.linalg.norm(flat) + [0, 2.2]
        anchor = "middle" if abs(flat[0]) < 0.4 else "start" if flat[0] > 0 else "end"
        canvas.label(at, word.upper(), size_mm=7.5, fill=INK, text_anchor=anchor)
    canvas.circle(base, 1.6, fill=INK)


def _strut_badges(canvas: Canvas, view: View, scene: SceneGeometry, places: _Places) -> None:
    upper, lower = (view.project(scene.joints_mm(ring)) for ring in ("proximal", "distal"))
    order = np.argsort([-(a[2] + b[2]) for a, b in zip(upper, lower, strict=True)])
    for index in order:
        a, b = upper[index, :2], lower[index, :2]
        shares = (0.5, 0.4, 0.6, 0.3, 0.7, 0.2, 0.8)
        at = places.choose([a + share * (b - a) for share in shares])
        badge(canvas, at, int(index) + 1, STRUT_BADGE_MM)


def _ball_labels(canvas: Canvas, view: View, scene: SceneGeometry, places: _Places) -> None:
    angles = np.linspace(0, 2 * np.pi, 16, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    for ball in scene.balls:
        center = view.project(ball.center_mm)[:2]
        radius = ball.diameter_mm / 2
        at = places.choose([center + reach * step for reach in (17.0, 24.0) for step in around])
        canvas.line(center, at, stroke=INK, stroke_width=0.9)
        canvas.circle(center, radius + 1.4, fill="none", stroke=INK, stroke_width=0.9)
        colour = RING_COLOURS[ball.ring]
        canvas.circle(at, BALL_LABEL_MM, fill=PAPER, stroke=colour, stroke_width=1.8)
        style = {"text_anchor": "middle", "font_weight": "bold", "fill": INK}
        size = 10.5 if ball.number < 10 else 8.5
        canvas.text(shifted(at, 0, 0.36 * size), str(ball.number), size_mm=size, **style)


def _ring_letters(canvas: Canvas, view: View, scene: SceneGeometry) -> list[NDArray[np.float64]]:
    """A at the proximal and B at the distal ring, left of its rim; returns where they stand."""
    taken = []
    for ring, letter in (("proximal", "A"), ("distal", "B")):
        outline = view.project(scene.outline_mm(ring, scene.ring(ring).outer_radius_mm, 0.0))
        rim = outline[int(np.argmin(outline[:, 0])), :2]
        at = np.array(shifted(rim, -9.0, 4.5))
        style = {"text_anchor": "middle", "fill": RING_COLOURS[ring]}
        canvas.label(at, letter, size_mm=13.0, **style)
        taken.append(at - [0.0, 4.5])
    return taken


def _front_marks(canvas: Canvas, view: View, scene: SceneGeometry) -> None:
    """An arrow from each ring's centre along its x axis, the ring's front mark."""
    for ring in RINGS:
        reach = scene.ring(ring).outer_radius_mm
        base, tip = view.project(transform(scene.ring_pose(ring), [[0, 0, 0], [reach, 0, 0]]))
        arrow = tip[:2] - base[:2]
        length = float(np.linalg.norm(arrow))
        colour = RING_COLOURS[ring]
        canvas.circle(base[:2], 1.8, fill=colour)
        if length < 12.0:
            continue
        along = arrow / length
        across = np.array([-along[1], along[0]])
        canvas.line(base[:2], tip[:2] - 4 * along, stroke=PAPER, stroke_width=2.6)
        canvas.line(base[:2], tip[:2] - 4 * along, stroke=colour, stroke_width=1.3)
        head = [tip[:2], tip[:2] - 8 * along + 3.2 * across, tip[:2] - 8 * along - 3.2 * across]
        canvas.path([head], closed=True, fill=colour, stroke=PAPER, stroke_width=0.5)
        at = base[:2] + 0.55 * arrow + [0, -3.0]
        canvas.label(at, "x", size_mm=8.0, fill=colour, text_anchor="middle")


def draw_scene(canvas: Canvas, view: View, scene: SceneGeometry) -> None:
    """Rings, struts and balls by lines alone, the farthest first; no bone."""
    shapes: list[tuple[float, int, object]] = []
    for ring in RINGS:
        depth = float(view.project(scene.ring_pose(ring)[:3, 3])[2])
        shapes.append((depth, 0, ring))
    upper, lower = (view.project(scene.joints_mm(ring)) for ring in ("proximal", "distal"))
    for index, (a, b) in enumerate(zip(upper, lower, strict=True)):
        shapes.append((float(a[2] + b[2]) / 2, 1, (index, a[:2], b[:2])))
    for ball in scene.balls:
        place = view.project(ball.center_mm)
        shapes.append((float(place[2]), 2, (place[:2], ball.diameter_mm / 2)))
    for _, kind, shape in sorted(shapes, key=lambda item: item[0]):
        _draw_shape(canvas, view, scene, kind, shape)


def _draw_shape(canvas: Canvas, view: View, scene: SceneGeometry, kind: int, shape: object) -> None:
    match kind, shape:
        case 0, str() as ring:
            _draw_ring(canvas, view, scene, ring)
        case 1, (int() as index, a, b):
            canvas.line(a, b, stroke=INK, stroke_width=8.0)
            canvas.line(a, b, stroke=STRUT_COLOURS[index].fill, stroke_width=6.4)
        case 2, (center, float() as radius):
            canvas.circle(center, radius, fill="#d7dde3", stroke=INK, stroke_width=0.8)
            shine = center - np.array([0.3, 0.3]) * radius
            canvas.circle(shine, 0.3 * radius, fill=PAPER)


def _draw_ring(canvas: Canvas, view: View, scene: SceneGeometry, ring: str) -> None:
    hardware = scene.ring(ring)
    inner = scene.inner_radius_mm(ring)
    colour = RING_COLOURS[ring]
    lower, upper = (
        [
            view.project(scene.outline_mm(ring, r, z))[:, :2]
            for r in (hardware.outer_radius_mm, inner)
        ]
        for z in (-hardware.thickness_mm, 0.0)
    )
    if scene.ring_pose(ring)[:3, 2] @ view.toward < 0:
        lower, upper = upper, lower
    # The rim lies between the two outlines: a fan of quadrilaterals fills it.
    for outline_low, outline_high in zip(lower, upper, strict=True):
        for k in range(len(outline_low)):
            n = (k + 1) % len(outline_low)
            quad = [outline_low[k], outline_low[n], outline_high[n], outline_high[k]]
            canvas.path([quad], closed=True, fill=colour, stroke=colour, stroke_width=0.4)
    canvas.path(upper, closed=True, fill=colour, stroke=PAPER, stroke_width=0.6, fill_opacity=0.92)
    canvas.path(upper, closed=True, fill="none", stroke=FAINT, stroke_width=0.3)
