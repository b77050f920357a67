"""4×4 matrices by `scipy.linalg` and poses by `scipy.optimize`: the other road."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, logm
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

Matrix = NDArray[np.floating[Any]]
"""Arrays of this room; shapes stand in the docstrings."""

INSTALLATION_SIGMA_MM = 0.4 / 6
"""Installation error of a marker per axis. Source: Section 4.3."""


def angle_deg(one: Matrix, other: Matrix) -> float:
    """Angle between the axes of two 4×4 poses, degrees."""
    turn = Rotation.from_matrix(one[:3, :3].T @ other[:3, :3])
    return float(np.degrees(turn.magnitude()))


def distance_mm(one: Matrix, other: Matrix) -> float:
    """Distance of the origins of two 4×4 poses, mm."""
    return float(np.linalg.norm(one[:3, 3] - other[:3, 3]))


def angles_deg(pose: Matrix) -> Matrix:
    """X-Y-Z fixed angles of a 4×4 pose, degrees, by scipy."""
    return Rotation.from_matrix(pose[:3, :3]).as_euler("xyz", degrees=True)


def layout_points(markers: list[dict[str, float]]) -> Matrix:
    """Marker places in the ring frame, shape (N, 3), mm, as complex numbers in the plane."""
    place = [m["radius_mm"] * np.exp(1j * np.radians(m["sweep_deg"])) for m in markers]
    heights = [m["height_mm"] for m in markers]
    return np.stack([np.real(place), np.imag(place), heights], axis=-1)


def ring_pose(places: Matrix, centers: Matrix, covariances: Matrix) -> Matrix:
    """Ring pose in LPS by minimising whitened distances.

    Parameters
    ----------
    places : ndarray, shape (N, 3)
        Ring frame, mm.
    centers : ndarray, shape (N, 3)
        Ball centres, LPS mm.
    covariances : ndarray, shape (N, 3, 3)
        Of the centres, LPS mm².
    """
    total = covariances + INSTALLATION_SIGMA_MM**2 * np.eye(3)
    whiten = np.linalg.inv(np.linalg.cholesky(total))
    middle_place, middle = places.mean(axis=0), centers.mean(axis=0)
    start, _ = Rotation.align_vectors(centers - middle, places - middle_place)

    def residual(x: Matrix) -> Matrix:
        turn = Rotation.from_rotvec(x[3:]) * start
        away = turn.apply(places - middle_place) + middle + x[:3] - centers
        return np.einsum("nij,nj->ni", whiten, away).ravel()

    fit = least_squares(residual, np.zeros(6), x_scale=[1, 1, 1, 0.01, 0.01, 0.01], xtol=1e-14,
                        ftol=1e-14, gtol=1e-14)  # fmt: skip
    pose = np.eye(4)
    turn = Rotation.from_rotvec(fit.x[3:]) * start
    pose[:3, :3] = turn.as_matrix()
    pose[:3, 3] = middle + fit.x[:3] - turn.apply(middle_place)
    return pose


def strut_vectors(pose: Matrix, fixator: dict[str, Any]) -> Matrix:
    """From b_l to a_l in {B}, shape (6, 3), mm, by homogeneous coordinates."""
    ones = np.ones((6, 1))
    a = np.hstack([np.array(fixator["proximal"]["joints_mm"], float), ones]) @ pose.T
    return a[:, :3] - np.array(fixator["distal"]["joints_mm"], float)


def strut_lengths(pose: Matrix, fixator: dict[str, Any]) -> Matrix:
    """Strut lengths of a 4×4 pose {A} in {B}, shape (6,), mm."""
    return np.sqrt(np.sum(np.square(strut_vectors(pose, fixator)), axis=1))


def forward(lengths: Matrix, fixator: dict[str, Any], start: Matrix) -> Matrix:
    """Mechanism pose of six lengths by least squares on X-Y-Z angles (Eq. 30 as printed)."""

    def pose_of(x: Matrix) -> Matrix:
        pose = np.eye(4)
        pose[:3, :3] = Rotation.from_euler("xyz", x[3:]).as_matrix()
        pose[:3, 3] = x[:3]
        return pose

    first = np.concatenate([start[:3, 3], np.radians(angles_deg(start))])
    fit = least_squares(
        lambda x: strut_lengths(pose_of(x), fixator) - lengths,
        first,
        x_scale=[1, 1, 1, 0.01, 0.01, 0.01],
        xtol=1e-14,
        ftol=1e-14,
        gtol=1e-14,
    )
    return pose_of(fit.x)


def along(start: Matrix, end: Matrix, s: Matrix) -> Matrix:
    """Poses at s, shape (S,), in [0, 1] on the screw from start to end, shape (S, 4, 4).

    By matrix logarithm and exponential.
    """
    step = np.real(logm(np.linalg.solve(start, end)))
    return start @ expm(np.asarray(s)[:, None, None] * step)


def reading_covariance(pose: Matrix, fixator: dict[str, Any], resolution_mm: float) -> Matrix:
    """Covariance of ξ in X exp(ξ) from readings good to half a resolution, by differences."""
    step = 1e-5

    def moved(xi: Matrix) -> Matrix:
        return strut_lengths(pose @ exponential(xi), fixator)

    slopes = [(moved(xi) - moved(-xi)) / (2 * step) for xi in step * np.eye(6)]
    inverse = np.linalg.inv(np.array(slopes).T)
    return resolution_mm**2 / 12.0 * inverse @ inverse.T


def exponential(xi: Matrix) -> Matrix:
    """4×4 matrix of a twist (mm, rad), by scipy's `RigidTransform`."""
    return RigidTransform.from_exp_coords(np.concatenate([xi[3:], xi[:3]])).as_matrix()


def fuse(
    *, rings: tuple[Matrix, Matrix], struts: Matrix, covariances: tuple[Matrix, Matrix, Matrix]
) -> tuple[Matrix, Matrix]:
    """Ring poses that agree with image and struts, as likely as possible, by `least_squares`.

    Parameters
    ----------
    rings : pair of ndarray, shape (4, 4)
        Recognised proximal and distal ring, LPS.
    struts : ndarray, shape (4, 4)
        X_t.
    covariances : three ndarrays, shape (6, 6)
        Of ξ = (mm, rad) of the proximal ring, the distal ring and X_t, each in its own frame.
    """
    proximal, distal = rings
    whiten = [np.linalg.inv(np.linalg.cholesky(c)) for c in covariances]

    def residual(x: Matrix) -> Matrix:
        moved = np.linalg.solve(proximal, distal @ exponential(x[:6]) @ struts @ exponential(x[6:]))
        coords = RigidTransform.from_matrix(moved).as_exp_coords()
        xi_a = np.concatenate([coords[3:], coords[:3]])
        return np.concatenate([whiten[0] @ xi_a, whiten[1] @ x[:6], whiten[2] @ x[6:]])

    fit = least_squares(residual, np.zeros(12), x_scale=np.tile([1, 1, 1, 0.01, 0.01, 0.01], 2),
                        xtol=1e-14, ftol=1e-14, gtol=1e-14)  # fmt: skip
    corrected = distal @ exponential(fit.x[:6])
    return corrected @ struts @ exponential(fit.x[6:]), corrected
