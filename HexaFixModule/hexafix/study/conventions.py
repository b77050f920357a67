"""Pictures of the conventions: frames, markers, struts, angles and the words of a deformity."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.correction import Deformity
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout, shipped_fixator
from hexafix.report.svg import Canvas, shifted

Array = NDArray[np.float64]

INK, GREY, PLATE, PAPER = "#1c2733", "#7b8794", "#dfe5ea", "#ffffff"
RED, GREEN, BLUE, ORANGE, PURPLE = "#d55e00", "#009e73", "#0072b2", "#e69f00", "#aa4499"
AXES = (RED, GREEN, BLUE)
"""x, y and z, of colours that colour-blind readers can tell apart."""

FONT = "Roboto, Helvetica, Arial, sans-serif"
SMALL, PLAIN, LARGE = 2.7, 3.2, 4.2

MECHANISM = Pose.from_xyz_fixed(
    position_mm=(-14.0, 26.0, 188.0), angles_rad=np.radians([7.0, -6.0, 9.0])
)
"""The pose drawn, {A} in {B}."""

IMAGE = Pose.from_xyz_fixed(
    position_mm=(150.0, -60.0, -30.0), angles_rad=np.radians([4.0, -6.0, 92.0])
)
"""Where the image frame {W} is drawn, in {B}: x of the ring to the limb's front."""

PROXIMAL = MarkerLayout.of(
    radius_mm=[100.0] * 3, sweep_deg=[50.0, 150.0, 290.0], height_mm=[20.0, 20.0, 20.0]
)
DISTAL = MarkerLayout.of(
    radius_mm=[100.0] * 3,
    sweep_deg=[35.0, 127.0, 227.0],
    height_mm=[20.0, 20.0, 20.0],
    first_number=4,
)


@dataclass(frozen=True, eq=False)
class _View:
    """A parallel view: where a point of space falls on paper."""

    origin: tuple[float, float]
    scale: float
    azimuth_deg: float
    elevation_deg: float

    def __call__(self, point: ArrayLike) -> Array:
        """Paper place of points, shape (..., 3) to (..., 2), y down."""
        az, el = np.radians([self.azimuth_deg, self.elevation_deg])
        right = np.array([-np.sin(az), np.cos(az), 0.0])
        up = np.array([-np.sin(el) * np.cos(az), -np.sin(el) * np.sin(az), np.cos(el)])
        p = np.asarray(point, float)
        return np.array(self.origin) + self.scale * np.stack([p @ right, -(p @ up)], axis=-1)


def _arrow(canvas: Canvas, start: ArrayLike, end: ArrayLike, colour: str, width: float = 0.5,
           *, both: bool = False, **style: Any) -> None:  # fmt: skip
    """A line with a head at its end, or at both ends."""
    a, b = np.asarray(start, float), np.asarray(end, float)
    along = (b - a) / max(float(np.linalg.norm(b - a)), 1e-9)
    back = along * 1.2
    canvas.line(a + back if both else a, b - back, stroke=colour, stroke_width=width, **style)
    _head(canvas, b, along, colour)
    if both:
        _head(canvas, a, -along, colour)


def _head(canvas: Canvas, tip: Array, along: Array, colour: str) -> None:
    side = np.array([-along[1], along[0]]) * 0.85
    base = tip - 2.3 * along
    canvas.path([[tip, base + side, base - side]], closed=True, fill=colour)


def _curve(canvas: Canvas, points: Array, colour: str, width: float = 0.45) -> None:
    """A curve on paper, shape (K, 2), with a head at its end."""
    canvas.path([points[:-1]], closed=False, stroke=colour, stroke_width=width)
    along = points[-1] - points[-3]
    _head(canvas, points[-1], along / np.linalg.norm(along), colour)


def _circle(radius_mm: float, z_mm: float = 0.0, start: float = 0.0, end: float = 360.0) -> Array:
    """An arc about z, degrees, shape (K, 3)."""
    turn = np.radians(np.linspace(start, end, 73))
    ones = np.ones_like(turn)
    return np.stack([radius_mm * np.cos(turn), radius_mm * np.sin(turn), z_mm * ones], axis=-1)


def _words(canvas: Canvas, at: ArrayLike, text: str, **style: Any) -> None:
    base: dict[str, Any] = {"size_mm": PLAIN, "fill": INK}
    canvas.text(np.asarray(at, float), text, **(base | style))


def _label(canvas: Canvas, at: ArrayLike, text: str, colour: str = INK, **style: Any) -> None:
    base: dict[str, Any] = {"size_mm": PLAIN, "fill": colour, "text_anchor": "middle"}
    canvas.label(shifted(np.asarray(at, float), 0.0, 1.1), text, **(base | style))


def _title(canvas: Canvas, at: tuple[float, float], text: str) -> None:
    _words(canvas, at, text, size_mm=LARGE, font_weight="bold")


def _triad(canvas: Canvas, view: _View, pose: Pose, length: float, name: str,
           ends: tuple[str, str, str], beside: tuple[float, float]) -> None:  # fmt: skip
    """Axes of a frame with their names."""
    origin = view(pose.position_mm)
    for k, colour in enumerate(AXES):
        tip = pose.apply(np.eye(3)[k] * length)
        _arrow(canvas, origin, view(tip), colour, 0.7)
        _label(canvas, view(pose.apply(np.eye(3)[k] * (length + 3.6 / view.scale))),
               ends[k], colour)  # fmt: skip
    canvas.circle(origin, 0.8, fill=INK)
    _label(canvas, shifted(origin, *beside), name, size_mm=LARGE)


def _ring(canvas: Canvas, view: _View, pose: Pose, thickness_mm: float, radius_mm: float) -> None:
    """A plate seen from above: its lower rim, then its upper face, the ring's x-y plane."""
    for z, opacity in ((-thickness_mm, 0.7), (0.0, 0.85)):
        rims = [view(pose.apply(_circle(r, z)))[:-1] for r in (radius_mm, 0.78 * radius_mm)]
        canvas.path(rims, closed=True, fill=PLATE, fill_opacity=opacity, stroke=GREY,
                    stroke_width=0.25)  # fmt: skip


def _markers(canvas: Canvas, view: _View, pose: Pose, layout: MarkerLayout) -> None:
    for site, ball in zip(layout.sites, layout.points_mm, strict=True):
        foot, centre = view(pose.apply(ball * [1.0, 1.0, 0.0])), view(pose.apply(ball))
        canvas.line(foot, centre, stroke=INK, stroke_width=0.8)
        canvas.circle(centre, 2.3, fill=ORANGE, stroke=INK, stroke_width=0.3)
        _label(canvas, centre, str(site.number), stroke_width=0.0, size_mm=PLAIN)


def _space(canvas: Canvas) -> None:
    """The mechanism with its three frames."""
    view = _View((62.0, 103.0), 0.36, 38.0, 24.0)
    fixator = shipped_fixator()
    base, ring = Pose.identity(), fixator.distal
    _title(canvas, (4.0, 8.0), "Frames, markers and struts")
    _ring(canvas, view, base, ring.thickness_mm, ring.outer_radius_mm)
    foot, head = view(ring.joints_mm), view(MECHANISM.apply(fixator.proximal.joints_mm))
    for start, end in zip(foot, head, strict=True):
        canvas.line(start, end, stroke=GREY, stroke_width=1.5)
        canvas.circle(start, 1.0, fill=PAPER, stroke=INK, stroke_width=0.4)
    _markers(canvas, view, base, DISTAL)
    _triad(canvas, view, base, 62.0, "{B}", ("x", "y", "z"), (-5.0, 3.0))
    _arrow(canvas, view(base.position_mm), view(MECHANISM.position_mm), PURPLE, 0.6,
           stroke_dasharray="1.6 1")  # fmt: skip
    middle = (view(base.position_mm) * 0.42 + view(MECHANISM.position_mm) * 0.58) + [-1.0, 0.0]
    _label(canvas, middle, "X", PURPLE, size_mm=LARGE)
    for number, (start, end) in enumerate(zip(foot, head, strict=True), start=1):
        _label(canvas, 0.55 * start + 0.45 * end, str(number), BLUE, size_mm=LARGE)
    ring = fixator.proximal
    _ring(canvas, view, MECHANISM, ring.thickness_mm, ring.outer_radius_mm)
    for end in head:
        canvas.circle(end, 1.0, fill=PAPER, stroke=INK, stroke_width=0.4)
    _triad(canvas, view, MECHANISM, 62.0, "{A}", ("x", "y", "z"), (-6.5, -1.0))
    _markers(canvas, view, MECHANISM, PROXIMAL)
    corner = _View((21.0, 128.0), 0.36, 38.0, 24.0)
    _triad(canvas, corner, Pose(IMAGE.rotation, np.zeros(3)), 40.0, "{W}",
           ("x = L", "y = P", "z = S"), (-6.0, -2.0))  # fmt: skip
    lines = (
        "{W} image, LPS, mm: x to the patient's left, y to the back, z to the head",
        "{A} proximal ring, moving; {B} distal ring, base: origin in the",
        "upper plane, z to proximal, x to the front, y by the right hand",
        "X = (x y z α β γ), {A} in {B}; struts 1 to 6 from joint b to joint a",
    )
    for k, line in enumerate(lines):
        _words(canvas, (44.0, 131.0 + 4.0 * k), line, size_mm=SMALL)


def _marker_plan(canvas: Canvas) -> None:
    """One ring seen from proximal: t, φ and Δφ."""
    middle, scale = np.array([160.0, 46.0]), 0.29
    _title(canvas, (126.0, 8.0), "A marker's t and φ, from proximal")

    def at(points: ArrayLike) -> Array:
        return middle + scale * np.asarray(points, float)[..., :2] * [1.0, -1.0]

    fixator = shipped_fixator()
    rims = [at(_circle(r))[:-1] for r in (110.0, 86.0)]
    canvas.path(rims, closed=True, fill=PLATE, stroke=GREY, stroke_width=0.25)
    for number, joint in enumerate(fixator.proximal.joints_mm, start=1):
        canvas.circle(at(joint), 0.8, fill=PAPER, stroke=INK, stroke_width=0.35)
        _label(canvas, at(joint * 0.8), str(number), BLUE)
    for k in (0, 1):
        tip = 62.0 * np.eye(3)[k]
        _arrow(canvas, at(np.zeros(3)), at(tip), AXES[k], 0.6)
        _label(canvas, at(tip * 0.86 + 9.0 * np.eye(3)[1 - k] * (1, -1, 1)), "xy"[k], AXES[k])
    first, second, third = PROXIMAL.points_mm
    _arrow(canvas, at(np.zeros(3)), at(second), INK, 0.4, both=True)
    _label(canvas, at(second * 0.62 + [3.0, 12.0, 0.0]), "t₂")
    _curve(canvas, at(_circle(34.0, 0.0, 0.0, 150.0)), INK)
    _label(canvas, at(_circle(46.0, 0.0, 50.0, 50.0)[0]), "φ₂")
    canvas.line(at(np.zeros(3)), at(third), stroke=GREY, stroke_width=0.3, stroke_dasharray="1 1")
    _curve(canvas, at(_circle(50.0, 0.0, 150.0, 290.0)), PURPLE)
    _label(canvas, at(_circle(34.0, 0.0, 220.0, 220.0)[0]), "Δφ₂", PURPLE)
    for number, ball in enumerate((first, second, third), start=1):
        canvas.circle(at(ball), 2.3, fill=ORANGE, stroke=INK, stroke_width=0.3)
        _label(canvas, at(ball), str(number), stroke_width=0.0)
    canvas.circle(middle, 0.8, fill=INK)


def _heights(canvas: Canvas) -> None:
    """One plate from the side: the sign of h."""
    _title(canvas, (126.0, 92.0), "Its height h, from the side")
    left, top, thick, rod = 132.0, 116.0, 5.0, 11.0
    canvas.rectangle((left, top), 52.0, thick, fill=PLATE, stroke=GREY, stroke_width=0.3)
    canvas.line((left - 3, top), (left + 56.0, top), stroke=INK, stroke_width=0.3,
                stroke_dasharray="1.4 1")  # fmt: skip
    _arrow(canvas, (158.0, top), (158.0, top - 17.0), BLUE, 0.7)
    _label(canvas, (161.0, top - 16.0), "z", BLUE)
    canvas.circle((158.0, top), 0.8, fill=INK)
    for x, end, words in ((142.0, top - rod, "h > 0"), (174.0, top + thick + rod, "h < 0")):
        canvas.line((x, top if end < top else top + thick), (x, end), stroke=INK, stroke_width=0.8)
        canvas.circle((x, end), 2.3, fill=ORANGE, stroke=INK, stroke_width=0.3)
        _arrow(canvas, (x + 5.0, top), (x + 5.0, end), INK, 0.35)
        canvas.line((x, end), (x + 6.5, end), stroke=INK, stroke_width=0.2)
        _words(canvas, (x + 7.0, (top + end) / 2 + (4.5 if end > top else 1.0)), words)
    _words(canvas, (126.0, 139.0), "h counts from the upper plane (dashed); a ball", size_mm=SMALL)
    _words(canvas, (126.0, 143.0), "beneath has h = −(rod) − (plate's thickness)", size_mm=SMALL)


def _angles(canvas: Canvas) -> None:
    """The three fixed angles in their order."""
    _title(canvas, (4.0, 156.0), "X-Y-Z fixed angles: R = Rz(γ) Ry(β) Rx(α)")
    frame = Pose.identity()
    for k, (name, words) in enumerate(zip("αβγ", ("first", "second", "third"), strict=True)):
        view = _View((24.0 + 38.0 * k, 182.0), 0.3, 38.0, 24.0)
        _triad(canvas, view, frame, 46.0, "", ("x", "y", "z"), (0.0, 0.0))
        turn = np.radians(np.linspace(-60.0, 210.0, 61))
        ring = np.zeros((61, 3))
        ring[:, k] = 28.0
        ring[:, (k + 1) % 3], ring[:, (k + 2) % 3] = 15.0 * np.cos(turn), 15.0 * np.sin(turn)
        _curve(canvas, view(ring), AXES[k], 0.6)
        beside = {0: (-9.5, 0.5), 1: (9.0, -5.5), 2: (8.0, -3.0)}[k]
        _label(canvas, shifted(view(ring.mean(axis=0)), *beside), name, AXES[k], size_mm=LARGE)
        _words(canvas, (24.0 + 38.0 * k, 200.0), f"{words}: {name} about fixed {'xyz'[k]}",
               size_mm=SMALL, text_anchor="middle")  # fmt: skip


def _strut(canvas: Canvas) -> None:
    """A strut's length and its scale."""
    _title(canvas, (126.0, 156.0), "A strut's reading")
    y, left, right = 172.0, 131.0, 185.0
    canvas.line((left, y), (right, y), stroke=GREY, stroke_width=1.2)
    canvas.rectangle((left + 8.0, y - 2.2), 24.0, 4.4, fill=PLATE, stroke=GREY, stroke_width=0.3)
    for k in range(9):
        x = left + 12.0 + 2.2 * k
        canvas.line((x, y - 2.2), (x, y - (0.2 if k % 4 == 0 else 1.1)), stroke=INK,
                    stroke_width=0.25)  # fmt: skip
    for x, words in ((left, "b"), (right, "a")):
        canvas.circle((x, y), 1.6, fill=PAPER, stroke=INK, stroke_width=0.5)
        _label(canvas, (x, y - 5.0), words, BLUE)
    _arrow(canvas, (left, y + 8.0), (right, y + 8.0), INK, 0.4, both=True)
    for x in (left, right):
        canvas.line((x, y + 2.5), (x, y + 10.0), stroke=INK, stroke_width=0.2)
    _label(canvas, ((left + right) / 2, y + 12.0), "length q, joint centre to joint centre",
           size_mm=SMALL)  # fmt: skip
    _words(canvas, (126.0, 196.0), "length = scale reading + scale_offset_mm", size_mm=PLAIN)


def conventions_picture() -> str:
    """Frames, markers, struts and angles, SVG."""
    canvas = Canvas(194.0, 205.0, font=FONT)
    canvas.rectangle((0.0, 0.0), 194.0, 205.0, fill=PAPER)
    for draw in (_space, _marker_plan, _heights, _angles, _strut):
        draw(canvas)
    return canvas.svg() + "\n"


@dataclass(frozen=True)
class _Plane:
    """A view of the limb: what goes to the right and up, and the words at its rims."""

    right: int
    up: int
    right_sign: float
    up_sign: float
    rims: tuple[str, str]
    name: str

    AP: ClassVar[_Plane]
    LATERAL: ClassVar[_Plane]
    AXIAL: ClassVar[_Plane]


_Plane.AP = _Plane(0, 2, 1.0, 1.0, ("medial", "lateral"), "AP view, from the front")
_Plane.LATERAL = _Plane(1, 2, 1.0, 1.0, ("anterior", "posterior"), "lateral view, from lateral")
_Plane.AXIAL = _Plane(0, 1, 1.0, -1.0, ("medial", "lateral"), "axial view, from distal")
"""A left limb in LPS: lateral is +x, posterior +y, proximal +z."""

PANELS: tuple[tuple[_Plane, dict[str, Any]], ...] = (
    (_Plane.AP, {"ap_angulation_deg": 22.0, "ap_angulation": "varus"}),
    (_Plane.AP, {"ap_angulation_deg": 22.0, "ap_angulation": "valgus"}),
    (_Plane.LATERAL, {"lateral_angulation_deg": 22.0, "lateral_angulation": "apex-anterior"}),
    (_Plane.LATERAL, {"lateral_angulation_deg": 22.0, "lateral_angulation": "apex-posterior"}),
    (_Plane.AXIAL, {"axial_rotation_deg": 25.0, "axial_rotation": "internal"}),
    (_Plane.AXIAL, {"axial_rotation_deg": 25.0, "axial_rotation": "external"}),
    (_Plane.AP, {"ap_translation_mm": 7.0, "ap_translation": "medial"}),
    (_Plane.AP, {"ap_translation_mm": 7.0, "ap_translation": "lateral"}),
    (_Plane.LATERAL, {"lateral_translation_mm": 7.0, "lateral_translation": "anterior"}),
    (_Plane.LATERAL, {"lateral_translation_mm": 7.0, "lateral_translation": "posterior"}),
    (_Plane.AP, {"axial_translation_mm": 6.0, "axial_translation": "short"}),
    (_Plane.AP, {"axial_translation_mm": 6.0, "axial_translation": "long"}),
)
"""Every word, alone, in the view that shows it."""


def _outline(plane: _Plane, *, distal: bool) -> Array:
    """A fragment's outline in the view's plane, LPS mm, shape (K, 3)."""
    if plane is _Plane.AXIAL:
        turn = np.radians(np.arange(0.0, 360.0, 4.0))
        reach = 8.0 + 4.5 * np.exp(-(((np.degrees(turn) - 180.0) / 26.0) ** 2))
        # the crest points to the front, −y
        flat = reach[:, None] * np.stack([-np.sin(turn), np.cos(turn)], axis=-1)
        return np.concatenate([flat, np.zeros((len(flat), 1))], axis=-1)
    sign = -1.0 if distal else 1.0
    half = np.array([[-3.2, 0.0], [3.2, 0.0], [3.2, 20.0], [5.4, 26.0], [-5.4, 26.0], [-3.2, 20.0]])
    points = np.zeros((len(half), 3))
    points[:, plane.right], points[:, 2] = half[:, 0], sign * half[:, 1]
    return points


def _word_panel(canvas: Canvas, corner: tuple[float, float], plane: _Plane,
                parameters: dict[str, Any]) -> None:  # fmt: skip
    word = next(value for value in parameters.values() if isinstance(value, str))
    middle = np.array([corner[0] + 24.0, corner[1] + 36.0])

    def at(points: Array) -> Array:
        flat = points[..., [plane.right, plane.up]] * [plane.right_sign, -plane.up_sign]
        return middle + 0.85 * flat

    moved = Deformity(moving="distal", origin_lps_mm=np.zeros(3), **parameters)
    true, now = _outline(plane, distal=False), _outline(plane, distal=True)
    displaced = moved.displacement(side="left").apply(now)
    canvas.path([at(true)], closed=True, fill=PLATE, stroke=GREY, stroke_width=0.4)
    canvas.path([at(now)], closed=True, fill="none", stroke=GREY, stroke_width=0.3,
                stroke_dasharray="1 0.8")  # fmt: skip
    canvas.path([at(displaced)], closed=True, fill=BLUE, fill_opacity=0.45, stroke=BLUE,
                stroke_width=0.5)  # fmt: skip
    canvas.circle(middle, 0.7, fill=INK)
    _words(canvas, (middle[0], corner[1] + 6.0), word, size_mm=LARGE, font_weight="bold",
           text_anchor="middle")  # fmt: skip
    for x, anchor, rim in ((1.0, "start", plane.rims[0]), (47.0, "end", plane.rims[1])):
        _words(canvas, (corner[0] + x, corner[1] + 37.0), rim, size_mm=2.4, fill=GREY,
               text_anchor=anchor)  # fmt: skip
    if plane is _Plane.AXIAL:
        _words(canvas, (middle[0], corner[1] + 19.0), "anterior", size_mm=2.4, fill=GREY,
               text_anchor="middle")  # fmt: skip
    _words(canvas, (middle[0], corner[1] + 66.0), plane.name, size_mm=2.4, fill=GREY,
           text_anchor="middle")  # fmt: skip


def deformity_picture() -> str:
    """The twelve words of a deformity on a left limb, drawn by `Deformity` itself, SVG."""
    canvas = Canvas(194.0, 222.0, font=FONT)
    canvas.rectangle((0.0, 0.0), 194.0, 222.0, fill=PAPER)
    _title(
        canvas, (4.0, 8.0), "What the words of a deformity say: left limb, distal fragment moving"
    )
    for k, (plane, parameters) in enumerate(PANELS):
        corner = (1.0 + 48.0 * (k % 4), 11.0 + 69.0 * (k // 4))
        _word_panel(canvas, corner, plane, parameters)
    return canvas.svg() + "\n"
