"""What makes a candidate a marker ball: each test names its value and its limit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hexafix.imaging.volume import Volume
from hexafix.markers.crop import Crop
from hexafix.markers.directions import neighbour_average, sphere_directions
from hexafix.markers.model import ModelFit
from hexafix.markers.rays import DIRECTIONS, RayFit

BORDER_MM = 0.75
"""The ball's surface lies at least this far inside the volume (and at least a voxel)."""
RADIUS_MM = 0.15
"""Fitted radius against the nominal one; see `radius_limits`."""
CLIPPED_GROWTH_MM = 0.75
"""How much larger a ball looks when its voxels are clipped."""
ROUGHNESS_MM = 0.10
"""RMS distance of the edges from the sphere, at voxels up to 1 mm."""
EDGE_SHARE = 0.80
"""Share of the directions left that have a sound edge on the sphere."""
CUT_SHARE = 0.60
"""Share of directions hidden by metal beyond which a ball is not judged."""
HOMOGENEITY = 0.12
"""RMS of the model's residual over the contrast."""
CORE_SHARE = 0.22
"""Difference of the core's HU from the others', over their contrast."""


def border_distance_mm(volume: Volume, center_mm: NDArray[np.float64]) -> float:
    """Distance of a point, LPS mm, from the nearest face of the volume."""
    index = volume.ijk_from_lps(center_mm)
    per_mm = np.linalg.norm(np.linalg.inv(volume.ijk_to_lps[:3, :3]), axis=1)
    low, high = (index + 0.5) / per_mm, (np.array(volume.size_ijk) - 0.5 - index) / per_mm
    return float(min(low.min(), high.min()))


def border_failure(volume: Volume, center_mm: NDArray[np.float64], radius_mm: float) -> str | None:
    """Reason when the ball is not wholly inside the volume."""
    limit = radius_mm + max(BORDER_MM, float(volume.spacing_mm.max()))
    distance = border_distance_mm(volume, center_mm)
    if distance >= limit:
        return None
    return f"border: {distance:.1f} mm from the edge of the volume, limit {limit:.1f} mm"


def radius_limits(volume: Volume, *, clipped: bool) -> tuple[float, float]:
    """Least and greatest fitted minus nominal radius, mm."""
    coarse = 0.06 * max(0.0, float(volume.spacing_mm.max()) - 0.7)
    wide = RADIUS_MM + coarse
    return -wide, wide + (CLIPPED_GROWTH_MM if clipped else 0.0)


def shape_failures(
    volume: Volume, rays: RayFit, *, fitted_mm: float, radius_mm: float, clipped: bool
) -> Iterator[str]:
    """Reasons of size and shape."""
    low, high = radius_limits(volume, clipped=clipped)
    if not low <= fitted_mm - radius_mm <= high:
        yield (
            f"radius: {fitted_mm:.2f} mm, limit {radius_mm + low:.2f} to {radius_mm + high:.2f} mm"
        )
    rough = ROUGHNESS_MM * max(1.0, float(volume.spacing_mm.max()))
    if rays.rms_mm > rough:
        yield f"sphericity: surface RMS {rays.rms_mm:.3f} mm, limit {rough:.3f} mm"
    if rays.edge_share < EDGE_SHARE:
        yield f"edges: {rays.edge_share:.0%} of the surface, limit {EDGE_SHARE:.0%}"
    if rays.cut_share > CUT_SHARE:
        yield f"hidden: {rays.cut_share:.0%} of the surface by metal, limit {CUT_SHARE:.0%}"


def model_failures(model: ModelFit | None, rays: RayFit) -> Iterator[str]:
    """Reasons of the blurred-ball model."""
    contrast = rays.core_hu - rays.outside_hu
    if model is None:
        yield "model: the blurred ball does not fit"
        return
    noise = rays.core_noise_hu
    limit = HOMOGENEITY * contrast + 1.5 * noise
    if model.rms_hu > limit:
        yield f"residual: {model.rms_hu:.0f} HU, limit {limit:.0f} HU"


def stem_failure(crop: Crop, rays: RayFit, radius_mm: float) -> str | None:
    """Reason when a metal stem grows out of the ball, as on a strut's ball joint.

    A marker's own rod is far less dense than the ball; a ring or a neighbouring ball is wider.
    """
    directions = sphere_directions(DIRECTIONS)
    half = rays.outside_hu + 0.5 * (rays.core_hu - rays.outside_hu)
    if rays.shell_hu.max() < half:
        return None
    patches = []
    for distance in (radius_mm + 2.0, radius_mm + 3.5):
        values = crop.sample(rays.center_mm + distance * directions)
        patches.append(neighbour_average(DIRECTIONS, 0.08) @ values > half)
    near, far = patches
    if near.mean() < 0.005 or far.mean() < 0.002:
        return None
    axis = directions[near].sum(axis=0)
    axis /= np.linalg.norm(axis)
    if directions[far].sum(axis=0) @ axis < 0.95 * np.linalg.norm(directions[far].sum(axis=0)):
        return None
    width = 0.0
    for patch, distance in ((near, radius_mm + 2.0), (far, radius_mm + 3.5)):
        spread = np.sqrt(max(0.0, 1.0 - float(np.min(directions[patch] @ axis)) ** 2))
        if np.min(directions[patch] @ axis) < 0.3:
            return None
        width = max(width, distance * spread)
    limit = 0.8 * radius_mm
    if width > limit:
        return None
    return (
        f"rod: a stem as dense as the ball, {width:.1f} mm in radius, "
        f"limit: no metal narrower than {limit:.1f} mm"
    )
