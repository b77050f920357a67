"""Ring pose by the group method, with its exact first-order covariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hexafix.geometry import Pose, skew
from hexafix.hardware import MarkerLayout
from hexafix.recognition.groups import marker_groups, ring_poses_by_groups, triads
from hexafix.recognition.least_squares import (
    INSTALLATION_SIGMA_MM,
    RingPose,
    checked_points,
    refuse_mirrored,
    ring_pose_value,
    total_covariances,
)
from hexafix.recognition.rigid import Array


def group_jacobians(layout: MarkerLayout) -> Array:
    """Derivative of each group's pose by the ball centres, shape (G, 6, N, 3).

    Rows are ξ = (translation mm, rotation rad) of T exp(ξ) in the ring frame; the last axis is
    the displacement of a ball in the ring frame, mm.

    Notes
    -----
    Source: Eq. (21), (22), by hand. Departs: for the triad road, so heights act as they do in
    truth, and for ξ, which has no gimbal.
    """
    groups = marker_groups(layout)
    r = layout.points_mm
    axes = triads(r[groups])
    result = np.zeros((len(groups), 6, len(layout), 3))
    for g, (j1, j2, j3) in enumerate(groups):
        e1, e2, e3 = axes[g].T
        base = np.linalg.norm(r[j1] - r[j2])
        along, height = (r[j2] - r[j3]) @ e1, (r[j2] - r[j3]) @ e2
        # Rotation components about e3, e2 (both from m_j1 - m_j2), then about e1.
        about3 = {j1: e2 / base, j2: -e2 / base, j3: np.zeros(3)}
        about2 = {j1: -e3 / base, j2: e3 / base, j3: np.zeros(3)}
        normal = {j1: np.zeros(3), j2: e3, j3: -e3}
        for j in (j1, j2, j3):
            about1 = (normal[j] + along * about2[j]) / height
            result[g, 3:, j] = (
                np.outer(e1, about1) + np.outer(e2, about2[j]) + np.outer(e3, about3[j])
            )
        # Eq. (18): p = m_j1 - R r_j1
        result[g, :3] = np.einsum("ab,bnc->anc", skew(r[j1]), result[g, 3:])
        result[g, :3, j1] += np.eye(3)
    return result


def group_jacobian(layout: MarkerLayout) -> Array:
    """Derivative of the mean pose (Eq. 19) by the ball centres, shape (6, N, 3); see above."""
    return group_jacobians(layout).mean(axis=0)


def ring_pose_by_groups(
    points_mm: ArrayLike,
    layout: MarkerLayout,
    *,
    covariances_mm2: ArrayLike | None = None,
    installation_sigma_mm: ArrayLike = INSTALLATION_SIGMA_MM,
) -> RingPose:
    """Pose of one ring by the paper's group method; arguments and errors as in `ring_pose`."""
    points = checked_points(points_mm, layout)
    refuse_mirrored(points, layout)
    rotation, position = ring_poses_by_groups(points, layout)
    total = total_covariances(points[None], rotation[None], covariances_mm2, installation_sigma_mm)[
        0
    ]
    jacobian = group_jacobian(layout)
    covariance = np.einsum("ani,nij,bnj->ab", jacobian, total, jacobian)
    e = (points - position) @ rotation - layout.points_mm
    chi2 = float(np.einsum("ni,nij,nj->", e, np.linalg.inv(total), e))
    return ring_pose_value(points, layout, Pose(rotation, position), covariance, chi2, "groups")
