"""How large an error of a scenario may be: by rule from what was scanned, never from results.

A ball's centre has a limit in mm that grows with voxels, noise and metal. All poses follow from it
and from the hardware's own tolerances by propagation to first order: a limit is `SIGMAS` predicted
standard deviations, with the tolerance of the balls' places on the ring (Section 4.2.1), the ball
limit taken as three standard deviations of a centre, and readings uniform within their step. The
rows' rounding may add one strut step at the end, at the ring, at the fracture, and at the joints
for the turn.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose, skew
from hexafix.hardware import Fixator, MarkerLayout
from hexafix.phantom import PhantomSpec

Array = NDArray[np.floating[Any]]
"""Arrays of this file; shapes stand in the docstrings."""

SIGMAS = 4.0
"""Predicted standard deviations that an error may reach."""

FINE_MM = 0.06
"""Limit of a ball's centre in voxels up to `COARSE_MM`, with noise up to `NOISY_HU`, in 3D."""

COARSE_MM, NOISY_HU = 1.0, 50.0
"""Beyond these the limit grows in proportion: the edge is seen by fewer or by noisier voxels."""

STREAKED_MM = 0.02
"""Added for each 100 HU of metal streaks."""

CLIPPED, RESAMPLED = 1.5, 1.5
"""Factors for balls denser than the scanner's scale and for a tilted, so resampled, image: as
`hazards.md` section 8 has it, 0.15 mm where a plain image must keep 0.10 mm."""


def ball_mm(spec: PhantomSpec) -> float:
    """Largest distance of a ball's centre from the truth, mm."""
    coarsest = max(*spec.spacing_mm, spec.thickness_mm)
    limit = FINE_MM * max(1.0, coarsest / COARSE_MM) * max(1.0, spec.noise_hu / NOISY_HU)
    if spec.clip_hu is not None and spec.ball_hu > spec.clip_hu:
        limit *= CLIPPED
    if spec.gantry_tilt_rad:
        limit *= RESAMPLED
    return limit + STREAKED_MM * spec.streak_hu / 100.0


@dataclass(frozen=True, eq=False)
class PoseLimits:
    """Covariances of ξ = (mm, rad) in the frame of the ring that moves, each (6, 6).

    Attributes
    ----------
    proximal, distal : ndarray
        Of the two rings in the image, each in its own frame.
    mechanism : ndarray
        Of the recognised pose {A} in {B}.
    readings : ndarray
        Of the pose that the readings give.
    end : ndarray
        Of the pose at the end of the schedule, the rows' rounding apart.
    """

    proximal: Array
    distal: Array
    mechanism: Array
    readings: Array
    end: Array


def pose_limits(spec: PhantomSpec, *, compensation: str, in_image: bool) -> PoseLimits:
    """What may be expected of every pose.

    Parameters
    ----------
    spec : PhantomSpec
    compensation : str
        Of the schedule: the additive one replaces the error of recognition by that of the
        readings, the fused one does at least as well as none.
    in_image : bool
        Whether the correction is given in the image, so that recognition enters the end pose; a
        target pose of the mechanism itself is reached up to the rows' rounding.
    """
    sigma_mm = float(np.hypot(spec.installation_sigma_mm, ball_mm(spec) / 3.0 / np.sqrt(3.0)))
    rings = [ring_covariance(layout, sigma_mm) for layout in (spec.proximal, spec.distal)]
    readings = rounding_covariance(spec.mechanism_pose, spec.fixator, spec.strut_reading_step_mm)
    mechanism = between(spec.mechanism_pose, rings[0], rings[1])
    end = np.zeros((6, 6))
    if in_image:
        end = readings if compensation == "additive" else between(spec.target_pose, *rings)
    return PoseLimits(rings[0], rings[1], mechanism, readings, end)


def ring_covariance(layout: MarkerLayout, sigma_mm: float) -> Array:
    """Covariance of a ring's pose in its own frame from independent errors of its balls."""
    information = np.zeros((6, 6))
    for point in layout.points_mm:
        slope = np.hstack([np.eye(3), -skew(point)])
        information += slope.T @ slope
    return sigma_mm**2 * np.linalg.inv(information)


def between(pose: Pose, proximal: Array, distal: Array) -> Array:
    """Covariance of {A} in {B} from those of both rings in the image, in {A}."""
    carried = pose.inverse().adjoint
    return proximal + carried @ distal @ carried.T


def rounding_covariance(pose: Pose, fixator: Fixator, step_mm: float) -> Array:
    """Covariance of {A} in {B}, in {A}, from strut lengths rounded to a step."""
    joints, feet = fixator.proximal.joints_mm, fixator.distal.joints_mm
    lines = pose.apply(joints) - feet
    # unit vectors of the struts, seen from the moving ring
    units = (lines / np.linalg.norm(lines, axis=1)[:, None]) @ pose.rotation
    turning = np.asarray(np.cross(joints, units), float)
    inverse: Array = np.linalg.inv(np.hstack([units, turning]))
    return (inverse @ inverse.T) * (step_mm**2 / 12.0)


def at_point_mm(covariance: Array, point_mm: Array) -> float:
    """Limit of a point's displacement, mm; the point in the frame of the covariance."""
    slope = np.hstack([np.eye(3), -skew(point_mm)])
    return SIGMAS * float(np.sqrt(np.trace(slope @ covariance @ slope.T)))


def turn_deg(covariance: Array) -> float:
    """Limit of a rotation, degrees."""
    return SIGMAS * float(np.degrees(np.sqrt(np.trace(covariance[3:, 3:]))))


def with_step(limit: float, step: float) -> float:
    """A limit with what whole strut steps may add to it, in the same unit."""
    return float(np.hypot(limit, step))
