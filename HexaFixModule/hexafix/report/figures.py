"""The small figures: layout roses, strut curves and the map of the struts from above."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hexafix.report.format import format_number
from hexafix.report.scene import SceneGeometry, View, view_from_above
from hexafix.report.svg import Canvas, shifted
from hexafix.report.words import RING_COLOURS, STRUT_COLOURS

INK, FAINT, PAPER = "#1c2733", "#9aa5b1", "#ffffff"


def badge(canvas: Canvas, at: Any, strut: int, radius: float = 3.4) -> None:
    """A strut's number on its colour; `strut` counts from 1."""
    colour = STRUT_COLOURS[strut - 1]
    side = 2 * radius
    corner = (at[0] - radius, at[1] - radius)
    canvas.rectangle(
        corner, side, side, rx=0.3 * radius, fill=colour.fill, stroke=PAPER, stroke_width=0.35
    )
    place = (at[0], at[1] + 0.42 * radius)
    style = {"text_anchor": "middle", "font_weight": "bold", "fill": colour.ink}
    canvas.text(place, str(strut), size_mm=1.35 * radius, **style)


def layout_rose(document: Mapping[str, Any], ring: str) -> str:
    """The balls of a ring around its axis, seen from +z, with the included angles (SVG)."""
    sites = document["case"]["markers"][ring]
    canvas = Canvas(66, 52)
    middle, reach = np.array([30.0, 27.0]), 19.0
    largest = max(site["radius_mm"] for site in sites)
    colour = RING_COLOURS[ring]
    canvas.circle(middle, reach, fill="none", stroke=colour, stroke_width=1.4, opacity=0.45)
    canvas.line(middle, shifted(middle, reach + 5, 0), stroke=INK, stroke_width=0.35)
    canvas.text(shifted(middle, reach + 5.6, 1), "x front", size_mm=2.7, fill=INK)
    canvas.line(middle, shifted(middle, 0, -reach - 5), stroke=FAINT, stroke_width=0.3)
    canvas.text(shifted(middle, 1.5, -reach - 4), "y", size_mm=2.7, fill=INK)
    sweeps = sorted(float(site["sweep_deg"]) % 360 for site in sites)
    for this, following in zip(sweeps, [*sweeps[1:], sweeps[0] + 360], strict=True):
        half = np.radians((this + following) / 2)
        at = middle + 9.5 * np.array([np.cos(half), -np.sin(half)]) + [0, 1]
        words = f"{format_number(following - this, 1)}°"
        canvas.text(at, words, size_mm=2.7, fill=INK, text_anchor="middle")
    for site in sites:
        phi = np.radians(site["sweep_deg"])
        at = middle + reach * site["radius_mm"] / largest * np.array([np.cos(phi), -np.sin(phi)])
        canvas.line(middle, at, stroke=colour, stroke_width=0.5)
        canvas.circle(at, 3.0, fill=PAPER, stroke=INK, stroke_width=0.5)
        place = shifted(at, 0, 1.25)
        style: dict[str, object] = {"text_anchor": "middle", "font_weight": "bold", "fill": INK}
        canvas.text(place, str(site["number"]), size_mm=3.6, **style)
    return canvas.svg()


def _gauge(canvas: Canvas, x: float, box: tuple[float, float], limits: Any, used: Any) -> None:
    """The whole stroke as a bar, the part the plan uses filled."""
    top, bottom = box
    low, high = limits

    def y(value: float) -> float:
        return bottom - (value - low) / (high - low) * (bottom - top)

    canvas.rectangle((x, top), 2.2, bottom - top, fill="#eef1f4", stroke=INK, stroke_width=0.2)
    canvas.rectangle((x, y(used[1])), 2.2, max(0.5, y(used[0]) - y(used[1])), fill=INK)
    for value, at in ((high, top), (low, bottom)):
        words = format_number(value, 0)
        canvas.text((x + 3, at + 0.9), words, size_mm=2.3, fill=INK)


def strut_curves(document: Mapping[str, Any], *, row: int | None = None) -> str:
    """Scale value against day for each strut, beside its whole stroke (SVG).

    With `row`, that row of the schedule is marked on each curve.
    """
    schedule = document["schedule"]
    strut = document["case"]["fixator"]["strut"]
    offset = strut.get("scale_offset_mm", 0.0)
    limits = (strut["min_mm"] - offset, strut["max_mm"] - offset)
    table = np.array([row["strut_mm"] for row in schedule["rows"]], float)
    per_day = schedule["adjustments_per_day"]
    day = np.arange(len(table)) / per_day
    span = max(2.0, float(np.ptp(table, axis=0).max()) * 1.15)
    canvas = Canvas(174, 84)
    for index in range(6):
        left, top = 58.0 * (index % 3) + 9, 42.0 * (index // 3) + 6
        wide, high = 34.0, 28.0
        center = (table[:, index].max() + table[:, index].min()) / 2
        _axes(canvas, (left, top, wide, high), (center, span), float(day[-1]))
        x = left + day / max(day[-1], 1e-9) * wide
        y = top + high / 2 - (table[:, index] - center) / span * high
        colour = STRUT_COLOURS[index]
        steps = np.stack([np.repeat(x, 2)[1:], np.repeat(y, 2)[:-1]], axis=-1)
        canvas.path([steps], closed=False, stroke=INK, stroke_width=1.15)
        canvas.path([steps], closed=False, stroke=colour.fill, stroke_width=0.8)
        if row is not None:
            canvas.line((x[row], top), (x[row], top + high), stroke=INK, stroke_width=0.3)
            canvas.circle((x[row], y[row]), 1.3, fill=PAPER, stroke=INK, stroke_width=0.5)
        badge(canvas, (left + 3, top - 2.2), index + 1, 2.2)
        words = f"{format_number(table[0, index], 1)} to {format_number(table[-1, index], 1)} mm"
        canvas.text((left + 7, top - 1.3), words, size_mm=2.8, fill=INK, font_weight="bold")
        used = (table[:, index].min(), table[:, index].max())
        _gauge(canvas, left + wide + 3, (top, top + high), limits, used)
    return canvas.svg()


def _axes(canvas: Canvas, box: Any, y_range: Any, last_day: float) -> None:
    """Frame, three value marks and the day marks of one curve."""
    left, top, wide, high = box
    center, span = y_range
    canvas.rectangle((left, top), wide, high, fill="#fbfcfd", stroke=FAINT, stroke_width=0.2)
    step = next((s for s in (0.5, 1, 2, 5, 10, 20, 50) if span / s <= 4), 100)
    first = int(np.ceil((center - span / 2) / step))
    for mark in range(first, int((center + span / 2) // step) + 1):
        y = top + high / 2 - (mark * step - center) / span * high
        canvas.line((left, y), (left + wide, y), stroke="#d8dee4", stroke_width=0.2)
        words = format_number(mark * step, 1 if step < 1 else 0)
        canvas.text((left - 0.8, y + 0.8), words, size_mm=2.3, fill=INK, text_anchor="end")
    for share in (0.0, 0.5, 1.0):
        words = ("day " if share == 0 else "") + format_number(share * last_day, 0)
        at = (left + share * wide, top + high + 3)
        canvas.text(at, words, size_mm=2.3, fill=INK, text_anchor="middle")


def strut_map(scene: SceneGeometry) -> str:
    """Where each strut sits, seen from above, with the patient's sides (SVG)."""
    view = view_from_above(scene)
    canvas = Canvas(view.width_mm, view.height_mm)
    _map_ring(canvas, view, scene)
    upper, lower = (view.project(scene.joints_mm(ring)) for ring in ("proximal", "distal"))
    middle = view.project(scene.proximal_lps[:3, 3])[:2]
    for index, (a, b) in enumerate(zip(upper[:, :2], lower[:, :2], strict=True)):
        colour = STRUT_COLOURS[index]
        canvas.line(a, b, stroke=INK, stroke_width=9.0)
        canvas.line(a, b, stroke=colour.fill, stroke_width=7.5)
    for index, (a, b) in enumerate(zip(upper[:, :2], lower[:, :2], strict=True)):
        inward = (middle - (a + b) / 2) / np.linalg.norm(middle - (a + b) / 2)
        badge(canvas, (a + b) / 2 + 7 * inward, index + 1, 13.0)
    _map_words(canvas, view)
    return canvas.svg()


def _map_ring(canvas: Canvas, view: View, scene: SceneGeometry) -> None:
    hardware = scene.fixator.proximal
    outlines = [
        view.project(scene.outline_mm("proximal", radius, 0.0))[:, :2]
        for radius in (hardware.outer_radius_mm, scene.inner_radius_mm("proximal"))
    ]
    canvas.path(outlines, closed=True, fill="#dfe5ea", stroke=FAINT, stroke_width=0.8)


def _map_words(canvas: Canvas, view: View) -> None:
    middle = np.array([view.width_mm, view.height_mm]) / 2
    for word, towards in view.words().items():
        sideways = abs(towards[0]) > 0.5
        at = middle + towards * (middle - [2.0, 9.0]) + [0, 5]
        anchor = "middle" if not sideways else "end" if towards[0] > 0 else "start"
        canvas.label(at, word.upper(), size_mm=15.0, fill=INK, text_anchor=anchor)
