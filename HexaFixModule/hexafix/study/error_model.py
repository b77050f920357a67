"""The errors of balls and installation, and how they act on a ring's pose (Eq. 20, 23, 25)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import InputError
from hexafix.recognition.least_squares import IMAGE_SIGMA_MM, INSTALLATION_SIGMA_MM
from hexafix.study.layouts import RingLayouts

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ErrorModel:
    """Independent normal errors of every marker, the paper's by default.

    Attributes
    ----------
    image_sigma_mm : tuple of float
        Of a ball centre along the image's x, y, z axes.
    installation_sigma_mm : tuple of float
        Of a marker's place along the ring's x, y, z axes; ±3 σ is the tolerance.

    Raises
    ------
    InputError
        If a number is negative or not finite, or an axis has no error at all.

    Notes
    -----
    Source: Section 4.3.
    """

    image_sigma_mm: tuple[float, float, float] = (IMAGE_SIGMA_MM, IMAGE_SIGMA_MM, IMAGE_SIGMA_MM)
    installation_sigma_mm: tuple[float, float, float] = (
        INSTALLATION_SIGMA_MM,
        INSTALLATION_SIGMA_MM,
        INSTALLATION_SIGMA_MM,
    )

    def __post_init__(self) -> None:
        both = np.array([self.image_sigma_mm, self.installation_sigma_mm], float)
        good = both.shape == (2, 3) and np.all(np.isfinite(both)) and np.all(both >= 0.0)
        if not good or not np.all(both.sum(axis=0) > 0.0):
            raise InputError.of(
                "bad-error-model",
                "each axis needs an image or installation error, none may be negative",
                value=f"image {self.image_sigma_mm}, installation {self.installation_sigma_mm} mm",
                limit="finite, 0 or more, not both 0",
                next_step="give three standard deviations in mm for each",
            )

    @property
    def variance_mm2(self) -> Array:
        """Image and installation together, shape (3,), mm², ring aligned with the image."""
        return np.square(self.image_sigma_mm) + np.square(self.installation_sigma_mm)


def installation_maps(layouts: RingLayouts) -> Array:
    """How deviations ε along the ring's axes become Δη = (δt, δφ, δh), shape (G, N, 3, 3).

    Rows in mm, rad, mm; columns ε_x, ε_y, ε_z in mm.

    Notes
    -----
    Source: Eq. (25). Departs: radians where the paper has degrees.
    """
    cos, sin = np.cos(layouts.sweep_rad), np.sin(layouts.sweep_rad)
    maps = np.zeros((*cos.shape, 3, 3))
    maps[..., 0, 0], maps[..., 0, 1] = cos, sin
    maps[..., 1, 0], maps[..., 1, 1] = -sin / layouts.radius_mm, cos / layouts.radius_mm
    maps[..., 2, 2] = 1.0
    return maps


def error_maps(jacobians: Array, layouts: RingLayouts, errors: ErrorModel) -> Array:
    """Maps from standard normal numbers to pose errors.

    Parameters
    ----------
    jacobians : ndarray, shape (G, M, 6, N, 6)
        Of `jacobians.py`: M models of each of G layouts.
    layouts : RingLayouts
    errors : ErrorModel

    Returns
    -------
    ndarray, shape (G, M, 6, 6N)
        Rows x y z α β γ, mm and radians; columns for each marker: image x y z, ε_x ε_y ε_z.

    Notes
    -----
    Source: Eq. (23) with Eq. (25).
    """
    image = jacobians[..., :3] * np.asarray(errors.image_sigma_mm)
    turned = np.einsum("gmane,gnec->gmanc", jacobians[..., 3:], installation_maps(layouts))
    both = np.concatenate([image, turned * np.asarray(errors.installation_sigma_mm)], axis=-1)
    return both.reshape(*both.shape[:3], -1)


def exact_covariances(maps: Array) -> Array:
    """Covariances of the pose errors, shape (G, M, 6, 6N) of `error_maps` to (G, M, 6, 6)."""
    return maps @ np.swapaxes(maps, -1, -2)


def absolute_covariances(covariances: Array) -> Array:
    """Covariances of |ΔX| of normal errors ΔX, shape (..., 6, 6) to (..., 6, 6).

    Notes
    -----
    E|x||y| = (2/π) σ_x σ_y (√(1-ρ²) + ρ arcsin ρ) for zero-mean normals of correlation ρ.
    """
    sigma = np.sqrt(np.diagonal(covariances, axis1=-2, axis2=-1))
    product = sigma[..., :, None] * sigma[..., None, :]
    rho = np.clip(covariances / product, -1.0, 1.0)
    return 2.0 / np.pi * product * (np.sqrt(1.0 - rho**2) + rho * np.arcsin(rho) - 1.0)
