"""Balls in slices of a tilted gantry: found as in straight ones, dropped at their rim."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.imaging.gantry_tilt import OrthogonalGrid
from hexafix.imaging.volume import Acquisition, ImageSource, Volume
from hexafix.markers import find_balls
from scipy.spatial.transform import Rotation

AIR_HU, FILL_HU = -1000.0, -1024
BORDER_MM = 0.75
"""How far inside a ball's surface must lie, for voxels below this."""


@dataclass(frozen=True, eq=False)
class Scan:
    """An oblique stack of slices that lean towards columns and rows by angles in deg."""

    seed: int
    lean_deg: tuple[float, float] = (0.0, 0.0)
    spacing_mm: tuple[float, float, float] = (0.7, 0.7, 0.7)
    size_ijk: tuple[int, int, int] = (90, 90, 60)
    sigma_mm: float = 0.45

    @property
    def affine(self) -> np.ndarray:
        generator = np.random.default_rng(self.seed)
        frame = Rotation.random(rng=generator).as_matrix()
        towards_j, towards_i = np.tan(np.radians(self.lean_deg))
        affine = np.eye(4)
        affine[:3, :3] = frame * self.spacing_mm
        affine[:3, 2] += self.spacing_mm[2] * frame[:, :2] @ (towards_i, towards_j)
        affine[:3, 3] = generator.uniform(-200.0, 200.0, 3)
        return affine

    def lps(self, ijk) -> np.ndarray:
        return np.asarray(ijk, float) @ self.affine[:3, :3].T + self.affine[:3, 3]

    def share(self, center_mm, radius_mm) -> tuple[tuple[slice, ...], np.ndarray]:
        """Which voxels a ball reaches, and its share of them: closed form, averaged by nodes."""
        reach = (radius_mm + 3.0) / np.array(self.spacing_mm)
        reach[:2] += reach[2] * np.abs(np.tan(np.radians(self.lean_deg[::-1])))
        at = np.linalg.solve(self.affine[:3, :3], center_mm - self.affine[:3, 3])
        low = np.clip(np.floor(at - reach).astype(int), 0, self.size_ijk)
        high = np.clip(np.ceil(at + reach).astype(int) + 1, 0, self.size_ijk)
        index = np.stack(
            np.meshgrid(*map(np.arange, low[::-1], high[::-1]), indexing="ij")[::-1], -1
        )
        away = self.lps(index) - center_mm
        box = self.affine[:3, :3] / self.spacing_mm
        box[:, 2] = np.cross(box[:, 0], box[:, 1])
        share = np.zeros(index.shape[:3])
        (plane, _), (deep, weights) = map(np.polynomial.legendre.leggauss, (2, 3))
        for a, b, c in np.ndindex(2, 2, 3):
            node = 0.5 * np.array([plane[a], plane[b], deep[c]]) * self.spacing_mm
            distance = np.linalg.norm(away + box @ node, axis=-1)
            ball = blurred_ball(distance, radius_mm=radius_mm, sigma_mm=self.sigma_mm)
            share += weights[c] / 8.0 * ball
        return tuple(slice(m, n) for m, n in zip(low, high, strict=True))[::-1], share

    def volume(self, centers_mm, *, diameter_mm, hu=2300.0, noise_hu=30.0) -> Volume:
        """The balls in air as the slices show them, moved to the orthogonal grid."""
        image = np.full(self.size_ijk[::-1], AIR_HU)
        for center in centers_mm:
            box, share = self.share(center, 0.5 * diameter_mm)
            image[box] += share * (hu - AIR_HU)
        image += noise_hu * np.random.default_rng(self.seed).standard_normal(image.shape)
        acquired = np.clip(np.rint(image), FILL_HU, 3071).astype(np.int16)
        tilt = np.degrees(np.arctan(np.hypot(*np.tan(np.radians(self.lean_deg)))))
        return self._moved(acquired, float(tilt))

    def _moved(self, acquired, tilt_deg) -> Volume:
        if not tilt_deg:
            return Volume(acquired, self.affine)
        axes = (self.affine[:3, :2] / self.spacing_mm[:2]).T
        axes = np.vstack([axes, np.cross(*axes)])
        origins = self.affine[:3, 3] + np.arange(self.size_ijk[2])[:, None] * self.affine[:3, 2]
        grid = OrthogonalGrid.around(
            origins, axes, np.array(self.spacing_mm[:2]), self.size_ijk[:2]
        )
        moved = np.empty(grid.size_ijk[::-1], np.int16)
        for k, (plane, out) in enumerate(zip(acquired, moved, strict=True)):
            grid.place(plane, k, out, outside=FILL_HU)
        acquisition = Acquisition(self.affine, self.size_ijk, tilt_deg)
        return Volume(moved, grid.ijk_to_lps, ImageSource(acquisition=acquisition))


def errors_mm(scan: Scan, *, diameter_mm: float, **scene) -> np.ndarray:
    """Found minus true centres along i, j and the normal, of 8 balls, (8, 3)."""
    generator = np.random.default_rng(scan.seed + 1)
    corner = np.array(list(np.ndindex(2, 2, 2))) - 0.5
    apart = 2.0 * diameter_mm / np.array(scan.spacing_mm)
    index = (np.array(scan.size_ijk) - 1) / 2.0 + corner * apart
    centers = scan.lps(index + generator.uniform(-0.5, 0.5, index.shape))
    volume = scan.volume(centers, diameter_mm=diameter_mm, **scene)
    found = find_balls(volume, ball_diameter_mm=diameter_mm).centers_mm
    assert len(found) == len(centers)
    nearest = np.linalg.norm(found[None] - centers[:, None], axis=-1).argmin(axis=1)
    assert len(set(nearest)) == len(centers)
    return (found[nearest] - centers) @ volume.direction


LEANS = [(-18.5, 0.0), (25.0, 0.0), (14.0, -12.0)]


@pytest.mark.parametrize(
    ("diameter", "spacing"),
    [(6.0, (0.6, 0.6, 0.5)), (8.0, (0.5, 0.5, 1.0)), (10.0, (1.0, 0.9, 1.0))],
)
def test_balls_of_tilted_slices_are_found_as_exactly_as_of_straight_ones(diameter, spacing):
    size = tuple(int(n) for n in np.ceil((4.0 * diameter + 8.0) / np.array(spacing)))
    straight, tilted = (
        [
            errors_mm(Scan(seed, lean, spacing, size), diameter_mm=diameter)
            for seed, lean in enumerate(leans)
        ]
        for leans in ([(0.0, 0.0)] * len(LEANS), LEANS)
    )
    straight, tilted = np.vstack(straight), np.vstack(tilted)
    rms = {name: np.sqrt(np.mean(e**2)) for name, e in (("s", straight), ("t", tilted))}
    assert rms["t"] < 1.3 * rms["s"] + 2e-4
    assert np.abs(tilted.mean(axis=0)).max() < 0.002
    assert np.linalg.norm(tilted, axis=1).max() < 0.06


@pytest.mark.parametrize("lean", LEANS)
def test_clipped_balls_of_tilted_slices_are_found(lean):
    scan = Scan(7, lean, (0.8, 0.8, 1.0), (50, 50, 40))
    errors = errors_mm(scan, diameter_mm=8.0, hu=8000.0)
    assert np.linalg.norm(errors, axis=1).max() < 0.06


def at_the_rim(scan: Scan, inside_mm: float, *, far: bool) -> np.ndarray:
    """A point so far within the face of the first or last row of the acquired slices, mid-stack."""
    i, j, k = scan.size_ijk
    face = np.linalg.inv(scan.affine[:3, :3])[1]
    inside = inside_mm * np.linalg.norm(face)
    return scan.lps((i / 2, j - 0.5 - inside if far else inside - 0.5, k / 2))


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("lean", [20.0, -20.0])
@pytest.mark.parametrize("cut_mm", [1.5, 0.5, -0.6])
def test_a_ball_cut_by_the_air_beside_the_slices_is_rejected_as_by_an_edge(lean, far, cut_mm):
    scan = Scan(3, (lean, 0.0), size_ijk=(60, 70, 80))
    center = at_the_rim(scan, 4.0 - cut_mm, far=far)
    volume = scan.volume([center, scan.lps((30, 35, 40))], diameter_mm=8.0)
    index = volume.ijk_from_lps(center)
    # Nowhere near a face of the volume itself: only the acquired region ends here.
    assert min(*index, *(np.array(volume.size_ijk) - 1 - index)) * 0.7 > 10.0
    found = find_balls(volume, ball_diameter_mm=8.0)
    assert len(found.balls) == 1
    assert np.linalg.norm(found.balls[0].center_mm - scan.lps((30, 35, 40))) < 0.02
    reasons = [r.reason for r in found.rejected if np.linalg.norm(r.center_mm - center) < 2.5]
    assert len(reasons) == 1
    assert reasons[0].startswith("border: ")
    assert "the acquired slices" in reasons[0]


@pytest.mark.parametrize("far", [False, True])
def test_a_ball_wholly_inside_the_tilted_slices_is_kept(far):
    scan = Scan(4, (20.0, 0.0), size_ijk=(60, 70, 80))
    center = at_the_rim(scan, 4.0 + BORDER_MM + 0.1, far=far)
    (ball,) = find_balls(scan.volume([center], diameter_mm=8.0), ball_diameter_mm=8.0).balls
    assert np.linalg.norm(ball.center_mm - center) < 0.03
