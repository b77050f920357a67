"""Voxels, slices, sharpness, noise and metal."""

from __future__ import annotations

from functools import partial

from hexafix.scenarios import layouts
from hexafix.scenarios.scenario import Scenario

_scenario = partial(Scenario, theme="image quality")

STEEL_HU = 8000.0


def _voxels(
    number: int, spacing_mm: tuple[float, float, float], thickness_mm: float, **phantom: object
) -> Scenario:
    size = " x ".join(f"{pitch:g}" for pitch in spacing_mm)
    return _scenario(
        number=number,
        title=f"voxels of {size} mm, slices {thickness_mm:g} mm thick",
        phantom={
            "side": ("left", "right")[number % 2],
            "bone": "tibia",
            "spacing_mm": spacing_mm,
            "slice_thickness_mm": thickness_mm,
            **phantom,
        },
    )


SCENARIOS = (
    _voxels(35, (0.5, 0.5, 1.0), 1.0, noise_hu=60.0, **layouts.balls(3, 3, radius_mm=82.0)),
    _voxels(36, (0.8, 0.8, 1.0), 1.0),
    _voxels(37, (1.3, 0.7, 1.0), 1.0),
    _voxels(38, (0.9, 0.9, 1.2), 2.4),
    _voxels(39, (1.0, 1.0, 2.0), 2.0),
    _voxels(40, (1.7, 1.7, 1.5), 1.5),
    _scenario(
        number=41,
        title="a smooth kernel (point spread of 0.9 mm)",
        phantom={"side": "left", "bone": "tibia", "psf_sigma_mm": 0.9},
    ),
    _scenario(
        number=42,
        title="a sharp kernel (point spread of 0.35 mm), 10 HU of noise",
        phantom={"side": "right", "bone": "tibia", "psf_sigma_mm": 0.35, "noise_hu": 10.0},
    ),
    _scenario(
        number=43,
        title="100 HU of noise (low dose)",
        phantom={"side": "left", "bone": "femur", "noise_hu": 100.0},
    ),
    _scenario(
        number=44,
        title="metal streaks of 150 HU",
        phantom={"side": "right", "bone": "tibia", "streak_hu": 150.0},
    ),
    _scenario(
        number=45,
        title="metal streaks of 300 HU, 60 HU of noise, carbon rings",
        phantom={
            "side": "left",
            "bone": "tibia",
            "streak_hu": 300.0,
            "noise_hu": 60.0,
            "ring_material": "carbon",
        },
    ),
    _scenario(
        number=46,
        title="steel balls, saturated at 3071 HU",
        phantom={"side": "right", "bone": "tibia", "ball_hu": STEEL_HU},
    ),
    _scenario(
        number=47,
        title="steel balls with an extended scale",
        phantom={"side": "left", "bone": "tibia", "ball_hu": STEEL_HU, "clip_hu": None},
    ),
    _scenario(
        number=48,
        title="carbon rings; table and every decoy in a wide field of view",
        margin_mm=48.0,
        phantom={
            "side": "right",
            "bone": "femur",
            "ring_material": "carbon",
            "spacing_mm": (1.2, 1.2, 1.5),
        },
    ),
    _scenario(
        number=49,
        title="a frame on the bench: no limb, no table, no decoys",
        phantom={
            "side": "left",
            "bone": "tibia",
            "limb": False,
            "table": False,
            "decoys": False,
        },
    ),
)
