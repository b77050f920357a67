"""The covariance of a fitted centre, calibrated on simulated balls."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexafix.markers.model import ModelFit
from hexafix.markers.rays import RayFit

CORRELATION = 6.0
"""Variance of the centre over the normal matrix's: neighbouring rays share their voxels."""
FLOOR_MM = 0.002
DISAGREEMENT_SHARE = 0.4


def centre_covariance(rays: RayFit, model: ModelFit | None) -> NDArray[np.float64]:
    """Covariance of the centre, LPS mm², shape (3, 3)."""
    shape = np.linalg.pinv(rays.normal)[:3, :3]
    covariance = CORRELATION * max(rays.rms_mm, 0.003) ** 2 * shape
    apart = 0.0
    if model is not None:
        apart = float(np.linalg.norm(model.center_mm - rays.center_mm))
    extra = FLOOR_MM**2 + (DISAGREEMENT_SHARE * apart) ** 2 / 3.0
    return covariance + extra * np.eye(3)
