"""The ball's centre from the steepest gradient along rays, the rod's side left out.

Edges are cut in antipodal pairs, so that cupping and blur act on the radius and not on the centre.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.markers.crop import Crop
from hexafix.markers.directions import neighbour_average, sphere_directions

DIRECTIONS = 600
ROUGH, FINE = (200, 1.75), (DIRECTIONS, 1.0)
"""Directions, and greatest distance of an edge from the radius in mm, of the two passes."""
MOST_PASSES = 3
SETTLED_MM = 0.05
"""A longer last step asks for one more pass."""
STEP_MM = 0.25
HALF_KERNEL = 4
SHELL_MM = np.array([1.9, 2.4, 2.9])
"""Where the surroundings are looked at, beyond the nominal radius."""
SMOOTH_MM = 0.35
"""Gaussian smoothing along a ray before the gradient is taken."""
SMOOTH_RAD = 0.08
"""Gaussian smoothing across neighbouring rays."""
WEAK_SHARE = 0.4
"""Edges weaker than this share of the median are dropped."""
TUKEY = 4.685
MARGIN_RAD = 0.31
"""Widening of the rod's side: its cone opens from the shell to the ball, and it is blurred."""
FEW_LEFT = 0.45
"""With fewer directions left than this share, antipodes of cut directions are kept."""


@dataclass(frozen=True, eq=False)
class RayFit:
    """Sphere through the edge points of the rays.

    Attributes
    ----------
    center_mm : ndarray, shape (3,)
        LPS mm.
    radius_mm : float
        Of the steepest gradient.
    residual_mm : ndarray, shape (DIRECTIONS,)
        Edge distance minus radius, NaN where the direction was cut or has no edge.
    weight : ndarray, shape (DIRECTIONS,)
        Tukey weights, 0 where there is no edge.
    rms_mm : float
        Weighted RMS residual.
    normal : ndarray, shape (4, 4)
        Normal matrix of centre and radius.
    core_hu, outside_hu : float
        Median inside, half-sample mode of the shell outside.
    cut : ndarray of bool, shape (DIRECTIONS,)
        Directions left out as rod or metal.
    cut_share, edge_share : float
        Shares of all directions cut as rod or metal, and of the remaining ones with a sound edge.
    shell_hu : ndarray, shape (DIRECTIONS,)
        Mean brightness outside the ball.
    core_noise_hu : float
        Robust standard deviation of the HU inside.
    clipped_share : float
        Share of the core at the greatest value of the crop.
    core_low_hu : float
        5th percentile inside.
    is_mask : bool
        Whether the image is segmented, not a CT: its surfaces are stairs.
    """

    center_mm: NDArray[np.float64]
    radius_mm: float
    residual_mm: NDArray[np.float64]
    weight: NDArray[np.float64]
    rms_mm: float
    normal: NDArray[np.float64]
    core_hu: float
    outside_hu: float
    cut: NDArray[np.bool_]
    cut_share: float
    edge_share: float
    shell_hu: NDArray[np.float64]
    core_noise_hu: float
    clipped_share: float
    core_low_hu: float
    is_mask: bool


def half_sample_mode(values: NDArray[np.float64]) -> float:
    """The mode by halving: the densest half again and again."""
    data = np.sort(np.asarray(values, float).ravel())
    while len(data) > 3:
        half = (len(data) + 1) // 2
        width = data[half - 1 :] - data[: len(data) - half + 1]
        start = int(np.argmin(width))
        data = data[start : start + half]
    return float(data.mean())


def rough_fit(crop: Crop, start_mm: NDArray[np.float64], radius_mm: float) -> RayFit | None:
    """A quick first sphere of about the given radius; None when too few rays have an edge.

    Parameters
    ----------
    crop : Crop
    start_mm : ndarray, shape (3,)
        Centre to about a voxel, LPS mm.
    radius_mm : float
        Nominal radius.
    """
    return _one_pass(crop, start_mm, radius_mm, radius_mm, fine=False)


def fine_fit(crop: Crop, rough: RayFit, radius_mm: float) -> RayFit | None:
    """The sphere through all rays, from a rough one; arguments as in `rough_fit`."""
    before, fit = rough, _one_pass(crop, rough.center_mm, rough.radius_mm, radius_mm, fine=True)
    for _ in range(MOST_PASSES - 1):
        if fit is None or np.linalg.norm(fit.center_mm - before.center_mm) < SETTLED_MM:
            break
        before, fit = fit, _one_pass(crop, fit.center_mm, fit.radius_mm, radius_mm, fine=True)
    return fit


def _one_pass(
    crop: Crop,
    center: NDArray[np.float64],
    radius: float,
    nominal: float,
    *,
    fine: bool,
) -> RayFit | None:
    """Rays from one centre, edges near a radius, and the sphere through them."""
    count, window = FINE if fine else ROUGH
    directions = sphere_directions(count)
    half = HALF_KERNEL + round(window / STEP_MM)
    distance = radius + STEP_MM * np.arange(-half, half + 1)
    distance = np.asarray(distance[distance > 0.1 * radius], float)
    profile = crop.sample(center + directions[:, None, :] * distance[:, None])
    core_hu, core_noise, clipped, core_low = crop.core(center, 0.6 * nominal)
    away = nominal + SHELL_MM[:, None, None]
    shell = crop.sample(center + directions * away, order=1).mean(axis=0)
    outside = half_sample_mode(shell)
    reach, strength = _steepest(neighbour_average(count, SMOOTH_RAD) @ profile, distance)
    cut = _bright_side(shell, outside, core_hu)
    sound = np.isfinite(reach) & (strength >= WEAK_SHARE * np.median(strength))
    usable = sound & ~cut
    if usable.sum() < 0.2 * count:
        return None
    new_center, size, residual, weight, normal = _sphere(center, directions, reach, usable)
    return RayFit(
        center_mm=new_center,
        radius_mm=size,
        residual_mm=np.where(usable, residual, np.nan),
        weight=weight,
        rms_mm=float(np.sqrt(np.sum(weight * residual**2) / np.sum(weight))),
        normal=normal,
        core_hu=core_hu,
        outside_hu=outside,
        cut=cut,
        cut_share=float(cut.mean()),
        edge_share=float((weight > 0).sum() / max(1, (~cut).sum())),
        shell_hu=shell,
        core_noise_hu=core_noise,
        clipped_share=clipped,
        core_low_hu=core_low,
        is_mask=crop.is_mask,
    )


def _steepest(
    profile: NDArray[np.float64], distance: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Distance and strength of the steepest fall along each ray, NaN where there is none."""
    offsets = STEP_MM * np.arange(-HALF_KERNEL, HALF_KERNEL + 1)
    kernel = offsets * np.exp(-0.5 * (offsets / SMOOTH_MM) ** 2)
    kernel /= -np.sum(kernel * offsets)
    fall = np.lib.stride_tricks.sliding_window_view(profile, len(kernel), axis=1) @ kernel
    place = distance[HALF_KERNEL:-HALF_KERNEL]
    best = np.argmax(fall, axis=1)
    inner = np.clip(best, 1, fall.shape[1] - 2)
    rows = np.arange(len(fall))
    left, mid, right = fall[rows, inner - 1], fall[rows, inner], fall[rows, inner + 1]
    bend = left - 2 * mid + right
    shift = np.where(bend < 0, 0.5 * (left - right) / np.where(bend < 0, bend, -1.0), 0.0)
    reach = place[inner] + np.clip(shift, -1, 1) * STEP_MM
    strength = np.maximum(fall[rows, best], 0.0)
    return np.where((best == inner) & (strength > 0), reach, np.nan), strength


def _bright_side(shell: NDArray[np.float64], outside: float, core_hu: float) -> NDArray[np.bool_]:
    """Directions of the rod or of metal, widened to a margin, and their antipodes."""
    directions = sphere_directions(len(shell))
    mild = neighbour_average(len(shell), 0.12) @ shell
    noise = 1.4826 * float(np.median(np.abs(mild - np.median(mild))))
    limit = outside + max(4.0 * noise, 0.02 * (core_hu - outside))
    bright = mild > limit
    if bright.mean() > 0.35:
        bright = mild > outside + 0.4 * (core_hu - outside)
    if not bright.any():
        return np.zeros(len(shell), bool)
    wide = (directions @ directions[bright].T).max(axis=1) > np.cos(MARGIN_RAD)
    both = wide | np.roll(wide, len(shell) // 2)
    return both if 1.0 - both.mean() >= FEW_LEFT else wide


def _sphere(
    center: NDArray[np.float64],
    directions: NDArray[np.float64],
    reach: NDArray[np.float64],
    usable: NDArray[np.bool_],
) -> tuple[NDArray, float, NDArray, NDArray, NDArray]:
    """Geometric sphere fit with Tukey weights: centre, radius, residuals, weights, normal."""
    points = np.where(usable, reach, 0.0)[:, None] * directions
    shift, size = np.zeros(3), float(np.median(reach[usable]))
    weight = usable.astype(float)
    residual = np.zeros(len(points))
    normal = np.eye(4)
    for _ in range(10):
        away = points - shift
        length = np.maximum(np.sqrt(np.einsum("ni,ni->n", away, away)), 1e-9)
        residual = np.where(usable, length - size, 0.0)
        scale = 1.4826 * float(np.median(np.abs(residual[usable]))) + 1e-4
        weight = usable * np.maximum(1.0 - (residual / (TUKEY * scale)) ** 2, 0.0) ** 2
        rows = np.column_stack([away / length[:, None], np.ones(len(points))])
        normal = rows.T @ (weight[:, None] * rows)
        normal[np.diag_indices(4)] += 1e-9
        change = np.linalg.solve(normal, rows.T @ (weight * residual))
        shift, size = shift + change[:3], size + float(change[3])
        if np.abs(change).max() < 2e-4:
            break
    return center + shift, size, residual, weight, normal
