"""Numbers as they stand in files: finite, degrees, rounded far below their meaning."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.geometry import Pose

COVARIANCE_ORDER = ["x_mm", "y_mm", "z_mm", "rx_deg", "ry_deg", "rz_deg"]
"""Order of the rows of every 6×6 covariance in a file: ξ of T exp(ξ) in the ring's frame."""

_TO_FILE = np.array([1.0, 1.0, 1.0, *np.degrees(np.ones(3))])


def rounded(values: ArrayLike, digits: int = 9) -> Any:
    """Numbers as nested lists of floats, rounded so that the last bits of a library do not show."""
    array = np.round(np.asarray(values, float), digits) + 0.0
    return array.tolist()


def pose_document(pose: Pose) -> dict[str, Any]:
    """A pose {A} in {B}: position, X-Y-Z fixed angles and matrix."""
    return {
        "position_mm": rounded(pose.position_mm),
        "angles_deg": rounded(np.degrees(pose.angles_rad)),
        "matrix": rounded(pose.matrix, 12),
    }


def covariance_document(covariance: ArrayLike) -> dict[str, Any]:
    """A covariance of ξ with its order, and its standard deviations; degrees in files."""
    in_file = np.asarray(covariance, float) * np.outer(_TO_FILE, _TO_FILE)
    sigma = np.sqrt(np.diag(in_file))
    return {
        "covariance": rounded(in_file, 12),
        "covariance_order": COVARIANCE_ORDER,
        "sigma_position_mm": rounded(sigma[:3]),
        "sigma_angles_deg": rounded(sigma[3:]),
    }
