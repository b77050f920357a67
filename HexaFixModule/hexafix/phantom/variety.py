"""Random specs for benchmarks: every seed another scan of another frame on another deformity."""

from __future__ import annotations

from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np

from hexafix.errors import InputError
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.phantom.make import check_buildable
from hexafix.phantom.scene import build_scene
from hexafix.phantom.spec import PhantomSpec
from hexafix.recognition.rigid import rigid_rms_mm

TRIES = 100
SURE_NUMBERS_MM = 10.0
"""Least RMS of a drawn layout against itself under wrong numbers: the numbering must be sure."""


def random_spec(seed: int, **knobs: Any) -> PhantomSpec:
    """A spec that can be built: oblique image, off-origin frame, random deformity and layouts.

    Parameters
    ----------
    seed : int
        Decides everything; also the spec's own seed.
    **knobs
        Fields of `PhantomSpec` that are not to be random.

    Raises
    ------
    InputError
        If no frame that can be built turned up with these knobs; says what was wrong last.
    """
    rng = np.random.default_rng([seed, 3])
    for attempt in range(TRIES):
        spec = replace(PhantomSpec(seed=seed), **{**_drawn(rng), **knobs})
        try:
            check_buildable(spec, build_scene(spec))
        except InputError:
            if attempt == TRIES - 1:
                raise
            continue
        free = [layout for name, layout in _layouts(spec) if name not in knobs]
        if all(relabelling_rms_mm(layout) >= SURE_NUMBERS_MM for layout in free):
            return spec
    raise InputError.of(
        "phantom-layout",
        "no layout turned up whose numbers are sure",
        limit=f"at least {SURE_NUMBERS_MM} mm RMS under wrong numbers",
        next_step="give the layouts as knobs",
    )


def relabelling_rms_mm(layout: MarkerLayout) -> float:
    """Smallest RMS of a layout against itself under any wrong numbers, mm; up to 7 markers."""
    points = layout.points_mm
    orders = np.array(list(permutations(range(len(points)))))[1:]
    repeated = np.broadcast_to(points, (len(orders), *points.shape))
    return float(rigid_rms_mm(points_mm=points[orders], layout_mm=repeated).min())


def _layouts(spec: PhantomSpec) -> tuple[tuple[str, MarkerLayout], ...]:
    return ("proximal", spec.proximal), ("distal", spec.distal)


def _drawn(rng: np.random.Generator) -> dict[str, Any]:
    """One draw of everything that varies from scan to scan."""
    turn, tilt = rng.uniform(-0.6, 0.6), rng.uniform(-0.07, 0.07, 2)
    angles = (float(tilt[0]), float(tilt[1]), float(-np.pi / 2.0 + turn))
    defaults = PhantomSpec()
    return {
        "image_angles_rad": tuple(float(a) for a in rng.uniform(-0.07, 0.07, 3)),
        "ring_b_pose": Pose.from_xyz_fixed(
            position_mm=rng.uniform(-300.0, 300.0, 3), angles_rad=angles
        ),
        "mechanism_pose": Pose.from_xyz_fixed(
            position_mm=np.array([0.0, 0.0, 180.0]) + rng.uniform(-9.0, 9.0, 3),
            angles_rad=rng.uniform(-0.12, 0.12, 3),
        ),
        "proximal": _shifted(defaults.proximal, rng),
        "distal": _shifted(defaults.distal, rng),
        "side": str(rng.choice(["left", "right"])),
        "bone": str(rng.choice(["tibia", "femur"])),
    }


def _shifted(layout: MarkerLayout, rng: np.random.Generator) -> MarkerLayout:
    """The layout with every marker in another hole nearby."""
    return MarkerLayout.of(
        radius_mm=[site.radius_mm + 2.5 * rng.integers(-2, 3) for site in layout.sites],
        sweep_deg=[np.degrees(site.sweep_rad) + rng.uniform(-6.0, 6.0) for site in layout.sites],
        height_mm=[site.height_mm for site in layout.sites],
        first_number=layout.sites[0].number,
    )
