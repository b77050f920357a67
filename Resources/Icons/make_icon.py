"""Draw the module's icon: two rings and six struts, seen from the front and above.

``python Resources/Icons/make_icon.py [FOLDER]`` writes ``HexaFixModule.svg`` and from it the
``HexaFixModule.png`` that Slicer shows, beside this file or into FOLDER.
"""

from __future__ import annotations

import math
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent

PIXELS = 128

WIDE, FLAT, CENTER = 52.0, 17.0, 64.0
"""Half axes of a ring's middle line as drawn, and the icon's middle."""

HEIGHTS = {"proximal": 36.0, "distal": 90.0}
"""Where the rings' middles stand, from the top."""

RINGS = {"proximal": "#00838f", "distal": "#8d5a2b"}
STRUTS = ("#c62828", "#ef7d00", "#f7d002", "#2e7d32", "#1559b7", "#7b2fa0")
"""The prescription's colours."""

JOINTS = {"proximal": (12, 108, 132, 228, 252, 348), "distal": (48, 72, 168, 192, 288, 312)}
"""Sweep of struts 1 to 6 in degrees, a pair of neighbours to each foot."""

BALLS = ((200.0, 20.0, "proximal"), (330.0, 24.0, "proximal"), (248.0, -12.5, "distal"))
"""Marker balls: sweep in degrees, height over the ring, ring."""


def place(ring: str, sweep_deg: float, up: float = 0.0) -> tuple[float, float]:
    """A point over a ring's middle line on the icon; sweep 90 is the far side."""
    sweep = math.radians(sweep_deg)
    return CENTER + WIDE * math.cos(sweep), HEIGHTS[ring] - FLAT * math.sin(sweep) - up


def half(ring: str, *, near: bool) -> str:
    """The far or near half of a ring, with a light upper edge."""
    x, y = CENTER - WIDE, HEIGHTS[ring]
    bow = f"M{x} {y} A{WIDE} {FLAT} 0 0 {0 if near else 1} {x + 2 * WIDE} {y}"
    dark = f'<path d="{bow}" fill="none" stroke="{RINGS[ring]}" stroke-width="9"/>'
    light = f'<path d="{bow}" fill="none" stroke="#ffffff" stroke-width="1.5" opacity="0.45"'
    return dark + light + ' transform="translate(0 -2.5)"/>'


def strut(number: int) -> str:
    """A strut with its joints."""
    (x1, y1), (x2, y2) = (place(ring, JOINTS[ring][number - 1]) for ring in RINGS)
    ends = f'x1="{x1:.2f}" y1="{y1:.2f}" x2="{x2:.2f}" y2="{y2:.2f}"'
    joints = "".join(
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="3.6" fill="#33404a"/>'
        for x, y in ((x1, y1), (x2, y2))
    )
    return (
        f'<line {ends} stroke="#1d262d" stroke-width="6.6" stroke-linecap="round"/>'
        f'<line {ends} stroke="{STRUTS[number - 1]}" stroke-width="5" stroke-linecap="round"/>'
        f"{joints}"
    )


def ball(sweep_deg: float, up: float, ring: str) -> str:
    """A marker ball on its rod."""
    (x, y), (_, foot) = place(ring, sweep_deg, up), place(ring, sweep_deg)
    return (
        f'<line x1="{x:.2f}" y1="{y:.2f}" x2="{x:.2f}" y2="{foot:.2f}" stroke="#6b7a86" '
        'stroke-width="2"/>'
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="5.5" fill="#e6ebf0" stroke="#33404a" '
        'stroke-width="1.2"/>'
        f'<circle cx="{x - 1.7:.2f}" cy="{y - 1.7:.2f}" r="1.6" fill="#ffffff"/>'
    )


def icon_svg() -> str:
    """The whole drawing, the far parts first."""

    def depth(number: int) -> float:
        return sum(math.sin(math.radians(JOINTS[ring][number - 1])) for ring in RINGS)

    order = sorted(range(1, 7), key=depth, reverse=True)
    bone = (
        '<line x1="64" y1="8" x2="64" y2="120" stroke="#b9a981" stroke-width="13"/>'
        '<line x1="64" y1="8" x2="64" y2="120" stroke="#f3e8c6" stroke-width="10"/>'
        '<path d="M57 62 L71 68" stroke="#b9a981" stroke-width="2.4"/>'
    )
    parts = [
        *(half(ring, near=False) for ring in reversed(RINGS)),
        *(strut(number) for number in order if depth(number) > 0),
        bone,
        *(half(ring, near=True) for ring in reversed(RINGS)),
        *(strut(number) for number in order if depth(number) <= 0),
        *(ball(*entry) for entry in BALLS),
    ]
    head = '<svg xmlns="http://www.w3.org/2000/svg" width="128" height="128" viewBox="0 0 128 128">'
    return "\n".join([head, *parts, "</svg>"]) + "\n"


def icon_png(svg: str) -> bytes:
    """The drawing as a PNG on a clear ground, `PIXELS` wide and high."""
    import typst

    size = f"width: {PIXELS}pt, height: {PIXELS}pt"
    page = (
        f"#set page({size}, margin: 0pt, fill: none)\n"
        f'#image(bytes(sys.inputs.svg), format: "svg", {size})\n'
    )
    result = typst.compile(page.encode(), format="png", ppi=72, sys_inputs={"svg": svg})
    if not isinstance(result, bytes):
        raise RuntimeError("the icon is a single page")
    return result


def main(folder: Path) -> None:
    """Write both files."""
    svg = icon_svg()
    (folder / "HexaFixModule.svg").write_text(svg, encoding="utf-8")
    (folder / "HexaFixModule.png").write_bytes(icon_png(svg))


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else HERE)
