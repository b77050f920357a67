"""The closed form of a ball seen through a Gaussian point spread."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray


def blurred_ball(
    distance_mm: ArrayLike, *, radius_mm: float, sigma_mm: float
) -> NDArray[np.float64]:
    """Share of a unit ball's density left at a distance from its centre after Gaussian blur.

    Parameters
    ----------
    distance_mm : array_like
        Distances from the ball's centre, mm, ≥ 0.
    radius_mm, sigma_mm : float
        The ball's radius and the isotropic blur's standard deviation, mm.

    Returns
    -------
    ndarray
        Same shape, from 1 deep inside to 0 far outside.

    Notes
    -----
    The three-dimensional convolution of the ball's indicator with the Gaussian, integrated over
    spheres; the limit at r = 0 is taken by its series.
    """
    r = np.maximum(np.asarray(distance_mm, float), 1e-6 * radius_mm)
    width = np.sqrt(2.0) * sigma_mm
    near, far = (radius_mm - r) / width, (radius_mm + r) / width
    shell = sigma_mm / (np.sqrt(2.0 * np.pi) * r) * (np.exp(-(near**2)) - np.exp(-(far**2)))
    return 0.5 * (scipy.special.erf(near) + scipy.special.erf(far)) - shell
