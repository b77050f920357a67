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
    by_corner = corner_jacobians(layout.points_mm[groups])
    result = np.zeros((len(groups), 6, len(layout), 3))
    np.put_along_axis(result, groups[:, None, :, None], by_corner, axis=2)
    return result


def corner_jacobians(corners_mm: ArrayLike) -> Array:
    """Derivative of one group's pose by the centres of its own three balls.

    Parameters
    ----------
    corners_mm : array_like, shape (..., 3, 3)
        Places of j1, j2, j3 as rows, ring frame, mm; leading axes are a batch of groups.

    Returns
    -------
    ndarray, shape (..., 6, 3, 3)
        Rows are ξ as in `group_jacobians`, then the ball and its displacement, ring frame, mm.

    Notes
    -----
    Source: Eq. (18), (21), (22), by hand. Departs: as `group_jacobians`.
    """
    r = np.asarray(corners_mm, float)
    axes = triads(r)
    e1, e2, e3 = np.moveaxis(axes, -1, 0)
    first, second = r[..., 0, :] - r[..., 1, :], r[..., 1, :] - r[..., 2, :]
    base = np.linalg.norm(first, axis=-1)[..., None]
    along = np.sum(second * e1, axis=-1)[..., None, None]
    height = np.sum(second * e2, axis=-1)[..., None, None]
    zero = np.zeros_like(e1)
    # Rotation components about e3, e2 (both from m_j1 - m_j2), then about e1.
    about3 = np.stack([e2, -e2, zero], axis=-2) / base[..., None]
    about2 = np.stack([-e3, e3, zero], axis=-2) / base[..., None]
    about1 = (np.stack([zero, e3, -e3], axis=-2) + along * about2) / height
    about = np.stack([about1, about2, about3], axis=-3)
    rotation = np.einsum("...ag,...gnc->...anc", axes, about)
    # Eq. (18): p = m_j1 - R r_j1
    position = np.einsum("...ab,...bnc->...anc", skew(r[..., 0, :]), rotation)
    position[..., :, 0, :] += np.eye(3)
    return np.concatenate([position, rotation], axis=-3)


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
