"""How errors of balls and installation become errors of a ring's pose (Eq. 20-28)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.geometry import skew
from hexafix.hardware import MarkerLayout
from hexafix.recognition import ring_poses
from hexafix.recognition.group_pose import group_jacobian, group_jacobians
from hexafix.recognition.groups import marker_groups
from hexafix.recognition.least_squares import (
    IMAGE_SIGMA_MM,
    INSTALLATION_SIGMA_MM,
    total_covariances,
)

Array = NDArray[np.float64]

MEAN_ABS = float(np.sqrt(2.0 / np.pi))
"""E|x| of a normal x with standard deviation 1."""


def paper_jacobian(layout: MarkerLayout) -> Array:
    """The paper's linear model J of one ring at the identity pose, shape (6, N, 6).

    Rows are (x y z α β γ), mm and radians; the last axis is (δx δy δz of m_i, δt δφ δh of η_i),
    mm, and radians for δφ.

    Notes
    -----
    Source: Eq. (20)-(22), derived by hand. Departs: nothing for layouts of one height; as in the
    paper an error of a height moves the position only, because heights never enter Eq. (9). In
    truth it tilts the ring too: `group_covariance` says by how much.
    """
    image = group_jacobian(layout)
    result = np.zeros((6, len(layout), 6))
    result[:, :, :3] = image
    phi = np.array([site.sweep_rad for site in layout.sites])
    t = np.array([site.radius_mm for site in layout.sites])
    zero = np.zeros_like(phi)
    by_radius = np.stack([np.cos(phi), np.sin(phi), zero], axis=-1)
    by_sweep = np.stack([-t * np.sin(phi), t * np.cos(phi), zero], axis=-1)
    # A site that truly lies elsewhere acts as its ball displaced the other way.
    result[:, :, 3] = -np.einsum("anc,nc->an", image, by_radius)
    result[:, :, 4] = -np.einsum("anc,nc->an", image, by_sweep)
    first = marker_groups(layout)[:, 0]
    np.add.at(result[2, :, 5], first, -1.0 / len(first))  # Eq. (18) alone
    return result


def least_squares_covariance(
    layout: MarkerLayout,
    *,
    sigma_image_mm: float = IMAGE_SIGMA_MM,
    sigma_installation_mm: ArrayLike = INSTALLATION_SIGMA_MM,
    covariances_mm2: ArrayLike | None = None,
) -> Array:
    """Covariance of a ring's least-squares pose, shape (6, 6), ring frame, mm and radians.

    Parameters
    ----------
    layout : MarkerLayout
    sigma_image_mm : float
        Error of a ball centre along each axis.
    sigma_installation_mm : array_like, shape (), (3,) or (N, 3)
        Installation error along the ring's axes.
    covariances_mm2 : array_like, shape (N, 3, 3), optional
        Of the ball centres in the ring frame, in place of `sigma_image_mm`.
    """
    return ring_poses(
        layout.points_mm[None],
        layout,
        covariances_mm2=_image(layout, sigma_image_mm, covariances_mm2),
        installation_sigma_mm=sigma_installation_mm,
    )[2][0]


def group_covariance(
    layout: MarkerLayout,
    *,
    sigma_image_mm: float = IMAGE_SIGMA_MM,
    sigma_installation_mm: ArrayLike = INSTALLATION_SIGMA_MM,
    covariances_mm2: ArrayLike | None = None,
) -> Array:
    """Covariance of a ring's pose by the group method, shape (6, 6); as above."""
    total = total_covariances(
        layout.points_mm[None],
        np.eye(3)[None],
        _image(layout, sigma_image_mm, covariances_mm2),
        sigma_installation_mm,
    )[0]
    jacobian = group_jacobian(layout)
    return np.einsum("ani,nij,bnj->ab", jacobian, total, jacobian)


def paper_covariance(
    layout: MarkerLayout,
    *,
    sigma_image_mm: float = IMAGE_SIGMA_MM,
    sigma_installation_mm: float = INSTALLATION_SIGMA_MM,
) -> Array:
    """Covariance that the paper's linear model predicts, shape (6, 6). Source: Eq. (23), (25)."""
    t = np.array([site.radius_mm for site in layout.sites])
    sigma = np.empty((len(layout), 6))
    sigma[:, :3] = sigma_image_mm
    sigma[:, 3] = sigma[:, 5] = sigma_installation_mm
    sigma[:, 4] = sigma_installation_mm / t
    scaled = (paper_jacobian(layout) * sigma).reshape(6, -1)
    return scaled @ scaled.T


def isotropic_covariances(points_mm: ArrayLike, sigma_mm: float) -> Array:
    """Least-squares pose covariances of many layouts at once, for searches.

    Parameters
    ----------
    points_mm : array_like, shape (K, N, 3)
        Layouts in their ring frames, mm.
    sigma_mm : float
        Image and installation error together, along each axis.

    Returns
    -------
    ndarray, shape (K, 6, 6)
        In the ring frame, mm and radians.
    """
    r = np.asarray(points_mm, float)
    jacobian = np.concatenate([np.broadcast_to(-np.eye(3), (*r.shape, 3)), skew(r)], axis=-1)
    return sigma_mm**2 * np.linalg.inv(np.einsum("knia,knib->kab", jacobian, jacobian))


def expected_errors(covariance: ArrayLike) -> Array:
    """E|Δx|, …, E|Δγ| of normal errors, shape (..., 6, 6) to (..., 6). Source: Eq. (24)."""
    return MEAN_ABS * np.sqrt(np.diagonal(np.asarray(covariance, float), axis1=-2, axis2=-1))


def volume_error(covariance: ArrayLike) -> tuple[Array, Array]:
    """Volume errors of position (mm) and orientation (rad), shape (..., 6, 6) to (...).

    Notes
    -----
    Source: Eq. (28), on the expectations of Eq. (24), ring frame at the identity pose.
    """
    expected = expected_errors(covariance)
    return np.linalg.norm(expected[..., :3], axis=-1), np.linalg.norm(expected[..., 3:], axis=-1)


def _image(layout: MarkerLayout, sigma_mm: float, covariances_mm2: ArrayLike | None) -> Array:
    if covariances_mm2 is not None:
        return np.asarray(covariances_mm2, float)
    return np.broadcast_to(np.eye(3) * sigma_mm**2, (len(layout), 3, 3))


__all__ = [
    "expected_errors",
    "group_covariance",
    "group_jacobian",
    "group_jacobians",
    "isotropic_covariances",
    "least_squares_covariance",
    "paper_covariance",
    "paper_jacobian",
    "volume_error",
]
