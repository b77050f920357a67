from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.imaging.volume import Volume
from hexafix.phantom.local import LocalTruth, Scene, random_affine, render_ball
from scipy.special import erf

SIGMA_MM = 0.55


@pytest.fixture
def crop_with_ball() -> Callable[..., tuple[Volume, LocalTruth]]:
    """A rendered ball in a random oblique grid: `crop_with_ball(seed, **scene)`."""

    def make(seed: int, half_width_mm: float = 11.0, **scene) -> tuple[Volume, LocalTruth]:
        generator = np.random.default_rng(seed)
        return render_ball(Scene(**scene), generator, half_width_mm=half_width_mm)

    return make


class Workbench:
    """An oblique volume of air to paint blurred things into, places in mm from its middle."""

    def __init__(self, seed: int, half_width_mm: tuple[float, float, float]) -> None:
        self.random = np.random.default_rng(seed)
        spacing = (0.7, 0.8, 0.9)
        self.affine = random_affine(self.random, spacing)
        shape = [round(2 * h / s) + 1 for h, s in zip(half_width_mm, spacing, strict=True)]
        middle = (np.array(shape) - 1) / 2.0 + self.random.uniform(-0.5, 0.5, 3)
        self.middle_mm = self.affine[:3, :3] @ middle + self.affine[:3, 3]
        self.axes = self.affine[:3, :3] / np.array(spacing)
        grid = np.stack(np.meshgrid(*[np.arange(n) for n in shape], indexing="ij"), -1)
        self.points = (grid - middle) * np.array(spacing)
        self.hu = np.full(shape, -1000.0)

    def lps(self, at_mm) -> np.ndarray:
        return self.middle_mm + self.axes @ np.asarray(at_mm, float)

    def fill(self, share: np.ndarray, hu: float) -> None:
        self.hu += (hu - self.hu) * share

    def ball(self, at_mm, diameter_mm: float = 10.0, hu: float = 2300.0) -> None:
        away = np.linalg.norm(self.points - np.asarray(at_mm), axis=-1)
        self.fill(blurred_ball(away, radius_mm=diameter_mm / 2, sigma_mm=SIGMA_MM), hu)

    def rod(self, start_mm, end_mm, diameter_mm: float, hu: float) -> None:
        start, end = np.asarray(start_mm, float), np.asarray(end_mm, float)
        length = np.linalg.norm(end - start)
        along = (self.points - start) @ (end - start) / length
        square = np.sum((self.points - start) ** 2, axis=-1) - along**2
        away = np.sqrt(np.maximum(square, 0.0))
        self.fill(self._step(diameter_mm / 2 - away) * self._step(along, length), hu)

    def box(self, at_mm, half_mm, hu: float) -> None:
        share = np.ones(self.hu.shape)
        for axis in range(3):
            share = share * self._step(half_mm[axis] - np.abs(self.points[..., axis] - at_mm[axis]))
        self.fill(share, hu)

    def volume(self, noise_hu: float = 30.0) -> Volume:
        noisy = self.hu + noise_hu * self.random.standard_normal(self.hu.shape)
        hu = np.clip(np.rint(noisy), -1024, 3071).astype(np.int16)
        return Volume(np.ascontiguousarray(hu.transpose(2, 1, 0)), self.affine)

    @staticmethod
    def _step(distance: np.ndarray, length: float | None = None) -> np.ndarray:
        rise = 0.5 * (1 + erf(distance / (np.sqrt(2) * SIGMA_MM)))
        if length is None:
            return rise
        return rise * 0.5 * (1 + erf((length - distance) / (np.sqrt(2) * SIGMA_MM)))


@pytest.fixture
def workbench() -> Callable[..., Workbench]:
    """`workbench(seed, half_width_mm)`, an oblique volume of air to paint into."""

    def make(seed: int = 0, half_width_mm: tuple[float, float, float] = (24.0, 14.0, 14.0)):
        return Workbench(seed, half_width_mm)

    return make
