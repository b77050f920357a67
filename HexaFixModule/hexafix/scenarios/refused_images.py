"""Images that must be refused: mirrored, incomplete, scaled, cut, or not to be told apart."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Literal

import numpy as np

from hexafix.scenarios import changes, layouts
from hexafix.scenarios.scenario import Refusal, Scenario

_scenario = partial(Scenario, theme="image to be refused")

UPSIDE_DOWN = Refusal({"rings-swapped": "H20", "ring-axis": "H21", "not-towards-head": "H21"})
"""Balls in one plane fit their mirror image: every ring then comes out upside down."""


def _mirrored(number: int, axis: Literal["i", "j", "k"], *, flat: bool) -> Scenario:
    along = {"i": "left and right", "j": "front and back", "k": "head and feet"}[axis]
    known = "balls in one plane" if flat else "with balls out of plane"
    balls: Mapping[str, Any] = layouts.balls(3, 3) if flat else layouts.balls(4, 4)
    return _scenario(
        number=number,
        title=f"mirrored image, {along} exchanged, {known}",
        phantom={"side": "left", "bone": "tibia", **balls},
        volume=(changes.mirrored(axis),),
        refusal=UPSIDE_DOWN if flat else Refusal({"mirrored-balls": "H01"}),
    )


SCENARIOS = (
    _mirrored(79, "i", flat=False),
    _mirrored(80, "j", flat=False),
    _mirrored(81, "k", flat=False),
    _mirrored(82, "i", flat=True),
    _mirrored(83, "j", flat=True),
    _mirrored(84, "k", flat=True),
    _scenario(
        number=85,
        title="one slice lost",
        phantom={"side": "right", "bone": "tibia"},
        folder=(changes.lost_slice,),
        refusal=Refusal({"missing-slice": "H03"}),
    ),
    _scenario(
        number=86,
        title="the upper half of the slices 0.4 mm off",
        phantom={"side": "left", "bone": "tibia"},
        folder=(changes.uneven_spacing,),
        refusal=Refusal({"uneven-spacing": "H03"}),
    ),
    _scenario(
        number=87,
        title="gantry tilted by 15° and one slice lost",
        phantom={
            "side": "left",
            "bone": "tibia",
            "gantry_tilt_rad": float(np.radians(15.0)),
        },
        folder=(changes.lost_slice,),
        refusal=Refusal({"missing-slice": "H03", "gantry-tilt": "H02"}),
    ),
    _scenario(
        number=88,
        title="PixelSpacing 1 % too large",
        phantom={"side": "right", "bone": "tibia"},
        folder=(changes.pixel_spacing_scaled(1.01),),
        refusal=Refusal({"ring-not-found": "H15"}),
    ),
    _scenario(
        number=89,
        title="positions stripped from the headers",
        phantom={"side": "left", "bone": "tibia"},
        folder=(changes.without_geometry,),
        refusal=Refusal({"no-geometry": "H07"}),
    ),
    _scenario(
        number=90,
        title="two frames of reference in one series",
        phantom={"side": "right", "bone": "tibia"},
        folder=(changes.two_frames_of_reference,),
        refusal=Refusal({"mixed-frame-of-reference": "H05"}),
    ),
    _scenario(
        number=91,
        title="two series in the folder and none named",
        phantom={"side": "left", "bone": "tibia"},
        folder=(changes.second_series,),
        refusal=Refusal({"several-series": "H05"}),
    ),
    _scenario(
        number=92,
        title="a ball cut by the field of view",
        margin_mm=-7.0,
        phantom={"side": "right", "bone": "tibia", "partial_frame": True},
        refusal=Refusal({"ring-not-found": "H13"}),
    ),
    _scenario(
        number=93,
        title="the other limb was scanned: no ball in the image",
        phantom={
            "side": "left",
            "bone": "tibia",
            "partial_frame": True,
            "size_ijk": (90, 90, 60),
            "image_center_mm": (430.0, 300.0, 200.0),
        },
        refusal=Refusal({"ring-not-found": "H12"}),
    ),
)
