"""A small vector canvas in millimetres that writes SVG, the same bytes for the same calls."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from xml.sax.saxutils import escape

from numpy.typing import NDArray

Point = Sequence[float] | NDArray

FONT = "Roboto"


def shifted(point: Point, right: float, down: float) -> tuple[float, float]:
    """The point moved to the right and down, mm."""
    return float(point[0]) + right, float(point[1]) + down


def _n(value: float) -> str:
    text = f"{float(value):.3f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def _attributes(style: dict[str, object]) -> str:
    return "".join(
        f' {name.replace("_", "-")}="{_n(value) if isinstance(value, float) else value}"'
        for name, value in style.items()
        if value is not None
    )


class Canvas:
    """Drawing surface, x to the right and y down, mm.

    Parameters
    ----------
    width_mm, height_mm : float
        Size of the drawing.
    font : str
        Font of all texts; name others behind it where the drawing stands by itself.
    """

    def __init__(self, width_mm: float, height_mm: float, *, font: str = FONT) -> None:
        self.font = font
        self.width_mm = float(width_mm)
        self.height_mm = float(height_mm)
        self._parts: list[str] = []

    def _add(self, tag: str, geometry: str, style: dict[str, object]) -> None:
        self._parts.append(f"<{tag} {geometry}{_attributes(style)}/>")

    def line(self, start: Point, end: Point, **style: object) -> None:
        """Straight line; `style` holds SVG attributes with ``_`` for ``-``."""
        ends = f'x1="{_n(start[0])}" y1="{_n(start[1])}" x2="{_n(end[0])}" y2="{_n(end[1])}"'
        self._add("line", ends, {"stroke_linecap": "round"} | style)

    def circle(self, center: Point, radius: float, **style: object) -> None:
        """Circle."""
        self._add("circle", f'cx="{_n(center[0])}" cy="{_n(center[1])}" r="{_n(radius)}"', style)

    def rectangle(self, corner: Point, width: float, height: float, **style: object) -> None:
        """Rectangle from its upper left corner."""
        place = f'x="{_n(corner[0])}" y="{_n(corner[1])}"'
        self._add("rect", f'{place} width="{_n(width)}" height="{_n(height)}"', style)

    def path(self, outlines: Iterable[Iterable[Point]], *, closed: bool, **style: object) -> None:
        """One shape of one or more outlines; holes follow the even-odd rule."""
        data = "".join(
            "M" + "L".join(f"{_n(x)} {_n(y)}" for x, y in outline) + ("Z" if closed else "")
            for outline in outlines
        )
        base: dict[str, object] = {"fill_rule": "evenodd", "stroke_linejoin": "round"}
        if not closed:
            base["fill"] = "none"
        self._add("path", f'd="{data}"', base | style)

    def text(self, at: Point, words: str, *, size_mm: float, **style: object) -> None:
        """Text whose baseline starts, or by ``text_anchor`` centres or ends, at a point."""
        place = (
            f'x="{_n(at[0])}" y="{_n(at[1])}" font-family="{self.font}" font-size="{_n(size_mm)}"'
        )
        self._parts.append(f"<text {place}{_attributes(style)}>{escape(words)}</text>")

    def label(self, at: Point, words: str, *, size_mm: float, **style: object) -> None:
        """Bold text with a white rim, readable over a picture."""
        rim = {"stroke": "#ffffff", "stroke_width": 0.28 * size_mm, "paint_order": "stroke"}
        base: dict[str, object] = {"font_weight": "bold", "stroke_linejoin": "round"}
        self.text(at, words, size_mm=size_mm, **(base | rim | style))

    def image(self, png: bytes) -> None:
        """A PNG picture over the whole canvas."""
        data = base64.b64encode(png).decode("ascii")
        size = f'width="{_n(self.width_mm)}" height="{_n(self.height_mm)}"'
        self._parts.append(
            f'<image x="0" y="0" {size} preserveAspectRatio="none" '
            f'href="data:image/png;base64,{data}"/>'
        )

    def svg(self) -> str:
        """The drawing as an SVG document."""
        size = f"{_n(self.width_mm)} {_n(self.height_mm)}"
        width, height = size.split()
        head = (
            f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}mm" height="{height}mm" '
            f'viewBox="0 0 {size}">'
        )
        return head + "".join(self._parts) + "</svg>"
