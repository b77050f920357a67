"""What to do about the difference between the recognised pose and the struts' pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.correction.fragment import FragmentMotion, Moving, TargetPose
from hexafix.errors import InputError
from hexafix.geometry import Pose, skew
from hexafix.hardware import Fixator
from hexafix.kinematics import strut_jacobian

CompensationMode = Literal["fused", "additive", "none"]

FUSION_STEPS = 6
"""Gauss-Newton steps of the split; the second changes the poses by less than 1e-4 mm."""


@dataclass(frozen=True, eq=False)
class RecognisedRings:
    """Both rings as the image shows them.

    Attributes
    ----------
    proximal, distal : Pose
        T_A and T_B, ring frames in LPS, mm.
    proximal_covariance, distal_covariance : ndarray, shape (6, 6)
        Of ξ in T exp(ξ), ξ = (ρ, θ) in the ring's own frame, mm and radians.
    """

    proximal: Pose
    distal: Pose
    proximal_covariance: NDArray[np.float64]
    distal_covariance: NDArray[np.float64]

    @property
    def mechanism(self) -> Pose:
        """The recognised mechanism pose X_r. Source: Eq. (4)."""
        return self.distal.inverse() @ self.proximal


@dataclass(frozen=True, eq=False)
class Compensation:
    """Recognition and struts brought together.

    Attributes
    ----------
    mode : {'fused', 'additive', 'none'}
    start : Pose
        X_t from the struts, {A} in {B}: where every path starts, in every mode.
    recognised : Pose
        X_r from the image, {A} in {B}.
    proximal, distal : Pose
        Ring poses in LPS to plan with; corrected if `fused`, else as recognised.
    """

    mode: CompensationMode
    start: Pose
    recognised: Pose
    proximal: Pose
    distal: Pose

    @property
    def difference_mm(self) -> float:
        """Distance of the recognised origin of {A} from the struts' (hazard H33)."""
        return self.recognised.difference(self.start)[0]

    @property
    def difference_rad(self) -> float:
        """Angle of the recognised {A} to the struts', radians (hazard H33)."""
        return self.recognised.difference(self.start)[1]

    @property
    def pose_vector_difference(self) -> NDArray[np.float64]:
        """ΔX_r = X_r − X_t as pose vectors, shape (6,), mm and radians. Source: Eq. (31)."""
        turned = _wrapped(self.recognised.angles_rad - self.start.angles_rad)
        return np.concatenate([self.recognised.position_mm - self.start.position_mm, turned])


def compensate(
    rings: RecognisedRings,
    *,
    theoretical: Pose,
    mode: CompensationMode = "fused",
    theoretical_covariance: ArrayLike | None = None,
) -> Compensation:
    """Bring the recognised rings and the struts' pose together.

    Parameters
    ----------
    rings : RecognisedRings
    theoretical : Pose
        X_t from the struts, {A} in {B}.
    mode : {'fused', 'additive', 'none'}
        `fused` moves both ring poses in the image, each by what its covariance lets it, until
        they agree with the struts; `additive` is the paper's rule; `none` ignores the struts.
    theoretical_covariance : array_like, shape (6, 6), optional
        Of ξ in X_t exp(ξ), mm and radians, from `reading_covariance`; without, the struts are
        taken as exact, as the paper does.

    Notes
    -----
    Source: Section 5.1. Departs: `fused` composes rigid motions and splits the error between the
    rings by their covariances; it leaves half of what Eq. (31), (32) leave.
    """
    if mode not in ("fused", "additive", "none"):
        raise InputError.of(
            "compensation-mode",
            "the compensation is one of fused, additive, none",
            value=str(mode),
            where="schedule.compensation",
        )
    proximal, distal = rings.proximal, rings.distal
    if mode == "fused":
        proximal, distal = fuse_rings(
            rings, theoretical=theoretical, theoretical_covariance=theoretical_covariance
        )
    return Compensation(mode, theoretical, rings.mechanism, proximal, distal)


def fuse_rings(
    rings: RecognisedRings,
    *,
    theoretical: Pose,
    theoretical_covariance: ArrayLike | None = None,
) -> tuple[Pose, Pose]:
    """Ring poses that agree with image and struts, as likely as possible.

    Parameters
    ----------
    rings : RecognisedRings
    theoretical : Pose
        X_t, {A} in {B}.
    theoretical_covariance : array_like, shape (6, 6), optional
        Of ξ_t in X_t exp(ξ_t); without, X_t is exact.

    Returns
    -------
    tuple of Pose
        Corrected T_A and T_B in LPS, with T_B⁻¹ T_A = X_t exp(ξ_t) exactly.

    Notes
    -----
    Minimises ξ_Aᵀ C_A⁻¹ ξ_A + ξ_Bᵀ C_B⁻¹ ξ_B + ξ_tᵀ C_t⁻¹ ξ_t under
    (T_B exp ξ_B)⁻¹ (T_A exp ξ_A) = X_t exp ξ_t. With ξ_B and ξ_t as the unknowns the constraint
    gives ξ_A = log(T_A⁻¹ T_B exp(ξ_B) X_t exp(ξ_t)); Gauss-Newton with the slopes
    J⁻¹(ξ_A) Ad((X_t exp ξ_t)⁻¹) J(ξ_B) and J⁻¹(ξ_A) J(ξ_t), J being `_turning`. Departs: the paper
    takes X_t as exact; a reading in half millimetres is not.
    """
    weight_a = np.linalg.inv(rings.proximal_covariance)
    prior = np.linalg.inv(rings.distal_covariance)
    if theoretical_covariance is not None:
        weight_t = np.linalg.inv(np.asarray(theoretical_covariance, float))
        prior = np.block([[prior, np.zeros((6, 6))], [np.zeros((6, 6)), weight_t]])
    recognised = rings.proximal.inverse() @ rings.distal
    unknown, struts = np.zeros(len(prior)), theoretical
    for _ in range(FUSION_STEPS):
        xi_a = (recognised @ Pose.exp(unknown[:6]) @ struts).log()
        slope = struts.inverse().adjoint @ _turning(unknown[:6])
        if theoretical_covariance is not None:
            slope = np.hstack([slope, _turning(unknown[6:])])
        slope = np.linalg.solve(_turning(xi_a), slope)
        normal = slope.T @ weight_a @ slope + prior
        unknown = unknown - np.linalg.solve(normal, slope.T @ weight_a @ xi_a + prior @ unknown)
        if theoretical_covariance is not None:
            struts = theoretical @ Pose.exp(unknown[6:])
    distal = rings.distal @ Pose.exp(unknown[:6])
    return distal @ struts, distal


def _turning(twist: NDArray[np.float64]) -> NDArray[np.float64]:
    """J with exp(ξ + δ) = exp(ξ) exp(J δ), shape (6, 6), to second order in ξ = (mm, rad).

    Without it the split is off by the product of a correction's shift and turn, some 1e-4 mm.
    """
    bracket = np.zeros((6, 6))
    bracket[:3, :3] = bracket[3:, 3:] = skew(twist[3:])
    bracket[:3, 3:] = skew(twist[:3])
    return np.eye(6) - bracket / 2.0 + bracket @ bracket / 6.0


def reading_resolution_mm(readings_mm: ArrayLike, *, step_mm: float) -> float:
    """How finely the readings were given: the strut's step, or the decimals that were written.

    Parameters
    ----------
    readings_mm : array_like, shape (6,)
        Scale readings, mm.
    step_mm : float
        Step of the strut's scale.

    Notes
    -----
    Readings that are all whole steps were read to a step; others as finely as their last decimal.
    """
    readings = np.asarray(readings_mm, float)
    for resolution in (step_mm, 1.0, 0.5, 0.1, 0.05, 0.01, 0.001):
        turns = readings / resolution
        if resolution <= step_mm and np.all(np.abs(turns - np.round(turns)) < 1e-6):
            return float(resolution)
    return 0.001


def reading_covariance(
    pose: Pose, fixator: Fixator, *, resolution_mm: float
) -> NDArray[np.float64]:
    """Covariance of the struts' pose from the resolution of the readings, shape (6, 6).

    Parameters
    ----------
    pose : Pose
        X_t, {A} in {B}.
    fixator : Fixator
    resolution_mm : float
        Each reading is off by up to half of it, evenly.

    Returns
    -------
    ndarray
        Of ξ in X_t exp(ξ), mm and radians: J⁻¹ J⁻ᵀ times the variance of a reading.
    """
    inverse = np.linalg.inv(strut_jacobian(pose, fixator))
    return inverse @ inverse.T * resolution_mm**2 / 12.0


def target_of(goal: TargetPose | FragmentMotion, compensation: Compensation) -> Pose:
    """Mechanism pose at the end of the correction, {A} in {B}.

    Parameters
    ----------
    goal : TargetPose or FragmentMotion
        What `hexafix.correction.targets.planned_motion` made of the correction.
    compensation : Compensation

    Notes
    -----
    Source: Eq. (32). Departs: a `TargetPose` says where {A} truly shall stand on {B}; no
    recognition error enters it, so no mode changes it.
    """
    if isinstance(goal, TargetPose):
        return goal.pose
    planned = mechanism_after(goal, proximal=compensation.proximal, distal=compensation.distal)
    if compensation.mode != "additive":
        return planned
    error = compensation.pose_vector_difference
    return Pose.from_xyz_fixed(
        position_mm=planned.position_mm - error[:3], angles_rad=planned.angles_rad - error[3:]
    )


def subtraction_departure_mm(
    goal: TargetPose | FragmentMotion, compensation: Compensation, fixator: Fixator
) -> float:
    """How far Eq. (32) lies from the same correction by composed transforms (H34), mm.

    The largest distance of a joint of {A} between the target of subtracted pose vectors and the
    composed one, X_p X_r⁻¹ X_t: the planned motion of the recognised mechanism done from the
    struts' pose. 0 where nothing is subtracted.
    """
    if isinstance(goal, TargetPose) or compensation.mode != "additive":
        return 0.0
    planned = mechanism_after(goal, proximal=compensation.proximal, distal=compensation.distal)
    composed = planned @ compensation.recognised.inverse() @ compensation.start
    subtracted = target_of(goal, compensation)
    joints = fixator.proximal.joints_mm
    apart = composed.apply(joints) - subtracted.apply(joints)
    return float(np.linalg.norm(apart, axis=1).max())


def mechanism_after(motion: FragmentMotion, *, proximal: Pose, distal: Pose) -> Pose:
    """Mechanism pose once a fragment and its ring have moved in the image, {A} in {B}.

    Parameters
    ----------
    motion : FragmentMotion
    proximal, distal : Pose
        T_A and T_B in LPS before the motion.
    """
    if motion.moving == "proximal":
        return distal.inverse() @ (motion.motion @ proximal)
    return (motion.motion @ distal).inverse() @ proximal


def motion_between(compensation: Compensation, *, target: Pose, moving: Moving) -> FragmentMotion:
    """Motion of a fragment in the image when the mechanism goes from start to target.

    Parameters
    ----------
    compensation : Compensation
    target : Pose
        {A} in {B} at the end.
    moving : {'proximal', 'distal'}
    """
    # the rings' own relation is the struts'; in the image the resting ring is the anchor
    if moving == "proximal":
        start = compensation.distal @ compensation.start
        return FragmentMotion("proximal", compensation.distal @ target @ start.inverse())
    start = compensation.proximal @ compensation.start.inverse()
    return FragmentMotion("distal", compensation.proximal @ target.inverse() @ start.inverse())


def _wrapped(angles_rad: ArrayLike) -> NDArray[np.float64]:
    """Angles in [−π, π)."""
    return np.mod(np.asarray(angles_rad, float) + np.pi, 2 * np.pi) - np.pi
