"""The covariance of a fitted centre, calibrated on simulated balls.

The normal matrix alone is two to five times too small near metal: neighbouring rays share their
voxels, and streaks bend the surface as a whole. What bends it shows in the residuals: their
lobes of degree three are as strong as the shift, of degree one, that the centre has absorbed.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from hexafix.markers.directions import sphere_directions
from hexafix.markers.model import ModelFit
from hexafix.markers.rays import DIRECTIONS, RayFit

TERMS = ("normal matrix", "lobes of degree 3", "degree 2", "apart", "residual", "floor")
"""What the variance of one axis is the weighted sum of; see `variance_terms`."""
RAY_WEIGHTS = (0.0, 2.3844, 0.0, 0.2756, 1.4706, 0.0)
"""Made by ``python -m hexafix.benchmark.ball_sigma 480``."""
MODEL_WEIGHTS = (5.7697, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The same for centres of the model fit, slices above 2 mm: ``… --thick 160``."""
FLOOR_MM = 0.001
CLIPPED_CORE = 0.02
"""Share of clipped voxels in the core from which a ball counts as clipped."""
ROUND_SHARE = 0.5
"""How far the covariance is a sphere; for the rest it has the normal matrix's shape."""


def variance_terms(rays: RayFit, model: ModelFit | None, *, by_model: bool) -> NDArray[np.float64]:
    """The variances that `TERMS` names, mean of the three axes, shape (6,), mm².

    Parameters
    ----------
    rays : RayFit
    model : ModelFit or None
    by_model : bool
        Whether the model gives the centre.

    Notes
    -----
    How far rays and model lie apart says nothing where the model sees only half of the ball's
    edge, as with a clipped one.
    """
    even, odd = _lobes(rays)
    apart = 0.0
    if model is not None and rays.clipped_share <= CLIPPED_CORE:
        apart = float(np.sum((model.center_mm - rays.center_mm) ** 2)) / 3.0
    formal = np.trace(_formal(rays, model, by_model=by_model)) / 3.0
    return np.array([formal, odd, even, apart, rays.rms_mm**2 / 100.0, FLOOR_MM**2])


def centre_covariance(
    rays: RayFit, model: ModelFit | None, *, by_model: bool
) -> NDArray[np.float64]:
    """Covariance of the centre, LPS mm², shape (3, 3); arguments as in `variance_terms`."""
    weights = np.array(MODEL_WEIGHTS if by_model else RAY_WEIGHTS)
    variance = max(float(weights @ variance_terms(rays, model, by_model=by_model)), FLOOR_MM**2)
    formal = _formal(rays, model, by_model=by_model)
    shape = 3.0 * formal / np.trace(formal)
    covariance = variance * (ROUND_SHARE * np.eye(3) + (1.0 - ROUND_SHARE) * shape)
    return 0.5 * (covariance + covariance.T)


def _formal(rays: RayFit, model: ModelFit | None, *, by_model: bool) -> NDArray[np.float64]:
    """Covariance of the centre by the normal matrix."""
    if by_model and model is not None:
        return model.covariance_mm2
    return np.asarray(rays.rms_mm**2 * np.linalg.inv(rays.normal)[:3, :3], float)


def _lobes(rays: RayFit) -> tuple[float, float]:
    """Mean squares of the residuals' harmonics of degree 2 and of degree 3, mm²."""
    rows = _harmonics()
    weighted = rays.weight[:, None] * rows
    normal = rows.T @ weighted + np.eye(rows.shape[1])
    strength = np.linalg.solve(normal, weighted.T @ np.nan_to_num(rays.residual_mm)) ** 2
    return float(strength[4:9].mean()), float(strength[9:].mean())


@cache
def _harmonics() -> NDArray[np.float64]:
    """Real harmonics of degree 0 to 3 of mean square 1 at the directions, (DIRECTIONS, 16)."""
    x, y, z = sphere_directions(DIRECTIONS).T
    return np.stack(
        [
            np.ones_like(x),
            *(np.sqrt(3.0) * axis for axis in (x, y, z)),
            *(np.sqrt(15.0) * product for product in (x * y, y * z, z * x)),
            np.sqrt(15.0) / 2.0 * (x**2 - y**2),
            np.sqrt(5.0) / 2.0 * (3.0 * z**2 - 1.0),
            np.sqrt(35.0 / 8.0) * x * (x**2 - 3.0 * y**2),
            np.sqrt(35.0 / 8.0) * y * (3.0 * x**2 - y**2),
            np.sqrt(105.0) * x * y * z,
            np.sqrt(105.0) / 2.0 * z * (x**2 - y**2),
            np.sqrt(21.0 / 8.0) * x * (5.0 * z**2 - 1.0),
            np.sqrt(21.0 / 8.0) * y * (5.0 * z**2 - 1.0),
            np.sqrt(7.0) / 2.0 * z * (5.0 * z**2 - 3.0),
        ],
        axis=-1,
    )
