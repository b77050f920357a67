"""Dark and bright bands between metal parts, as an under-sampled, beam-hardened scan shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.phantom.scene import Scene
from hexafix.phantom.solids import Array, Grid, box_in_slab, frame_along, local_coordinates
from hexafix.phantom.spec import PhantomSpec

SAME_SLICE_MM = 14.0
"""Metal parts this near along the slice normal throw streaks at each other."""


@dataclass(frozen=True, eq=False)
class Streak:
    """One band.

    Attributes
    ----------
    start_mm, end_mm : ndarray, shape (3,)
        The two metal parts, LPS.
    amplitude_hu : float
        Negative: dark with bright rims.
    width_mm, depth_mm : float
        Standard deviations across the band, in the slice and along its normal.
    """

    start_mm: NDArray[np.float64]
    end_mm: NDArray[np.float64]
    amplitude_hu: float
    width_mm: float = 2.5
    depth_mm: float = 3.0


def streaks_of(spec: PhantomSpec, scene: Scene) -> list[Streak]:
    """Bands between steel joints and marker balls that lie in nearly the same slices."""
    if spec.streak_hu <= 0.0:
        return []
    normal = scene.grid.axes[:, 2]
    metal = np.concatenate(
        [scene.joints_a_mm, scene.joints_b_mm, np.array(list(scene.balls_mm.values()))]
    )
    joints = 12
    streaks = []
    for first in range(joints):
        for second in range(first + 1, len(metal)):
            line = metal[second] - metal[first]
            if abs(line @ normal) > SAME_SLICE_MM or np.linalg.norm(line) < 15.0:
                continue
            sign = -1.0 if (first + second) % 3 else 0.7
            weight = spec.streak_hu * (1.0 if second < joints else 0.6)
            streaks.append(Streak(metal[first], metal[second], sign * weight))
    return streaks


def add_streak(slab: Array, first_slice: int, streak: Streak, grid: Grid) -> None:
    """Add one band to a slab.

    Parameters
    ----------
    slab : ndarray, shape (K, J, I), float32
        HU, changed in place.
    first_slice : int
    streak : Streak
    grid : Grid
    """
    pose = frame_along(streak.start_mm, streak.end_mm)
    length = float(np.linalg.norm(streak.end_mm - streak.start_mm))
    wide = 4.0 * max(streak.width_mm, streak.depth_mm)
    low, high = (-wide, -wide, -30.0), (wide, wide, length + 30.0)
    ranges = box_in_slab(pose, low, high, 0.0, grid, slab.shape[0], first_slice)
    if ranges is None:
        return
    i, j, k = ranges
    x, y, z = local_coordinates(pose, i, j, k, 0.0, grid)
    normal = pose.rotation.T @ grid.axes[:, 2]
    flat = np.hypot(normal[0], normal[1])
    deep = (normal[0] * x + normal[1] * y) / np.float32(flat)
    across = (normal[1] * x - normal[0] * y) / np.float32(flat * streak.width_mm)
    beyond = np.maximum(np.maximum(-z, z - np.float32(length)), 0.0) / np.float32(12.0)
    square = across * across
    band = (1.0 - 0.6 * square) * np.exp(-0.5 * square)
    fade = np.exp(-0.5 * (deep / np.float32(streak.depth_mm)) ** 2 - 0.5 * beyond * beyond)
    window = slab[k.start - first_slice : k.stop - first_slice, j.start : j.stop, i.start : i.stop]
    window += (np.float32(streak.amplitude_hu) * band * fade).astype(np.float32)
