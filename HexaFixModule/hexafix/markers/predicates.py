"""What makes a candidate a marker ball: each test names its value and its limit."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from hexafix.imaging.volume import Acquisition, Volume
from hexafix.markers.crop import Crop
from hexafix.markers.directions import neighbour_average, sphere_directions
from hexafix.markers.model import SIGMA_RANGE_MM, ModelFit
from hexafix.markers.rays import DIRECTIONS, RayFit
from hexafix.markers.uncertainty import CLIPPED_CORE

BORDER_MM = 0.75
"""The ball's surface lies at least this far inside the volume (and at least a voxel)."""
RADIUS_MM = 0.15
"""Fitted radius against the nominal one, at voxels up to 0.7 mm."""
CLIPPED_GROWTH_MM = 0.75
"""How much larger a ball looks when its voxels are clipped."""
ROUGHNESS_MM, MASK_ROUGHNESS_MM = 0.09, 0.135
"""RMS distance of the edges from the sphere, at voxels up to 1 mm; the second in masks."""
EDGE_SHARE = 0.80
"""Share of the directions left that have a sound edge on the sphere."""
CUT_SHARE = 0.60
"""Share of directions hidden by metal beyond which a ball is not judged."""
UNIFORMITY = 0.15
"""Median minus 5th percentile of the core, over the contrast, the noise apart."""
HOMOGENEITY = 0.12
"""RMS of the model's residual over the contrast."""
SHARPEST = 1.2
"""A blur below this many times the model's lower bound is no scanner's: the shape is no ball."""
STEM_SHELLS_MM = (0.9, 2.0, 3.5)
"""Where a metal stem is looked for, beyond the ball's radius."""
STEM_SHARE, STEM_GROWTH = 0.8, 0.08
"""A stem is thinner than this share of the ball and widens by less than that between shells."""
CORE_SHARE = 0.22
"""Difference of the core's HU from the others', over their contrast."""


def border_distance_mm(region: Volume | Acquisition, center_mm: NDArray[np.float64]) -> float:
    """Distance of a point, LPS mm, from the nearest face of a grid; its axes may be sheared."""
    inverse = np.linalg.inv(region.ijk_to_lps[:3, :3])
    index = inverse @ (center_mm - region.ijk_to_lps[:3, 3])
    per_mm = np.linalg.norm(inverse, axis=1)
    low, high = (index + 0.5) / per_mm, (np.array(region.size_ijk) - 0.5 - index) / per_mm
    return float(min(low.min(), high.min()))


def border_failure(volume: Volume, center_mm: NDArray[np.float64], radius_mm: float) -> str | None:
    """Reason when the ball is not wholly inside the volume, and inside what was acquired.

    The grid of a tilted series is wider than its slices: what air fills there ends a ball as the
    volume's own faces do.
    """
    limit = radius_mm + max(BORDER_MM, float(volume.spacing_mm.max()))
    regions = {"the volume": volume, "the acquired slices": volume.source.acquisition}
    for name, region in regions.items():
        if region is None:
            continue
        distance = border_distance_mm(region, center_mm)
        if distance < limit:
            return f"border: {distance:.1f} mm from the edge of {name}, limit {limit:.1f} mm"
    return None


def size_failure(found_mm: float, radius_mm: float) -> str | None:
    """Reason when the first look shows another size beyond doubt."""
    wide = 0.15 * radius_mm + 0.45
    if abs(found_mm - radius_mm) <= wide:
        return None
    return (
        f"radius: about {found_mm:.1f} mm, "
        f"limit {radius_mm - wide:.1f} to {radius_mm + wide:.1f} mm at first look"
    )


def shape_failures(
    volume: Volume, rays: RayFit, *, fitted_mm: float, radius_mm: float, slack: float = 1.0
) -> Iterator[str]:
    """Reasons of size and shape.

    Parameters
    ----------
    volume : Volume
    rays : RayFit
    fitted_mm, radius_mm : float
        The fitted radius and the nominal one.
    slack : float
        Factor on the limits; a rough fit is given more than 1.
    """
    thickest = float(volume.spacing_mm.max())
    wide = slack * (RADIUS_MM + 0.06 * max(0.0, thickest - 0.7))
    low, high = radius_mm - wide, radius_mm + wide
    high += CLIPPED_GROWTH_MM if rays.clipped_share > CLIPPED_CORE else 0.0
    if not low <= fitted_mm <= high:
        yield f"radius: {fitted_mm:.2f} mm, limit {low:.2f} to {high:.2f} mm"
    rough = slack * (MASK_ROUGHNESS_MM if rays.is_mask else ROUGHNESS_MM) * max(1.0, thickest)
    if rays.rms_mm > rough:
        yield f"sphericity: surface RMS {rays.rms_mm:.3f} mm, limit {rough:.3f} mm"
    least = EDGE_SHARE / slack
    if rays.edge_share < least:
        yield f"edges: {rays.edge_share:.0%} of the surface, limit {least:.0%}"
    if rays.cut_share > CUT_SHARE:
        yield f"hidden: {rays.cut_share:.0%} of the surface by metal, limit {CUT_SHARE:.0%}"


def model_failures(model: ModelFit | None, rays: RayFit, *, thick: bool) -> Iterator[str]:
    """Reasons of brightness: the core's uniformity and the blurred-ball model.

    A clipped ball in thick slices may have too few voxels left for the model, and is let pass.
    """
    contrast = rays.core_hu - rays.outside_hu
    limit = UNIFORMITY * contrast + 1.65 * rays.core_noise_hu
    if rays.core_hu - rays.core_low_hu > limit:
        yield f"core: {rays.core_hu - rays.core_low_hu:.0f} HU uneven, limit {limit:.0f} HU"
    if model is None:
        if not thick or rays.clipped_share <= CLIPPED_CORE:
            yield "model: the blurred ball does not fit"
        return
    sharpest = SHARPEST * SIGMA_RANGE_MM[0]
    blur = min(model.sigma_plane_mm, model.sigma_slice_mm)
    if blur < sharpest and not rays.is_mask:
        yield f"blur: {blur:.2f} mm, limit {sharpest:.2f} mm"
    noise = rays.core_noise_hu
    limit = HOMOGENEITY * contrast + 1.5 * noise
    if model.rms_hu > limit:
        yield f"residual: {model.rms_hu:.0f} HU, limit {limit:.0f} HU"


def stem_failures(crop: Crop, rays: RayFit, radius_mm: float) -> Iterator[str]:
    """Reason when a metal stem grows out of the ball, as on a strut's ball joint.

    A marker's own rod is far less dense than the ball; a ring is wider, a neighbouring ball grows
    wider from shell to shell, and neither fills the gap to the ball.
    """
    directions = sphere_directions(DIRECTIONS)
    half = rays.outside_hu + 0.5 * (rays.core_hu - rays.outside_hu)
    if rays.shell_hu.max() < half:
        return
    dense, widths = [], []
    for distance in radius_mm + np.array(STEM_SHELLS_MM):
        values = crop.sample(rays.center_mm + distance * directions, order=1)
        dense.append(neighbour_average(DIRECTIONS, 0.08) @ values > half)
        widths.append(distance * np.sin(np.arccos(1.0 - 2.0 * min(0.5, dense[-1].mean()))))
    at_ball, near, far = dense
    if near.sum() < 4 or far.sum() < 3 or at_ball[near].mean() < 0.8:
        return
    axis = directions[near].sum(axis=0) / np.linalg.norm(directions[near].sum(axis=0))
    reach = float(np.arccos(np.clip(np.min(directions[near | far] @ axis), -1.0, 1.0)))
    limit = STEM_SHARE * radius_mm
    compact = reach < 1.5 * np.arcsin(min(1.0, limit / (radius_mm + STEM_SHELLS_MM[1])))
    if compact and widths[1] < limit and widths[2] - widths[1] < STEM_GROWTH * radius_mm:
        yield f"rod: a stem as dense as the ball, radius {widths[1]:.1f} mm, limit {limit:.1f} mm"
