"""Covariance-weighted least-squares ring pose: what HexaFix uses by default."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import ImageRefused, InputError, LayoutRejected, Refused
from hexafix.geometry import Pose, matrix_from_rotation_vector, skew
from hexafix.hardware import MarkerLayout
from hexafix.recognition.rigid import (
    MIN_TRIANGLE_HEIGHT_MM,
    Array,
    best_triangle_height_mm,
    kabsch,
    residuals_mm,
    rigid_rms_mm,
)

INSTALLATION_SIGMA_MM = 0.4 / 6
"""Installation error of a marker along each ring axis: ±0.2 mm is 3 σ (paper, Section 4.3)."""

IMAGE_SIGMA_MM = 0.3
"""Error of a ball centre along each image axis when nothing better is known (Section 4.3)."""

RING_RMS_LIMIT_MM = 0.5
"""Largest RMS of a ring's balls against its layout (G2).

With the installation tolerance and balls located to 0.03 mm the RMS stays below 0.18 mm in 999 of
1 000 rings; a pixel spacing wrong by 1 % gives 0.79 mm on an 80 mm ring and must be refused. At
the paper's 0.3 mm a good ring of three balls is refused once in 20: that CT is too coarse.
"""

STEP_MM, STEP_RAD, MAX_STEPS = 1e-10, 1e-12, 50
"""Gauss-Newton ends when its last step is below these, and fails after so many."""


@dataclass(frozen=True, eq=False)
class RingPose:
    """A recognised ring.

    Attributes
    ----------
    pose : Pose
        Maps ring coordinates to LPS.
    covariance : ndarray, shape (6, 6)
        Of ξ in T exp(ξ), ξ = (translation mm, rotation rad) in the ring frame; read-only.
    rms_mm : float
        RMS of `residuals_mm`.
    residuals_mm : ndarray, shape (N,)
        Distance of each ball from its place, in the order of the layout; read-only.
    chi2 : float
        Sum of the squared residuals weighted by their covariances.
    method : str
        ``least-squares`` or ``groups``.
    """

    pose: Pose
    covariance: NDArray[np.float64]
    rms_mm: float
    residuals_mm: NDArray[np.float64]
    chi2: float
    method: str

    @property
    def degrees_of_freedom(self) -> int:
        """3N - 6: what `chi2` is about when the stated covariances are right."""
        return 3 * len(self.residuals_mm) - 6

    @property
    def sigma(self) -> NDArray[np.float64]:
        """Standard deviations of ξ, shape (6,), mm then radians."""
        return np.sqrt(np.diag(self.covariance))


def ring_poses(
    points_mm: ArrayLike,
    layout: MarkerLayout,
    *,
    covariances_mm2: ArrayLike | None = None,
    installation_sigma_mm: ArrayLike = INSTALLATION_SIGMA_MM,
) -> tuple[Array, Array, Array, Array]:
    """Weighted least-squares poses of one ring for a batch of measurements.

    Parameters
    ----------
    points_mm : array_like, shape (K, N, 3)
        Ball centres in the order of `layout.sites`, LPS mm.
    layout : MarkerLayout
    covariances_mm2 : array_like, shape (N, 3, 3) or (K, N, 3, 3), optional
        Of the centres, LPS, mm²; without, `IMAGE_SIGMA_MM` along each axis.
    installation_sigma_mm : array_like, shape (), (3,) or (N, 3)
        Installation error along the ring's x, y, z axes, mm.

    Returns
    -------
    rotation : ndarray, shape (K, 3, 3)
    position_mm : ndarray, shape (K, 3)
    covariance : ndarray, shape (K, 6, 6)
        Of ξ in T exp(ξ), ring frame, mm and radians.
    chi2 : ndarray, shape (K,)

    Raises
    ------
    Refused
        If Gauss-Newton does not converge.

    Notes
    -----
    Source: Eq. (6), solved for all markers at once. Departs: Kabsch start, then Gauss-Newton on
    SE(3) with each ball's weight (Rᵀ C_i R + S)⁻¹, refreshed at every step, C_i the ball's and S
    the installation's covariance. With the same S along each axis this is the minimum of χ²;
    otherwise the weights' own change with R is left out, which is of second order in the errors.
    """
    points = np.asarray(points_mm, float)
    r = layout.points_mm
    rotation, position = kabsch(points_mm=points, layout_mm=r)
    step = np.zeros((len(points), 6))
    for _ in range(MAX_STEPS):
        total = total_covariances(points, rotation, covariances_mm2, installation_sigma_mm)
        normal, gradient, chi2 = _normal_equations(points, r, total, rotation, position)
        step = np.linalg.solve(normal, -gradient[..., None])[..., 0]
        position = position + np.einsum("kij,kj->ki", rotation, step[:, :3])
        rotation = rotation @ matrix_from_rotation_vector(step[:, 3:])
        if np.all(np.abs(step[:, :3]) < STEP_MM) and np.all(np.abs(step[:, 3:]) < STEP_RAD):
            covariance = np.linalg.inv(normal)
            return rotation, position, 0.5 * (covariance + np.swapaxes(covariance, 1, 2)), chi2
    raise Refused.of(
        "ring-pose-diverged",
        "the least-squares ring pose did not converge",
        value=f"last step {np.abs(step[:, :3]).max():.1e} mm",
        limit=f"{STEP_MM:g} mm in {MAX_STEPS} steps",
        hazard="H19",
        next_step="check the numbering and the layout of this ring",
    )


def total_covariances(
    points: Array,
    rotation: Array,
    covariances_mm2: ArrayLike | None,
    installation_sigma_mm: ArrayLike,
) -> Array:
    """Covariance of each ball against its place, ring frame, shape (K, N, 3, 3), mm².

    Parameters
    ----------
    points : ndarray, shape (K, N, 3)
    rotation : ndarray, shape (K, 3, 3)
    covariances_mm2, installation_sigma_mm
        As in `ring_poses`.

    Raises
    ------
    InputError
        If a covariance has the wrong shape or is not positive.
    """
    count = points.shape[1]
    image = np.asarray(
        np.eye(3) * IMAGE_SIGMA_MM**2 if covariances_mm2 is None else covariances_mm2, float
    )
    if covariances_mm2 is not None and image.shape[-3:] != (count, 3, 3):
        raise InputError.of(
            "bad-covariance",
            "one 3×3 covariance a ball is needed",
            value=str(image.shape),
            limit=f"({count}, 3, 3)",
        )
    sigma = np.broadcast_to(np.asarray(installation_sigma_mm, float), (count, 3))
    turn = rotation[:, None]
    total = np.swapaxes(turn, -1, -2) @ image @ turn + sigma[:, :, None] ** 2 * np.eye(3)
    smallest = np.linalg.eigvalsh(total)[..., 0] if np.all(np.isfinite(total)) else np.nan
    if not np.all(smallest > 0.0):
        raise InputError.of(
            "bad-covariance",
            "a ball's covariance plus installation error is not positive",
            value=f"smallest eigenvalue {np.min(smallest):.1e} mm²",
            limit="above 0",
        )
    return total


def _normal_equations(
    points: Array, r: Array, total: Array, rotation: Array, position: Array
) -> tuple[Array, Array, Array]:
    """JᵀWJ, JᵀWe and χ² at the present poses."""
    e = (points - position[:, None, :]) @ rotation - r
    weight = np.linalg.inv(total)
    # In the image R r + p moves by R (ρ + θ × r) with ξ = (ρ, θ); here it is turned back by Rᵀ.
    jacobian = np.concatenate([np.broadcast_to(-np.eye(3), (*r.shape, 3)), skew(r)], axis=-1)
    jacobian = np.broadcast_to(jacobian, (len(points), *jacobian.shape))
    weighted = np.einsum("knia,knij->knaj", jacobian, weight)
    normal = np.einsum("knaj,knjb->kab", weighted, jacobian)
    gradient = np.einsum("knaj,knj->ka", weighted, e)
    return normal, gradient, np.einsum("kni,knij,knj->k", e, weight, e)


def ring_pose(
    points_mm: ArrayLike,
    layout: MarkerLayout,
    *,
    covariances_mm2: ArrayLike | None = None,
    installation_sigma_mm: ArrayLike = INSTALLATION_SIGMA_MM,
) -> RingPose:
    """Pose of one ring by covariance-weighted least squares.

    Parameters
    ----------
    points_mm : array_like, shape (N, 3)
        Ball centres in the order of `layout.sites`, LPS mm.
    layout, covariances_mm2, installation_sigma_mm
        As in `ring_poses`, for one measurement.

    Raises
    ------
    LayoutRejected
        Fewer than three markers (H13) or nearly on one line (H16).
    ImageRefused
        If the balls are the mirror image of the layout (H01).
    """
    points = checked_points(points_mm, layout)
    refuse_mirrored(points, layout)
    rotation, position, covariance, chi2 = ring_poses(
        points[None],
        layout,
        covariances_mm2=covariances_mm2,
        installation_sigma_mm=installation_sigma_mm,
    )
    return ring_pose_value(
        points,
        layout,
        Pose(rotation[0], position[0]),
        covariance[0],
        float(chi2[0]),
        "least-squares",
    )


def ring_pose_value(
    points: Array, layout: MarkerLayout, pose: Pose, covariance: Array, chi2: float, method: str
) -> RingPose:
    """Assemble a `RingPose`; points (N, 3) LPS mm, covariance (6, 6) of ξ in the ring frame."""
    residuals = residuals_mm(
        points_mm=points,
        layout_mm=layout.points_mm,
        rotation=pose.rotation,
        position_mm=pose.position_mm,
    )
    covariance = np.array(covariance)
    for array in (residuals, covariance):
        array.setflags(write=False)
    rms = float(np.sqrt(np.mean(residuals**2)))
    return RingPose(pose, covariance, rms, residuals, chi2, method)


def checked_points(points_mm: ArrayLike, layout: MarkerLayout) -> Array:
    """Points of shape (N, 3) that can hold a ring's pose, or an error (H13, H16)."""
    points = np.asarray(points_mm, float)
    if points.shape != (len(layout), 3) or not np.all(np.isfinite(points)):
        raise InputError.of(
            "bad-points",
            "one finite ball centre for each marker of the layout is needed",
            value=str(points.shape),
            limit=f"({len(layout)}, 3)",
        )
    if len(layout) < 3:
        raise LayoutRejected.of(
            "too-few-markers",
            "a ring's pose needs three markers",
            value=str(len(layout)),
            limit="at least 3",
            hazard="H13",
            next_step="add markers to the layout",
        )
    height = best_triangle_height_mm(layout.points_mm)
    if height < MIN_TRIANGLE_HEIGHT_MM:
        raise LayoutRejected.of(
            "collinear-markers",
            "the markers of a ring lie nearly on one line",
            value=f"triangle height {height:.2f} mm",
            limit=f"{MIN_TRIANGLE_HEIGHT_MM:g} mm",
            hazard="H16",
            next_step="spread the markers around the ring",
        )
    return points


def refuse_mirrored(points: Array, layout: MarkerLayout) -> None:
    """Refuse balls, shape (N, 3), that only the mirrored layout fits (H01)."""
    proper = float(rigid_rms_mm(points_mm=points, layout_mm=layout.points_mm))
    if proper <= RING_RMS_LIMIT_MM:
        return
    mirrored = float(rigid_rms_mm(points_mm=points, layout_mm=layout.points_mm, mirrored=True))
    if mirrored < 0.5 * proper:
        raise ImageRefused.of(
            "mirrored-balls",
            "the balls of a ring are the mirror image of its layout",
            value=f"RMS {proper:.2f} mm as built, {mirrored:.2f} mm mirrored",
            limit=f"{RING_RMS_LIMIT_MM:g} mm as built",
            hazard="H01",
            next_step="check the image's orientation, the numbering and the signs of the heights",
        )
