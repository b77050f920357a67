"""All marker balls of one diameter in a whole volume."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import InputError
from hexafix.imaging.volume import Volume
from hexafix.markers import predicates
from hexafix.markers.ball import Ball, BallSet, Rejected
from hexafix.markers.crop import Crop
from hexafix.markers.directions import sphere_directions
from hexafix.markers.model import ModelFit, fit_model
from hexafix.markers.rays import DIRECTIONS, RayFit, fine_fit, rough_fit
from hexafix.markers.search import candidate_centers
from hexafix.markers.uncertainty import CLIPPED_CORE, centre_covariance
from hexafix.progress import Progress, silent

THICK_SLICES_MM = 2.0
"""Above this the model fit gives the centre, and a warning."""
FEWEST_SLICES = 2.5
"""A ball that fewer slices cross than these can be fitted between them in more than one place: in
5 mm slices one of 10 mm was 0.55 mm off."""
CLIPPED_SHARE = 0.20
"""Share of clipped voxels in a ball that is warned about."""
DISAGREEMENT_MM = 0.06
"""Rays and model farther apart than this (and 4 σ) are warned about."""
MOST_LOCAL = 96
"""At most so many candidates are fitted."""
SURROUND_MM = 4.5
"""What is cut out around a ball, beyond its radius."""
ROUGH_SLACK = 2.0
"""Factor on the limits of shape while the fit is rough."""
OVERLAP_MM = 0.6
"""Two fits may come nearer than two radii by this much: balls that touch, each off a little."""
MOST_LISTED = 40
"""At most so many rejected candidates are listed, the roundest first."""


@dataclass(frozen=True, eq=False)
class FittedBall:
    """A candidate with its fit."""

    ball: Ball
    contrast_hu: float


def find_balls(volume: Volume, *, ball_diameter_mm: float, progress: Progress = silent) -> BallSet:
    """Find and fit every ball of the given diameter.

    Parameters
    ----------
    volume : Volume
        Any orientation, handedness and voxel size.
    ball_diameter_mm : float
        Nominal diameter.
    progress : Progress

    Returns
    -------
    BallSet
        Balls in the order of their S, P and L coordinate; candidates that failed a test with the
        test's value and limit.

    Raises
    ------
    InputError
        If the diameter is not positive, or too small for the voxels.
    """
    check_diameter(volume, ball_diameter_mm)
    radius = ball_diameter_mm / 2.0
    points, sizes = candidate_centers(volume, ball_diameter_mm=ball_diameter_mm, progress=progress)
    fitted: list[FittedBall] = []
    rejected: list[Rejected] = []
    count = 0
    for number, (point, size) in enumerate(zip(points, sizes, strict=True)):
        progress("fitting balls", number / len(points))
        result = predicates.size_failure(size, radius)
        if result is not None:
            rejected.append(Rejected(point, result))
            continue
        count += 1
        if count > MOST_LOCAL:
            break
        result = _judge(volume, point, radius)
        if isinstance(result, Rejected):
            rejected.append(result)
        elif result is not None:
            fitted.append(result)
    fitted, doubled = _apart(fitted, radius)
    fitted, odd = _alike(fitted)
    balls = tuple(sorted((f.ball for f in fitted), key=lambda b: tuple(b.center_mm[::-1])))
    away = distinct(rejected + doubled + odd, balls, radius)
    progress("fitting balls", 1.0)
    return BallSet(balls, away, _warnings(volume, balls, crowded=count > MOST_LOCAL))


def check_diameter(volume: Volume, diameter: float) -> None:
    """Refuse a ball, diameter in mm, that is too small for the voxels to show its centre."""
    typical, thickest = float(np.median(volume.spacing_mm)), float(volume.spacing_mm.max())
    least = max(4.0 * typical, FEWEST_SLICES * thickest)
    if not np.isfinite(diameter) or diameter <= 0.0 or diameter < least:
        raise InputError.of(
            "ball-diameter",
            "the ball's diameter is too small for these voxels",
            value=f"{diameter:g} mm",
            limit=f"at least {least:.2f} mm: four voxels, {FEWEST_SLICES:g} of the thickest",
            hazard="H15",
            where="ball_diameter_mm",
            next_step="give the diameter in mm, or scan with smaller voxels",
        )


def _judge(
    volume: Volume, point: NDArray[np.float64], radius: float
) -> FittedBall | Rejected | None:
    """Fit one candidate and test it; None when nothing round is there."""
    reason = predicates.border_failure(volume, point, radius)
    if reason is not None:
        return Rejected(point, reason)
    crop = Crop.around(volume, point, radius + SURROUND_MM)
    rough = rough_fit(crop, point, radius)
    if rough is None or np.linalg.norm(rough.center_mm - point) > 0.8 * radius:
        return None
    reasons = shape_reasons(volume, rough, rough.radius_mm, radius, slack=ROUGH_SLACK)
    if reasons:
        return Rejected(rough.center_mm, "; ".join(reasons))
    rays = fine_fit(crop, rough, radius)
    if rays is None:
        return None
    reason = predicates.border_failure(volume, rays.center_mm, radius)
    if reason is not None:
        return Rejected(rays.center_mm, reason)
    return finished_fit(volume, crop, rays, radius)


def finished_fit(
    volume: Volume, crop: Crop, rays: RayFit, radius: float, *, despite: Sequence[str] | None = None
) -> FittedBall | Rejected:
    """The ball of a fine fit, if no test of its own speaks against it.

    Parameters
    ----------
    volume : Volume
    crop : Crop
    rays : RayFit
    radius : float
        Nominal, mm.
    despite : sequence of str, optional
        Given for a ball that the user put there: the reasons met so far, which join those met
        here among the ball's warnings, and none of which rejects it.
    """
    clipped = rays.clipped_share > CLIPPED_CORE
    thick = float(volume.spacing_mm.max()) > THICK_SLICES_MM
    model = fit_model(
        crop,
        rays.center_mm,
        radius,
        cut=sphere_directions(DIRECTIONS)[rays.cut],
        clip_hu=crop.brightest if clipped else None,
        all_voxels=thick,
    )
    fitted = rays.radius_mm if model is None or clipped else model.radius_mm
    reasons = shape_reasons(volume, rays, fitted, radius)
    reasons += [
        *predicates.model_failures(model, rays, thick=thick),
        *predicates.stem_failures(crop, rays, radius),
    ]
    if reasons and despite is None:
        return Rejected(rays.center_mm, "; ".join(reasons))
    ball = _ball(rays, model, fitted, thick=thick)
    if despite is not None:
        although = [f"added by the user although: {why}" for why in (*despite, *reasons)]
        ball = replace(ball, warnings=(*ball.warnings, *although), added=True)
    return FittedBall(ball, rays.core_hu - rays.outside_hu)


def shape_reasons(
    volume: Volume, rays: RayFit, fitted: float, radius: float, slack: float = 1.0
) -> list[str]:
    """Reasons of size and shape; `slack` as in `predicates.shape_failures`."""
    return list(
        predicates.shape_failures(volume, rays, fitted_mm=fitted, radius_mm=radius, slack=slack)
    )


def _ball(rays: RayFit, model: ModelFit | None, fitted: float, *, thick: bool) -> Ball:
    """The value, with its covariance and what the user should look at."""
    center, method = rays.center_mm, "gradient-rays"
    by_model = thick and model is not None
    covariance = centre_covariance(rays, model, by_model=by_model)
    warnings = []
    clipped = rays.clipped_share > CLIPPED_SHARE
    if clipped:
        warnings.append(
            f"{rays.clipped_share:.0%} of the ball's core is clipped (limit {CLIPPED_SHARE:.0%}): "
            "fitted by its edges, its diameter may look too large (H11)"
        )
    if model is not None:
        apart = float(np.linalg.norm(model.center_mm - rays.center_mm))
        if apart > max(DISAGREEMENT_MM, 4.0 * float(np.sqrt(np.trace(covariance)))):
            warnings.append(f"the two fits of this ball lie {apart:.2f} mm apart")
        if by_model:
            center, method = model.center_mm, "model-fit"
    return Ball(
        center_mm=center,
        diameter_mm=2.0 * fitted,
        covariance_mm2=covariance,
        rms_residual_mm=rays.rms_mm,
        core_hu=rays.core_hu,
        method=method,
        warnings=tuple(warnings),
        clipped=clipped,
    )


def _apart(fitted: list[FittedBall], radius: float) -> tuple[list[FittedBall], list[Rejected]]:
    """One fit for each ball; of two that would overlap only the rounder one."""
    kept: list[FittedBall] = []
    doubled: list[Rejected] = []
    for one in sorted(fitted, key=lambda f: f.ball.rms_residual_mm):
        gaps = [float(np.linalg.norm(one.ball.center_mm - k.ball.center_mm)) for k in kept]
        nearest = min(gaps, default=np.inf)
        limit = 2.0 * radius - OVERLAP_MM
        if nearest >= limit:
            kept.append(one)
        elif nearest > 0.5 * radius:
            reason = f"overlap: {nearest:.1f} mm from another ball, limit {limit:.1f} mm"
            doubled.append(Rejected(one.ball.center_mm, reason))
    return kept, doubled


def _alike(fitted: list[FittedBall]) -> tuple[list[FittedBall], list[Rejected]]:
    """Drop what is not of the others' material, where a clear majority agrees."""
    if len(fitted) < 3:
        return fitted, []
    cores = np.array([f.ball.core_hu for f in fitted])
    contrast = np.array([f.contrast_hu for f in fitted])
    reach = predicates.CORE_SHARE * np.median(contrast)
    votes = (np.abs(cores[:, None] - cores) <= reach).sum(axis=1)
    middle = float(np.median(cores[np.abs(cores - cores[np.argmax(votes)]) <= reach]))
    same = np.abs(cores - middle) <= reach
    if same.sum() <= 0.6 * len(fitted):
        return fitted, []
    odd = [
        Rejected(
            f.ball.center_mm,
            f"core HU: {f.ball.core_hu:.0f}, limit {middle:.0f} ± {reach:.0f} as the others",
        )
        for f, ok in zip(fitted, same, strict=True)
        if not ok
    ]
    return [f for f, ok in zip(fitted, same, strict=True) if ok], odd


def distinct(
    rejected: list[Rejected], balls: tuple[Ball, ...], radius: float
) -> tuple[Rejected, ...]:
    """Rejected candidates that are neither on an accepted ball nor listed twice."""
    places = [ball.center_mm for ball in balls]
    listed: list[Rejected] = []
    for one in rejected:
        if all(np.linalg.norm(one.center_mm - place) > 0.8 * radius for place in places):
            places.append(one.center_mm)
            listed.append(replace(one, center_mm=np.asarray(one.center_mm)))
    return tuple(listed[:MOST_LISTED])


def _warnings(volume: Volume, balls: tuple[Ball, ...], *, crowded: bool) -> tuple[str, ...]:
    """What concerns the whole search."""
    warnings = []
    thickest = float(volume.spacing_mm.max())
    if thickest > THICK_SLICES_MM:
        warnings.append(
            f"slices are {thickest:.2f} mm apart (limit {THICK_SLICES_MM:g} mm): "
            "centres come from the model fit and are less certain"
        )
    if crowded:
        warnings.append(f"more than {MOST_LOCAL} places look like a ball: the roundest were fitted")
    if len(balls) > 2:
        cores = [ball.core_hu for ball in balls]
        if max(cores) - min(cores) > 0.3 * (max(cores) + 1000.0):
            warnings.append("the balls differ in density: not all may be marker balls (H15)")
    return tuple(warnings)
