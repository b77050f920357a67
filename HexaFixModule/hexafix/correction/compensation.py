"""What to do about the difference between the recognised pose and the struts' pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.correction.fragment import FragmentMotion, Moving, TargetPose
from hexafix.errors import InputError
from hexafix.geometry import Pose, skew

CompensationMode = Literal["fused", "additive", "none"]

FUSION_STEPS = 3
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
    rings: RecognisedRings, *, theoretical: Pose, mode: CompensationMode = "fused"
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
        proximal, distal = fuse_rings(rings, theoretical=theoretical)
    return Compensation(mode, theoretical, rings.mechanism, proximal, distal)


def fuse_rings(rings: RecognisedRings, *, theoretical: Pose) -> tuple[Pose, Pose]:
    """Ring poses that agree with the struts, as likely as possible.

    Parameters
    ----------
    rings : RecognisedRings
    theoretical : Pose
        X_t, {A} in {B}.

    Returns
    -------
    tuple of Pose
        Corrected T_A and T_B in LPS, with T_B⁻¹ T_A = X_t exactly.

    Notes
    -----
    Minimises ξ_Aᵀ C_A⁻¹ ξ_A + ξ_Bᵀ C_B⁻¹ ξ_B under (T_B exp ξ_B)⁻¹ (T_A exp ξ_A) = X_t. With ξ_B
    as the unknown the constraint gives T_A' = T_B exp(ξ_B) X_t and
    ξ_A = log(T_A⁻¹ T_B exp(ξ_B) X_t); Gauss-Newton on ξ_B with Ad(X_t⁻¹) as its slope.
    """
    weight_a = np.linalg.inv(rings.proximal_covariance)
    weight_b = np.linalg.inv(rings.distal_covariance)
    slope = adjoint(theoretical.inverse())
    normal = slope.T @ weight_a @ slope + weight_b
    recognised = rings.proximal.inverse() @ rings.distal
    xi_b = np.zeros(6)
    for _ in range(FUSION_STEPS):
        xi_a = (recognised @ Pose.exp(xi_b) @ theoretical).log()
        xi_b = xi_b - np.linalg.solve(normal, slope.T @ weight_a @ xi_a + weight_b @ xi_b)
    distal = rings.distal @ Pose.exp(xi_b)
    return distal @ theoretical, distal


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


def adjoint(pose: Pose) -> NDArray[np.float64]:
    """Ad(T), shape (6, 6), with T exp(ξ) T⁻¹ = exp(Ad(T) ξ), ξ = (ρ, θ)."""
    r = pose.rotation
    out = np.zeros((6, 6))
    out[:3, :3] = out[3:, 3:] = r
    out[:3, 3:] = skew(pose.position_mm) @ r
    return out


def _wrapped(angles_rad: ArrayLike) -> NDArray[np.float64]:
    """Angles in [−π, π)."""
    return np.mod(np.asarray(angles_rad, float) + np.pi, 2 * np.pi) - np.pi
