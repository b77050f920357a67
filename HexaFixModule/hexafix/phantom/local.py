"""One marker ball and its close surroundings, rendered with exact truth: the bench of the fits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter
from scipy.special import erf

from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.imaging.volume import Volume

AIR_HU = -1000.0
CLIP_HU = 3071


@dataclass(frozen=True, slots=True)
class Scene:
    """What surrounds a ball in a crop, and how the scanner saw it.

    Attributes
    ----------
    spacing_mm : tuple of float
        Voxel pitch along i, j, k.
    slice_thickness_mm : float or None
        Slice profile (box); None: as thick as the pitch along k.
    ball_diameter_mm, ball_hu : float
    psf_sigma_mm : float
        Isotropic Gaussian blur.
    rod_diameter_mm, rod_hu : float
        Rod that ends in the ball, in a random direction; diameter 0: none.
    rod_direction : tuple of float or None
        LPS direction from the ball along the rod; None: random.
    tissue_gap_mm : float or None
        Distance from the ball's surface to a soft-tissue half space; negative: the ball dips into
        it; None: air all around.
    ring_gap_mm : float or None
        Distance from the ball's surface to a metal plate, 8 mm thick; None: no plate.
    ring_hu : float
    streak_hu : float
        Height of a bright or dark band across the ball in the slice plane, σ 2.5 mm across and
        8 mm along the slice normal, within a radius of the centre; 0: none.
    noise_hu : float
        Standard deviation of the noise.
    noise_correlation_mm : float
        Gaussian correlation of the noise; 0: white.
    """

    spacing_mm: tuple[float, float, float] = (0.7, 0.7, 0.625)
    slice_thickness_mm: float | None = None
    ball_diameter_mm: float = 10.0
    ball_hu: float = 2300.0
    psf_sigma_mm: float = 0.5
    rod_diameter_mm: float = 5.0
    rod_hu: float = 120.0
    rod_direction: tuple[float, float, float] | None = None
    tissue_gap_mm: float | None = None
    ring_gap_mm: float | None = None
    ring_hu: float = 2300.0
    streak_hu: float = 0.0
    noise_hu: float = 30.0
    noise_correlation_mm: float = 0.0


@dataclass(frozen=True, eq=False)
class LocalTruth:
    """What was rendered.

    Attributes
    ----------
    center_mm : ndarray, shape (3,)
        Of the ball, LPS mm.
    rod_direction : ndarray, shape (3,)
        Unit vector from the ball along the rod, LPS.
    diameter_mm : float
    """

    center_mm: NDArray[np.float64]
    rod_direction: NDArray[np.float64]
    diameter_mm: float


def random_affine(
    rng: np.random.Generator, spacing_mm: tuple[float, float, float]
) -> NDArray[np.float64]:
    """Oblique, off-origin voxel→LPS matrix, shape (4, 4), of either handedness."""
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    affine = np.eye(4)
    affine[:3, :3] = rotation * np.asarray(spacing_mm)
    affine[:3, 3] = rng.uniform(-300.0, 300.0, 3)
    return affine


def _smooth_step(distance: NDArray[np.float64], sigma: float) -> NDArray[np.float64]:
    """Blurred indicator of distance > 0."""
    return 0.5 * (1.0 + erf(distance / (np.sqrt(2.0) * sigma)))


def _random_unit(rng: np.random.Generator) -> NDArray[np.float64]:
    vector = rng.normal(size=3)
    return vector / np.linalg.norm(vector)


def _tilted(
    rng: np.random.Generator, away_from: NDArray[np.float64], least_deg: float
) -> NDArray[np.float64]:
    """Random unit vector at least `least_deg` from the given one."""
    while True:
        unit = _random_unit(rng)
        if unit @ away_from < np.cos(np.radians(least_deg)):
            return unit


def _nodes(scene: Scene) -> list[tuple[NDArray[np.float64], float]]:
    """Quadrature points of a voxel, index offsets (i, j, k) with weights."""
    plane, plane_weight = np.polynomial.legendre.leggauss(2)
    thickness = scene.slice_thickness_mm or scene.spacing_mm[2]
    deep, deep_weight = np.polynomial.legendre.leggauss(3 if thickness <= 1.0 else 5)
    deep = deep * thickness / scene.spacing_mm[2]
    return [
        (0.5 * np.array([a, b, c]), wa * wb * wc / 8.0)
        for a, wa in zip(plane, plane_weight, strict=True)
        for b, wb in zip(plane, plane_weight, strict=True)
        for c, wc in zip(deep, deep_weight, strict=True)
    ]


def render_ball(
    scene: Scene, rng: np.random.Generator, *, half_width_mm: float = 12.0
) -> tuple[Volume, LocalTruth]:
    """A crop with one ball at a random sub-voxel place in a random oblique grid.

    Parameters
    ----------
    scene : Scene
    rng : numpy Generator
        Decides grid, placement, directions and noise.
    half_width_mm : float
        From the ball's centre to the crop's faces.

    Returns
    -------
    Volume, LocalTruth
        Ball and blur are the closed form, averaged over each voxel by Gauss–Legendre nodes; the
        other things are blurred step functions.
    """
    affine = random_affine(rng, scene.spacing_mm)
    shape = [round(2 * half_width_mm / s) + 1 for s in scene.spacing_mm]
    index = (np.array(shape) - 1) / 2.0 + rng.uniform(-0.5, 0.5, 3)
    rod = _random_unit(rng) if scene.rod_direction is None else np.array(scene.rod_direction)
    rod = rod / np.linalg.norm(rod)
    plate = _tilted(rng, rod, 60.0)
    tissue = _tilted(rng, rod, 60.0)
    lateral, normal = affine[:3, 0] / scene.spacing_mm[0], affine[:3, 2] / scene.spacing_mm[2]
    angle, shift, sign = rng.uniform(0, np.pi), rng.uniform(-1, 1), rng.choice([-1.0, 1.0])
    across = np.cos(angle) * lateral + np.sin(angle) * affine[:3, 1] / scene.spacing_mm[1]
    grid = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), -1) - index
    image = np.zeros(shape)
    for offset, weight in _nodes(scene):
        points = (grid + offset) @ affine[:3, :3].T
        image += weight * _scene_hu(scene, points, rod, plate, tissue)
    centre_points = grid @ affine[:3, :3].T
    radius = scene.ball_diameter_mm / 2.0
    band = (centre_points @ across - shift * radius) / 2.5
    image += sign * scene.streak_hu * np.exp(-0.5 * (band**2 + (centre_points @ normal / 8.0) ** 2))
    image += _noise(scene, shape, rng)
    hu = np.clip(np.rint(image), -1024, CLIP_HU).astype(np.int16)
    center = affine[:3, :3] @ index + affine[:3, 3]
    volume = Volume(np.ascontiguousarray(hu.transpose(2, 1, 0)), affine)
    return volume, LocalTruth(center, rod, scene.ball_diameter_mm)


def _scene_hu(
    scene: Scene,
    points: NDArray[np.float64],
    rod: NDArray[np.float64],
    plate: NDArray[np.float64],
    tissue: NDArray[np.float64],
) -> NDArray[np.float64]:
    """HU at points relative to the ball's centre, shape (..., 3) to (...)."""
    sigma, radius = scene.psf_sigma_mm, scene.ball_diameter_mm / 2.0
    around = np.full(points.shape[:-1], AIR_HU)
    if scene.tissue_gap_mm is not None:
        inside = _smooth_step(points @ tissue - radius - scene.tissue_gap_mm, sigma)
        around += (50.0 - AIR_HU) * inside
    if scene.rod_diameter_mm > 0.0:
        along = points @ rod
        away = np.linalg.norm(points - along[..., None] * rod, axis=-1)
        inside = _smooth_step(scene.rod_diameter_mm / 2.0 - away, sigma) * _smooth_step(
            along, sigma
        )
        around += (scene.rod_hu - around) * inside
    if scene.ring_gap_mm is not None:
        depth = points @ plate - radius - scene.ring_gap_mm
        inside = _smooth_step(depth, sigma) * _smooth_step(8.0 - depth, sigma)
        around += (scene.ring_hu - around) * inside
    distance = np.linalg.norm(points, axis=-1)
    ball = blurred_ball(distance, radius_mm=radius, sigma_mm=sigma)
    return around + (scene.ball_hu - around) * ball


def _noise(scene: Scene, shape: list[int], rng: np.random.Generator) -> NDArray[np.float64]:
    """Noise of the wanted standard deviation and correlation."""
    noise = rng.normal(size=shape)
    if scene.noise_correlation_mm > 0.0:
        width = [scene.noise_correlation_mm / s for s in scene.spacing_mm]
        noise = gaussian_filter(noise, width, mode="wrap")
        noise /= noise.std()
    return scene.noise_hu * noise
