"""The pose of the moving ring in the base ring, with its covariance (Eq. 4)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose
from hexafix.recognition.least_squares import RingPose


@dataclass(frozen=True, eq=False)
class MechanismPose:
    """Pose X of {A} in {B}.

    Attributes
    ----------
    pose : Pose
        Maps {A} coordinates to {B}.
    covariance : ndarray, shape (6, 6)
        Of ξ in X exp(ξ), ξ = (translation mm, rotation rad) in {A}; read-only.
    """

    pose: Pose
    covariance: NDArray[np.float64]

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviations of ξ, shape (6,), mm then radians."""
        return np.sqrt(np.diag(self.covariance))


def mechanism_pose(*, proximal: RingPose, distal: RingPose) -> MechanismPose:
    """Pose of the moving ring in the base ring, X = T_B⁻¹ T_A.

    Notes
    -----
    Source: Eq. (4). The covariance is first order: ξ = ξ_A - Ad(X⁻¹) ξ_B, the two rings being
    measured independently.
    """
    pose = distal.pose.inverse() @ proximal.pose
    carried = pose.inverse().adjoint
    covariance = proximal.covariance + carried @ distal.covariance @ carried.T
    covariance = 0.5 * (covariance + covariance.T)
    covariance.setflags(write=False)
    return MechanismPose(pose, covariance)
