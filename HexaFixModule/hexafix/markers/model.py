"""The ball as a model of all its voxels: a blurred ball between two smooth backgrounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

from hexafix.markers.crop import Crop

INSIDE_MM, OUTSIDE_MM = 2.5, 2.0
"""Voxels from this far inside to this far outside the nominal radius take part."""
MOST_VOXELS = 1200
"""More voxels than these are thinned evenly; the gate needs no more."""
CUT_MARGIN_RAD = 0.07
"""Half the distance of neighbouring rays, about."""
TUKEY = 4.685
MOST_STEPS, SETTLED_MM, NEARLY_SETTLED_MM = 25, 5e-4, 5e-3
"""Steps at most; a centre that moves less than the first is settled. Few voxels beside a clipped
core can make the weights waver: after the last step the second is enough for a gate."""

SIGMA_RANGE_MM = (0.15, 3.0)


@dataclass(frozen=True, eq=False)
class ModelFit:
    """The model's parameters at the least squares solution.

    Attributes
    ----------
    center_mm : ndarray, shape (3,)
        LPS mm.
    radius_mm, sigma_plane_mm, sigma_slice_mm : float
        Ball radius and Gaussian blur across and along the slice normal.
    contrast_hu : float
        Ball minus surroundings at the ball's surface.
    rms_hu : float
        Weighted RMS residual.
    covariance_mm2 : ndarray, shape (3, 3)
        Of the centre by the normal matrix, LPS.
    """

    center_mm: NDArray[np.float64]
    radius_mm: float
    sigma_plane_mm: float
    sigma_slice_mm: float
    contrast_hu: float
    rms_hu: float
    covariance_mm2: NDArray[np.float64]


def fit_model(
    crop: Crop,
    start_mm: NDArray[np.float64],
    radius_mm: float,
    *,
    cut: NDArray[np.float64],
    clip_hu: float | None,
    all_voxels: bool = False,
) -> ModelFit | None:
    """Fit the blurred ball; None when the fit does not settle.

    Parameters
    ----------
    crop : Crop
    start_mm : ndarray, shape (3,)
        Centre to a fraction of a voxel, LPS mm.
    radius_mm : float
        Nominal radius; held when voxels are clipped.
    cut : ndarray, shape (n, 3)
        Unit directions whose surroundings are left out.
    clip_hu : float or None
        Voxels at this value or above tell nothing.
    all_voxels : bool
        Take every voxel of the band instead of `MOST_VOXELS`.
    """
    points, values = _band(crop, start_mm, radius_mm, cut, clip_hu, all_voxels)
    if len(values) < 80:
        return None
    axis, nodes, weights = _slice_profile(crop)
    state = np.array([0.0, 0.0, 0.0, radius_mm, 0.6, 0.7])
    free = np.array([1, 1, 1, clip_hu is None, 1, 1], bool)
    basis = _polynomials(points / radius_mm)
    linear, tukey = np.zeros(14), np.ones(len(values))
    rise, residual, normal, moved = tukey, values, np.eye(14), np.inf
    for step in range(MOST_STEPS):
        share, slope = _ball_and_slopes(points, state, axis, nodes, weights)
        columns = np.hstack([basis[:, :4] * share[:, None], basis * (1.0 - share)[:, None]])
        if step == 0:
            linear = _step(columns, values, tukey)[0]
        residual = values - columns @ linear
        if step >= 2:
            tukey = _tukey(residual)
        rise = basis[:, :4] @ linear[:4] - basis @ linear[4:]
        jacobian = np.hstack([slope[:, free] * rise[:, None], columns])
        change, normal = _step(jacobian, residual, tukey)
        linear = linear + change[free.sum() :]
        state[free] += np.clip(change[: free.sum()], -0.4, 0.4)
        state[4:] = np.clip(state[4:], *SIGMA_RANGE_MM)
        moved = float(np.abs(change[:3]).max())
        if step > 2 and moved < SETTLED_MM:
            break
    if not moved < NEARLY_SETTLED_MM or np.linalg.norm(state[:3]) > 0.5 * radius_mm:
        return None
    square = float(np.sum(tukey * residual**2) / max(1.0, np.sum(tukey)))
    covariance = np.asarray(square * np.linalg.inv(normal)[:3, :3], float)
    center, (radius, plane, along) = np.asarray(start_mm) + state[:3], state[3:].tolist()
    contrast = float(np.median(rise))
    return ModelFit(center, radius, plane, along, contrast, square**0.5, covariance)


def _tukey(residual: NDArray[np.float64]) -> NDArray[np.float64]:
    """Tukey's weights about the residuals' own scale."""
    scale = 1.4826 * float(np.median(np.abs(residual))) + 1e-6
    return np.maximum(1.0 - (residual / (TUKEY * scale)) ** 2, 0.0) ** 2


def _band(
    crop: Crop,
    start: NDArray[np.float64],
    radius: float,
    cut: NDArray[np.float64],
    clip_hu: float | None,
    all_voxels: bool,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points relative to the start, mm, and HU of the voxels that take part."""
    points = crop.points_mm.reshape(-1, 3) - start
    values = crop.voxels.reshape(-1)
    square = np.einsum("ni,ni->n", points, points)
    take = (square > max(0.0, radius - INSIDE_MM) ** 2) & (square < (radius + OUTSIDE_MM) ** 2)
    if clip_hu is not None:
        take &= ~crop.clipped(clip_hu).reshape(-1)
    points, values = points[take], values[take]
    if not all_voxels and len(values) > 1.5 * MOST_VOXELS:
        thin = round(len(values) / MOST_VOXELS)
        points, values = points[::thin], values[::thin]
    if len(cut):
        closest = (points.astype(np.float32) @ cut.T.astype(np.float32)).max(axis=1)
        take = closest < np.cos(CUT_MARGIN_RAD) * np.linalg.norm(points, axis=1)
        points, values = points[take], values[take]
    return points, values


def _slice_profile(
    crop: Crop,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Slice normal, and Gauss–Legendre offsets (mm) and weights over the slice thickness."""
    spacing = crop.volume.spacing_mm
    odd = int(np.argmax(np.abs(spacing - np.median(spacing)) + 1e-9 * np.array([0, 0, 1])))
    thickness = max(spacing[odd], crop.volume.source.slice_thickness_mm or 0.0)
    nodes, weights = np.polynomial.legendre.leggauss(1 if thickness <= 1.0 else 5)
    return crop.volume.direction[:, odd], 0.5 * thickness * nodes, 0.5 * weights


def _ball_and_slopes(
    points: NDArray[np.float64],
    state: NDArray[np.float64],
    axis: NDArray[np.float64],
    nodes: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The ball's share of each voxel, shape (n,), and its derivatives by the state, (n, 6).

    Closed form of `geometry.blurred_ball` without the far side's terms, which are below 1e-6
    for a radius of four σ and more; σ varies with the direction between plane and slice normal.
    """
    share, slope = np.zeros(len(points)), np.zeros((len(points), 6))
    center, radius, plane, along = state[:3], state[3], state[4], state[5]
    for node, weight in zip(nodes, weights, strict=True):
        away = points - center + node * axis
        r = np.maximum(np.linalg.norm(away, axis=1), 1e-3)
        unit = away / r[:, None]
        tilt = (unit @ axis) ** 2
        sigma = np.sqrt(plane**2 * (1.0 - tilt) + along**2 * tilt)
        bell = np.exp(-0.5 * ((radius - r) / sigma) ** 2) / (np.sqrt(2 * np.pi) * sigma)
        share += weight * (
            0.5 * (1.0 + scipy.special.erf((radius - r) / (np.sqrt(2.0) * sigma)))
            - sigma**2 / r * bell
        )
        by_r = bell * (-radius / r + (sigma / r) ** 2)
        by_sigma = (radius - r) / sigma * by_r - bell * sigma * radius / r**2
        slope[:, :3] -= weight * by_r[:, None] * unit
        slope[:, 3] += weight * bell * radius / r
        slope[:, 4] += weight * by_sigma * plane * (1.0 - tilt) / sigma
        slope[:, 5] += weight * by_sigma * along * tilt / sigma
    return share, slope


def _polynomials(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Degree 2 in three variables, the first four columns degree 1, shape (n, 10)."""
    a, b, c = x.T
    return np.stack([np.ones_like(a), a, b, c, a * a, b * b, c * c, a * b, a * c, b * c], axis=-1)


def _step(
    columns: NDArray[np.float64], values: NDArray[np.float64], weight: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weighted least squares by the slightly damped normal equations: solution and matrix."""
    weighted = weight[:, None] * columns
    normal = columns.T @ weighted
    diagonal = np.diag_indices_from(normal)
    normal[diagonal] += 1e-7 * normal[diagonal] + 1e-9
    return np.asarray(np.linalg.solve(normal, weighted.T @ values), float), normal
