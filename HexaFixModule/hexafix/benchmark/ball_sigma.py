"""Calibrate the stated uncertainty of ball centres: the weights in `hexafix.markers.uncertainty`.

``python -m hexafix.benchmark.ball_sigma [--thick] [PLACEMENTS]`` renders balls in random
situations and in those of `hexafix.benchmark.balls`, half each, and prints the weights that make
the true errors most likely.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from hexafix.benchmark.balls import SITUATIONS
from hexafix.markers.crop import Crop
from hexafix.markers.directions import sphere_directions
from hexafix.markers.find import SURROUND_MM, THICK_SLICES_MM
from hexafix.markers.model import fit_model
from hexafix.markers.rays import DIRECTIONS, fine_fit, rough_fit
from hexafix.markers.uncertainty import CLIPPED_CORE, TERMS, variance_terms
from hexafix.phantom.local import Scene, render_ball

MORE = (
    Scene(rod_diameter_mm=0.0),
    Scene(tissue_gap_mm=0.0),
    Scene(streak_hu=400.0),
    Scene(spacing_mm=(0.7, 0.7, 2.0)),
    Scene(spacing_mm=(0.7, 0.7, 2.5), streak_hu=200.0),
    Scene(spacing_mm=(0.7, 0.7, 3.0)),
)
"""Situations that count beside those of the benchmark."""
OUTLIER = 12.0
"""Squared errors count up to this multiple of the stated variance."""


def random_scene(rng: np.random.Generator, *, thick: bool) -> Scene:
    """A ball in a situation drawn from what scanners and frames offer."""
    plane = float(rng.uniform(0.45, 1.0))
    thin = rng.choice([rng.uniform(0.4, 1.3), rng.uniform(0.4, 2.0)])
    along = float(rng.uniform(2.05, 3.5) if thick else thin)

    def maybe(share: float, low: float, high: float) -> float | None:
        return float(rng.uniform(low, high)) if rng.uniform() < share else None

    return Scene(
        spacing_mm=(plane, plane, along),
        slice_thickness_mm=along * float(rng.choice([1.0, 1.0, 1.5])),
        ball_diameter_mm=float(rng.choice([8.0, 10.0, 10.0, 12.0])),
        ball_hu=float(rng.choice([1900.0, 2300.0, 2300.0, 2700.0, 12000.0])),
        psf_sigma_mm=float(rng.uniform(0.4, 0.8)),
        rod_diameter_mm=maybe(0.75, 4.0, 6.0) or 0.0,
        rod_hu=float(rng.uniform(60.0, 200.0)),
        tissue_gap_mm=maybe(0.33, -2.0, 4.0),
        ring_gap_mm=maybe(0.25, 0.5, 5.0),
        streak_hu=maybe(0.5, 30.0, 400.0) or 0.0,
        noise_hu=float(rng.uniform(10.0, 120.0)),
        noise_correlation_mm=maybe(0.5, 0.3, 0.9) or 0.0,
    )


def observe(scene: Scene, rng: np.random.Generator) -> tuple[float, NDArray[np.float64]] | None:
    """Mean squared error of one axis, mm², and the variance terms; None where the fit fails."""
    volume, truth = render_ball(scene, rng)
    radius = 0.5 * scene.ball_diameter_mm
    start = truth.center_mm + 0.15 * rng.normal(size=3)
    crop = Crop.around(volume, start, radius + SURROUND_MM)
    rough = rough_fit(crop, start, radius)
    rays = None if rough is None else fine_fit(crop, rough, radius)
    if rays is None:
        return None
    thick = max(scene.spacing_mm) > THICK_SLICES_MM
    model = fit_model(
        crop,
        rays.center_mm,
        radius,
        cut=sphere_directions(DIRECTIONS)[rays.cut],
        clip_hu=crop.brightest if rays.clipped_share > CLIPPED_CORE else None,
        all_voxels=thick,
    )
    by_model = thick and model is not None
    center = model.center_mm if by_model and model is not None else rays.center_mm
    error = float(np.mean((center - truth.center_mm) ** 2))
    return error, variance_terms(rays, model, by_model=by_model)


def calibrate(placements: int, seed: int = 1, *, thick: bool = False) -> NDArray[np.float64]:
    """Most likely weights of `TERMS`, shape (6,), all ≥ 0."""
    rng = np.random.default_rng(seed)
    fixed = [scene for scene, _ in SITUATIONS.values()] + list(MORE)
    fixed = [scene for scene in fixed if (max(scene.spacing_mm) > THICK_SLICES_MM) == thick]
    seen = []
    for number in range(placements):
        chance = number % 2 == 0
        scene = random_scene(rng, thick=thick) if chance else fixed[number // 2 % len(fixed)]
        seen.append(observe(scene, rng))
    error = np.array([one[0] for one in seen if one is not None])
    terms = np.array([one[1] for one in seen if one is not None])
    return most_likely(error, terms)


def most_likely(error: NDArray[np.float64], terms: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights, shape (6,), of variance terms, (n, 6), for mean squared errors, (n,)."""

    def cost(logs: NDArray[np.float64]) -> float:
        variance = terms @ np.exp(logs)
        return float(np.mean(np.log(variance) + np.minimum(error / variance, OUTLIER)))

    best = np.zeros(terms.shape[1])
    for start in range(4):
        first = np.random.default_rng(start).normal(-0.5, 1.0, terms.shape[1])
        found = minimize(
            cost, first, method="Nelder-Mead", options={"maxiter": 12_000, "fatol": 1e-7}
        )
        best = found.x if start == 0 or found.fun < cost(best) else best
    return np.exp(best)


if __name__ == "__main__":
    numbers = [int(word) for word in sys.argv[1:] if word.isdigit()]
    weights = calibrate(*(numbers or [600]), thick="--thick" in sys.argv)
    print(dict(zip(TERMS, weights.round(4).tolist(), strict=True)))
