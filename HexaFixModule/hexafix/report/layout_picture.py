"""The advisor's picture: each ring as it is and as proposed, its holes, balls and errors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.advised import Advice, AssessedRing, RingReport
from hexafix.accuracy.layout_check import PREFERRED_DEG
from hexafix.hardware import HoleCircle, MarkerSite
from hexafix.report.format import format_number
from hexafix.report.svg import Canvas, shifted

INK, GREY, PLATE, PAPER = "#1c2733", "#7b8794", "#eef1f4", "#ffffff"
NOW, BETTER, OVERLAP = "#d55e00", "#0072b2", "#cc79a7"
"""Vermillion, blue and purple of Okabe and Ito's palette; shape and words say the same."""

FONT = "Roboto, Helvetica, Arial, sans-serif"
PANEL_MM, ROSE_MM, REACH_MM = (92.0, 107.0), 80.0, 30.0
HEAD_MM, FOOT_MM = 13.0, 21.0
BALL_MM, HOLE_MM = 3.1, 0.85
MAGNIFICATIONS = (500, 200, 100, 50, 20, 10, 5, 2, 1)
LARGEST_ELLIPSE_MM = 11.0


def layout_picture(advice: Advice) -> str:
    """Roses of the present layouts and of the first proposal (SVG), the same bytes every time.

    Parameters
    ----------
    advice : Advice
    """
    rows = [
        (report, proposal)
        for report, proposal in zip(advice.rings, advice.proposals[0].rings, strict=True)
    ]
    has_present = any(report.present for report, _ in rows)
    wide = PANEL_MM[0] * (2 if has_present else 1)
    canvas = Canvas(wide, HEAD_MM + PANEL_MM[1] * len(rows) + FOOT_MM, font=FONT)
    canvas.rectangle((0, 0), canvas.width_mm, canvas.height_mm, fill=PAPER)
    _head(canvas, advice)
    times = _magnification([ring for pair in rows for ring in (pair[0].present, pair[1]) if ring])
    for index, (report, proposal) in enumerate(rows):
        top = HEAD_MM + PANEL_MM[1] * index
        name = "" if report.task.name == "ring" else f"{report.task.name} ring: "
        if report.present:
            panel = _Panel(canvas, (0.0, top), report, report.present, NOW, times)
            panel.draw(f"{name}now", _weak_words(report))
        left = PANEL_MM[0] if has_present else 0.0
        panel = _Panel(canvas, (left, top), report, proposal, BETTER, times)
        panel.draw(f"{name}proposed", _moved_words(proposal))
    _foot(canvas, canvas.height_mm - FOOT_MM, times)
    return canvas.svg()


def _head(canvas: Canvas, advice: Advice) -> None:
    """What is shown and the figures of all rings together."""
    style: dict[str, object] = {"fill": INK}
    canvas.text((4, 6.2), "Marker layout", size_mm=4.4, font_weight="bold", **style)
    best = advice.proposals[0]
    now = advice.present_error_mm
    words = f"{format_number(best.error_mm, 3)} mm proposed"
    if now is not None:
        words = f"{format_number(now, 3)} mm now, " + words
    words = "predicted error at joints and bone: " + words
    if best.exchange_mm is not None:
        words += f"; rings apart by RMS {format_number(best.exchange_mm, 1)} mm"
    canvas.text((4, 11.2), words, size_mm=2.9, **style)


def _foot(canvas: Canvas, top: float, times: int) -> None:
    """The legend."""
    x, y = 5.0, top + 4.0
    style: dict[str, object] = {"fill": INK}
    canvas.circle((x, y - 0.9), HOLE_MM, fill=PAPER, stroke=GREY, stroke_width=0.3)
    canvas.text((x + 3, y), "free hole", size_mm=2.6, **style)
    _cross(canvas, np.array([x + 20.0, y - 0.9]))
    canvas.text((x + 23, y), "taken hole", size_mm=2.6, **style)
    _wedge(canvas, np.array([x + 42.5, y + 1.2]), (1.0, 4.0), (67.5, 112.5), BETTER, 0.25)
    canvas.text((x + 46, y), f"{PREFERRED_DEG:g}° sector", size_mm=2.6, **style)
    x, y = 5.0, top + 9.5
    _wedge(canvas, np.array([x, y + 1.2]), (1.0, 4.0), (75.0, 105.0), OVERLAP, 0.9)
    canvas.text((x + 3, y), "sectors overlap", size_mm=2.6, **style)
    canvas.circle(
        (x + 30.0, y - 0.9),
        1.6,
        fill="none",
        stroke=NOW,
        stroke_width=0.4,
        stroke_dasharray="1 0.7",
    )
    canvas.text((x + 33.0, y), "place before", size_mm=2.6, **style)
    canvas.path([_ellipse(np.array([x + 55, y - 0.9]), np.diag([4.0, 1.6]))], closed=True,
                fill="none", stroke=INK, stroke_width=0.4)  # fmt: skip
    canvas.text((x + 58.5, y), f"bone error, 1 σ × {times}", size_mm=2.6, **style)
    lines = (
        "Seen from proximal: z towards you, angles counter-clockwise from x.",
        "At each ball: hole, height. Research software, not a medical device.",
    )
    for index, words in enumerate(lines):
        canvas.text((4, top + 15.0 + 3.5 * index), words, size_mm=2.6, fill=GREY)


def _weak_words(report: RingReport) -> str:
    terms = {
        "line": "nearly on one line",
        "sweep-gap": "sweep gap",
        "relabelling": "can be renumbered",
        "exchange": "like the other ring",
        "mirror": "shows no mirror",
        "predicted-error": "larger error",
    }
    if not report.weaknesses:
        return "no weakness against the proposal"
    return "weaker: " + ", ".join(terms[weakness.term] for weakness in report.weaknesses)


def _moved_words(ring: AssessedRing) -> str:
    if ring.moves:
        return "moved: " + ", ".join(str(move.number) for move in ring.moves)
    return ""


@dataclass(frozen=True)
class _Panel:
    """One rose with its figures."""

    canvas: Canvas
    corner: tuple[float, float]
    report: RingReport
    ring: AssessedRing
    colour: str
    times: int

    @property
    def middle(self) -> NDArray[np.float64]:
        return np.array([self.corner[0] + PANEL_MM[0] / 2, self.corner[1] + 7.0 + ROSE_MM / 2])

    @property
    def scale(self) -> float:
        """Millimetres of paper a millimetre of ring."""
        places = self.report.task.places
        radii = (
            [places.radius_mm]
            if isinstance(places, HoleCircle)
            else [s.radius_mm for s in places.sites]
        )
        present = self.report.present
        radii += [site.radius_mm for site in (present.layout.sites if present else ())]
        return REACH_MM / max(radii)

    def at(self, radius_mm: float, sweep_rad: float) -> NDArray[np.float64]:
        """A place of the ring on paper: y of the ring goes up."""
        return self.on_paper(self.scale * radius_mm, sweep_rad)

    def on_paper(self, length: float, sweep_rad: float) -> NDArray[np.float64]:
        return self.middle + length * np.array([np.cos(sweep_rad), -np.sin(sweep_rad)])

    def draw(self, title: str, note: str) -> None:
        left, top = self.corner
        style: dict[str, object] = {"font_weight": "bold", "fill": self.colour}
        self.canvas.text((left + 4, top + 4.5), title, size_mm=3.6, **style)
        self._plate()
        self._sectors()
        self._holes()
        self._error()
        self._gaps()
        self._balls()
        self._figures(note)

    def _plate(self) -> None:
        outer, inner = REACH_MM * 1.11, REACH_MM * 0.89
        turn = np.linspace(0.0, 2 * np.pi, 145)[:-1]
        rims = [
            self.middle + length * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
            for length in (outer, inner)
        ]
        self.canvas.path(rims, closed=True, fill=PLATE, stroke=GREY, stroke_width=0.2)
        for sweep, words, anchor in ((0.0, "x front", "end"), (np.pi / 2, "y", "middle")):
            start, end = self.on_paper(5.0, sweep), self.on_paper(15.0, sweep)
            self.canvas.line(start, end, stroke=GREY, stroke_width=0.3)
            beside = (-1.0, -0.8) if sweep == 0.0 else (0.0, 0.0)
            place = shifted(self.on_paper(16.0, sweep), *beside)
            self.canvas.text(place, words, size_mm=2.3, fill=GREY, text_anchor=anchor)

    def _sectors(self) -> None:
        """Half the rule's angle to either side of each ball: sectors may touch, not overlap."""
        half = PREFERRED_DEG / 2
        sweeps = sorted(float(np.degrees(s.sweep_rad)) % 360.0 for s in self.ring.layout.sites)
        reach = (REACH_MM * 0.5, REACH_MM * 0.87)
        for sweep in sweeps:
            _wedge(self.canvas, self.middle, reach, (sweep - half, sweep + half), self.colour, 0.2)
        for this, following in zip(sweeps, [*sweeps[1:], sweeps[0] + 360.0], strict=True):
            if following - this < PREFERRED_DEG - 1e-6:
                ends = (following - half, this + half)
                _wedge(self.canvas, self.middle, reach, ends, OVERLAP, 0.9)

    def _holes(self) -> None:
        places = self.report.task.places
        if not isinstance(places, HoleCircle):
            for site in places.sites:
                at = self.at(site.radius_mm, site.sweep_rad)
                self.canvas.circle(at, HOLE_MM, fill=PAPER, stroke=GREY, stroke_width=0.3)
            return
        small = min(HOLE_MM, 0.35 * 2 * np.pi * REACH_MM / places.count)
        for sweep, free in zip(places.sweep_rad, places.free, strict=True):
            at = self.at(places.radius_mm, float(sweep))
            if free:
                self.canvas.circle(at, small, fill=PAPER, stroke=GREY, stroke_width=0.3)
            else:
                _cross(self.canvas, at)

    def _error(self) -> None:
        """The ellipse of the bone's point across the ring's axis, magnified."""
        if self.ring.bone_covariance_mm2 is None:
            return
        # y goes up on paper.
        flip = np.diag([1.0, -1.0])
        covariance = self.times**2 * flip @ self.ring.bone_covariance_mm2[:2, :2] @ flip
        outline = _ellipse(self.middle, covariance)
        self.canvas.path([outline], closed=True, fill=self.colour, fill_opacity=0.15, stroke=INK,
                         stroke_width=0.35)  # fmt: skip
        self.canvas.circle(self.middle, 0.5, fill=INK)

    def _gaps(self) -> None:
        """Included angles between neighbours."""
        sweeps = np.sort([np.mod(site.sweep_rad, 2 * np.pi) for site in self.ring.layout.sites])
        for this, gap in zip(sweeps, self.ring.verdict.included_angles_rad, strict=True):
            at = shifted(self.on_paper(REACH_MM * 0.68, float(this + gap / 2)), 0.0, 1.0)
            words = f"{format_number(float(np.degrees(gap)), 0)}°"
            self.canvas.label(at, words, size_mm=2.8, fill=INK, text_anchor="middle")

    def _balls(self) -> None:
        present = self.report.present
        moved = {move.number for move in self.ring.moves}
        if self.ring.places is not None and present is not None:
            for site in present.layout.sites:
                if site.number in moved:
                    at = self.at(site.radius_mm, site.sweep_rad)
                    self.canvas.circle(at, BALL_MM, fill="none", stroke=NOW, stroke_width=0.4,
                                       stroke_dasharray="1 0.7")  # fmt: skip
        places = self.ring.places or (None,) * len(self.ring.layout)
        for site, place in zip(self.ring.layout.sites, places, strict=True):
            changed = place is not None and (site.number in moved or present is None)
            self._ball(site, place, filled=changed)

    def _ball(self, site: MarkerSite, place: int | None, *, filled: bool) -> None:
        at = self.at(site.radius_mm, site.sweep_rad)
        fill, ink = (self.colour, PAPER) if filled else (PAPER, INK)
        self.canvas.circle(at, BALL_MM, fill=fill, stroke=self.colour, stroke_width=0.7)
        style: dict[str, object] = {"text_anchor": "middle", "font_weight": "bold", "fill": ink}
        self.canvas.text(shifted(at, 0.0, 1.2), str(site.number), size_mm=3.4, **style)
        words = f"{format_number(site.height_mm, 0)} mm"
        words = words if place is None else f"{place}, {words}"
        side = np.cos(site.sweep_rad)
        anchor = "middle" if abs(side) < 0.35 else "start" if side > 0 else "end"
        down = 0.9
        if anchor == "middle":
            down += -0.8 if np.sin(site.sweep_rad) > 0 else 1.2
        place_at = shifted(self.on_paper(REACH_MM * 1.16, site.sweep_rad), 0.0, down)
        self.canvas.text(place_at, words, size_mm=2.5, fill=INK, text_anchor=anchor)

    def _figures(self, note: str) -> None:
        left, top = self.corner[0] + 4, self.corner[1] + ROSE_MM + 9.0
        error, verdict = self.ring.place_error, self.ring.verdict
        lines = [note]
        if error is not None:
            lines.append(
                f"error {format_number(error.error_mm, 3)} mm: joints"
                f" {format_number(error.joints_mm, 3)}, bone {format_number(error.bone_mm, 3)} mm"
            )
        if verdict.predicted_error_mm is not None and verdict.predicted_error_rad is not None:
            lines.append(
                f"Eq. (28): {format_number(verdict.predicted_error_mm, 3)} mm,"
                f" {format_number(float(np.degrees(verdict.predicted_error_rad)), 3)}°"
            )
        lines.append(
            f"next numbering {format_number(verdict.uniqueness_mm, 1)} mm away, mirror"
            f" {format_number(verdict.mirror_mm, 1)} mm; {PREFERRED_DEG:g}° rule: {verdict.rule}"
        )
        for index, words in enumerate(lines):
            style: dict[str, object] = {"fill": INK}
            if index == 0:
                style |= {"font_weight": "bold", "fill": self.colour}
            self.canvas.text((left, top + 4.0 * index), words, size_mm=2.8, **style)


def _magnification(rings: list[AssessedRing]) -> int:
    """The largest round factor at which every ellipse stays inside the roses."""
    largest = max(
        (
            float(np.sqrt(np.linalg.eigvalsh(ring.bone_covariance_mm2[:2, :2])[-1]))
            for ring in rings
            if ring.bone_covariance_mm2 is not None
        ),
        default=1.0,
    )
    return next((m for m in MAGNIFICATIONS if m * largest <= LARGEST_ELLIPSE_MM), 1)


def _ellipse(middle: NDArray, covariance: NDArray) -> NDArray[np.float64]:
    """The 1 σ ellipse of a covariance, shape (2, 2), as a polygon."""
    values, axes = np.linalg.eigh(covariance)
    turn = np.linspace(0.0, 2 * np.pi, 73)[:-1]
    round_ = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    return middle + (round_ * np.sqrt(np.maximum(values, 0.0))) @ axes.T


def _wedge(
    canvas: Canvas,
    middle: NDArray,
    reach: tuple[float, float],
    ends_deg: tuple[float, float],
    colour: str,
    opacity: float,
) -> None:
    """A sector of a ring between two angles, counter-clockwise."""
    turn = np.radians(np.linspace(*ends_deg, max(2, round(abs(ends_deg[1] - ends_deg[0]) / 3))))
    around = np.stack([np.cos(turn), -np.sin(turn)], axis=-1)
    outline = np.concatenate([middle + reach[1] * around, middle + reach[0] * around[::-1]])
    canvas.path([outline], closed=True, fill=colour, fill_opacity=opacity)


def _cross(canvas: Canvas, at: NDArray) -> None:
    """A taken hole."""
    canvas.circle(at, HOLE_MM, fill=GREY, stroke=GREY, stroke_width=0.3)
    for slope in (1.0, -1.0):
        reach = np.array([1.3, 1.3 * slope])
        canvas.line(at - reach, at + reach, stroke=INK, stroke_width=0.35)
