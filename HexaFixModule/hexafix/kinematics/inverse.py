"""Inverse kinematics of the 6-SPS mechanism, its Jacobian and its condition number."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.geometry import Pose
from hexafix.hardware import Fixator


def strut_lengths(pose: Pose, fixator: Fixator) -> NDArray[np.float64]:
    """Strut lengths of a mechanism pose.

    Parameters
    ----------
    pose : Pose
        {A} in {B}, mm.
    fixator : Fixator

    Returns
    -------
    ndarray, shape (6,)
        Joint centre to joint centre, struts 1 to 6, mm.

    Notes
    -----
    Source: Eq. (29), (33).
    """
    return strut_lengths_batch(
        rotations=pose.rotation, positions_mm=pose.position_mm, fixator=fixator
    )


def strut_lengths_batch(
    *, rotations: ArrayLike, positions_mm: ArrayLike, fixator: Fixator
) -> NDArray[np.float64]:
    """Strut lengths of many mechanism poses.

    Parameters
    ----------
    rotations : array_like, shape (..., 3, 3)
        Orientation of {A} in {B}.
    positions_mm : array_like, shape (..., 3)
        Origin of {A} in {B}, mm.
    fixator : Fixator

    Returns
    -------
    ndarray, shape (..., 6)
        mm. Source: Eq. (29), (33).
    """
    vectors = strut_vectors(rotations=rotations, positions_mm=positions_mm, fixator=fixator)
    return np.sqrt(np.sum(vectors * vectors, axis=-1))


def strut_vectors(
    *, rotations: ArrayLike, positions_mm: ArrayLike, fixator: Fixator
) -> NDArray[np.float64]:
    """Vectors q ŝ from the joints b_l to the joints a_l in {B}, shape (..., 6, 3), mm.

    Parameters
    ----------
    rotations : array_like, shape (..., 3, 3)
        Orientation of {A} in {B}.
    positions_mm : array_like, shape (..., 3)
        Origin of {A} in {B}, mm.
    fixator : Fixator
    """
    r, p = np.asarray(rotations, float), np.asarray(positions_mm, float)
    moved = fixator.proximal.joints_mm @ np.swapaxes(r, -1, -2)
    return moved + p[..., None, :] - fixator.distal.joints_mm


def strut_jacobian(pose: Pose, fixator: Fixator) -> NDArray[np.float64]:
    """Change of the strut lengths with a twist of the moving ring in its own frame.

    Parameters
    ----------
    pose : Pose
        {A} in {B}, mm.
    fixator : Fixator

    Returns
    -------
    ndarray, shape (6, 6)
        J with dq = J ξ for T exp(ξ), ξ = (ρ, θ) in {A}: columns 0-2 mm per mm, columns 3-5 mm
        per radian.
    """
    return strut_jacobian_batch(
        rotations=pose.rotation, positions_mm=pose.position_mm, fixator=fixator
    )


def strut_jacobian_batch(
    *, rotations: ArrayLike, positions_mm: ArrayLike, fixator: Fixator
) -> NDArray[np.float64]:
    """`strut_jacobian` of many poses, shape (..., 6, 6).

    Parameters
    ----------
    rotations : array_like, shape (..., 3, 3)
        Orientation of {A} in {B}.
    positions_mm : array_like, shape (..., 3)
        Origin of {A} in {B}, mm.
    fixator : Fixator
    """
    r = np.asarray(rotations, float)
    vectors = strut_vectors(rotations=r, positions_mm=positions_mm, fixator=fixator)
    axes = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    axes_in_ring = axes @ r
    moments = np.asarray(np.cross(fixator.proximal.joints_mm, axes_in_ring), float)
    return np.concatenate([axes_in_ring, moments], axis=-1)


@lru_cache(maxsize=64)
def joint_radius_mm(fixator: Fixator) -> float:
    """Root mean square distance of the moving ring's joints from its z axis, mm."""
    joints = fixator.proximal.joints_mm[:, :2]
    return float(np.sqrt(np.mean(np.sum(joints**2, axis=1))))


def condition_number(jacobian: ArrayLike, *, length_mm: float) -> NDArray[np.float64]:
    """Ratio of the largest to the smallest singular value of the scaled Jacobian.

    Parameters
    ----------
    jacobian : array_like, shape (..., 6, 6)
        From `strut_jacobian`.
    length_mm : float
        Length that turns radians into millimetres (the joint radius, `joint_radius_mm`): the
        rotation columns are divided by it, so that both halves of the Jacobian are pure numbers.

    Returns
    -------
    ndarray, shape (...)
        1 for an isotropic mechanism, infinite at a singularity.
    """
    scaled = np.array(jacobian, float)
    scaled[..., 3:] /= length_mm
    values = np.linalg.svd(scaled, compute_uv=False)
    with np.errstate(divide="ignore"):
        return np.asarray(values[..., 0] / values[..., -1], float)
