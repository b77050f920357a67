"""What every study's document holds: settings, names, units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.study.estimates import StudySettings, volumes
from hexafix.study.layouts import PAPER_HEIGHT_MM, PAPER_RADIUS_MM

QUANTITIES = ("x_mm", "y_mm", "z_mm", "alpha_deg", "beta_deg", "gamma_deg")
VOLUMES = ("volume_mm", "volume_deg")
"""Names of E|ΔX| and of Eq. (28) in documents."""


def figures(expected: ArrayLike) -> dict[str, float]:
    """E|ΔX| and its volume errors by name, angles in degrees.

    Parameters
    ----------
    expected : array_like, shape (6,) or (8,)
        mm and radians; with two more numbers, those stand for the volume errors.
    """
    values = np.asarray(expected, float)
    both = values[6:] if len(values) == 8 else np.array(volumes(values))
    degrees = [*values[:3], *np.degrees(values[3:6]), both[0], np.degrees(both[1])]
    return {name: float(value) for name, value in zip(QUANTITIES + VOLUMES, degrees, strict=True)}


def settings_document(settings: StudySettings) -> dict[str, Any]:
    """How a study was run; what changes nothing (workers) is left out."""
    return {
        "radius_mm": PAPER_RADIUS_MM,
        "height_mm": PAPER_HEIGHT_MM,
        "image_sigma_mm": list(settings.errors.image_sigma_mm),
        "installation_sigma_mm": list(settings.errors.installation_sigma_mm),
        "samples": settings.samples,
        "full_samples": settings.full_samples,
        "seed": settings.seed,
    }


def model_words() -> dict[str, str]:
    """What the columns mean."""
    return {
        "groups": "the paper's group method",
        "least-squares": "covariance-weighted least squares, HexaFix's default",
        "exact": "expected |error| by covariance; groups: the paper's linear model, Eq. (20)-(25)",
        "sampled": "the same by Monte Carlo, Eq. (23), (24)",
        "full": "full simulation: balls displaced, measured and recognised",
        "volume": "Eq. (28) on the expectations",
    }
