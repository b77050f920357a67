"""Balls of known places painted into real slices come back where they were put.

The slices, their noise and their headers are real; a ball's share of every pixel is the closed form
of a blurred ball, averaged over the pixel and over the slice thickness along the slice normal.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import InputError
from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.imaging import read_volume
from hexafix.markers import find_balls
from scipy.ndimage import distance_transform_edt

pytestmark = pytest.mark.usefixtures("itk_in_process")

BALL_HU, SIGMA_MM = 2300.0, 0.6
LIMIT_MM = 0.06
AIR_HU, INTERCEPT = -1000.0, -1024
CLEAR_MM = 6.0
"""Nothing but air within this of a ball, as around a limb."""


class Slices:
    """Real slices as arrays of HU with their own frames, read by pydicom alone."""

    def __init__(self, folder) -> None:
        items = [pydicom.dcmread(path) for path in folder.iterdir() if path.name != "LICENSE"]
        row, column = np.reshape(np.array(items[0].ImageOrientationPatient, float), (2, 3))
        self.frame = np.stack([row, column, np.cross(row, column)])
        items.sort(key=lambda item: float(np.array(item.ImagePositionPatient) @ self.frame[2]))
        self.items = items
        self.origins = np.array([item.ImagePositionPatient for item in items], float)
        self.pitch = np.array(items[0].PixelSpacing, float)[::-1]
        self.thickness = float(items[0].SliceThickness)
        self.gap = float(np.diff(self.origins @ self.frame[2]).mean())
        self.hu = np.stack([item.pixel_array.astype(float) + INTERCEPT for item in items])

    def places(self, diameter_mm: float, count: int, seed: int) -> Iterator[np.ndarray]:
        """LPS of balls in air, at any part of a voxel, none cut by a face of the stack."""
        generator = np.random.default_rng(seed)
        dense = (self.hu > -850.0).any(axis=0)
        dense[[0, -1]] = dense[:, [0, -1]] = True
        clear = distance_transform_edt(~dense, sampling=self.pitch[::-1])
        # The border is asked of the first look, too, which may be a quarter of a slice off.
        inside = 0.5 * diameter_mm + 1.25 * self.gap
        length = self.gap * len(self.items) - 2.0 * inside
        taken: list[np.ndarray] = []
        while len(taken) < count:
            j, i = (generator.integers(0, n) for n in dense.shape)
            if clear[j, i] < 0.5 * diameter_mm + CLEAR_MM:
                continue
            rise = inside - 0.5 * self.gap + length * generator.random()
            step = self.origins[-1] - self.origins[0]
            at = self.origins[0] + step * rise / (step @ self.frame[2])
            at = (
                at
                + (np.array([i, j]) + generator.uniform(-0.5, 0.5, 2))
                * self.pitch
                @ (self.frame[:2])
            )
            if all(np.linalg.norm(at - other) > diameter_mm + CLEAR_MM for other in taken):
                taken.append(at)
        yield from taken

    def paint(self, center_mm: np.ndarray, radius_mm: float) -> None:
        """Add a ball to every slice that sees it, each by its own origin."""
        plane, _ = np.polynomial.legendre.leggauss(2)
        deep, weights = np.polynomial.legendre.leggauss(14)
        reach = radius_mm + 5.0 * SIGMA_MM + 1.0
        for origin, image in zip(self.origins, self.hu, strict=True):
            x, y, rise = self.frame @ (center_mm - origin)
            if abs(rise) > reach + 0.5 * self.thickness:
                continue
            i, j = (
                np.arange(int((at - reach) / step), int((at + reach) / step) + 2)
                for at, step in zip((x, y), self.pitch, strict=True)
            )
            away_i, away_j = i * self.pitch[0] - x, j * self.pitch[1] - y
            for a, b, c in np.ndindex(2, 2, len(deep)):
                square = (
                    (away_i + 0.5 * plane[a] * self.pitch[0])[None, :] ** 2
                    + (away_j + 0.5 * plane[b] * self.pitch[1])[:, None] ** 2
                    + (rise - 0.5 * deep[c] * self.thickness) ** 2
                )
                ball = blurred_ball(np.sqrt(square), radius_mm=radius_mm, sigma_mm=SIGMA_MM)
                image[j[0] : j[-1] + 1, i[0] : i[-1] + 1] += (
                    weights[c] / 8.0 * (BALL_HU - AIR_HU) * ball
                )

    def save(self, folder):
        """The slices under their own headers; only the pixels are new."""
        for number, (item, image) in enumerate(zip(self.items, self.hu, strict=True)):
            stored = np.clip(np.rint(image - INTERCEPT), 0, 4095).astype("<u2")
            item.PixelData = stored.tobytes()
            item.save_as(folder / f"{number}.dcm")
        return folder


def errors_mm(found, centers) -> np.ndarray:
    """Distance of each place from the nearest ball found, shape (n,)."""
    return np.linalg.norm(found.centers_mm[None] - np.array(centers)[:, None], axis=-1).min(axis=1)


# What a spacing carries: at 2.4 mm a usual marker of 10 mm (four slices); at 5 mm a ball of 20 mm.
@pytest.mark.parametrize(
    ("name", "diameter", "tilt"),
    [
        ("Philips_tilt_m18.5", 10.0, -18.5),
        ("Philips_tilt_p16.5", 10.0, 16.5),
        ("Philips_plain5mm", 20.0, None),
    ],
)
def test_balls_painted_into_real_slices_come_back_where_they_were_put(
    name, diameter, tilt, ct_corpus, tmp_path
):
    slices = Slices(ct_corpus / "dcm_qa_ct" / name)
    centers = list(slices.places(diameter, 8, seed=5))
    for center in centers:
        slices.paint(center, 0.5 * diameter)
    volume = read_volume(slices.save(tmp_path))
    acquisition = volume.source.acquisition
    assert (acquisition and round(acquisition.tilt_deg, 2)) == tilt
    found = find_balls(volume, ball_diameter_mm=diameter)
    assert len(found.balls) == len(centers)
    assert errors_mm(found, centers).max() < LIMIT_MM


@pytest.mark.parametrize(
    ("name", "diameter"), [("Philips_tilt_m18.5", 8.0), ("Philips_plain5mm", 16.0)]
)
def test_a_ball_that_the_spacing_hardly_carries_is_exact_or_rejected(
    name, diameter, ct_corpus, tmp_path
):
    slices = Slices(ct_corpus / "dcm_qa_ct" / name)
    centers = list(slices.places(diameter, 8, seed=6))
    for center in centers:
        slices.paint(center, 0.5 * diameter)
    found = find_balls(read_volume(slices.save(tmp_path)), ball_diameter_mm=diameter)
    apart = errors_mm(found, centers)
    assert 1 <= len(found.balls) <= len(centers)
    assert np.sum(apart < LIMIT_MM) == len(found.balls)
    for center in np.array(centers)[apart >= LIMIT_MM]:
        near = [r for r in found.rejected if np.linalg.norm(r.center_mm - center) < 0.5 * diameter]
        assert near
        assert all(other.reason for other in near)


def test_a_ball_that_too_few_slices_cross_is_not_sought(ct_corpus):
    volume = read_volume(ct_corpus / "dcm_qa_ct/Philips_plain5mm")
    with pytest.raises(InputError) as caught:
        find_balls(volume, ball_diameter_mm=12.0)
    (fault,) = caught.value.faults
    assert (fault.code, fault.hazard) == ("ball-diameter", "H15")
    assert fault.limit.startswith("at least 12.50 mm")


def test_balls_painted_into_a_real_oblique_nifti_come_back(ct_corpus, tmp_path):
    image = sitk.ReadImage(str(ct_corpus / "niivue/CT_pitch.nii.gz"))
    values = sitk.GetArrayFromImage(image).astype(float)
    affine = np.reshape(image.GetDirection(), (3, 3)) * image.GetSpacing()
    clear = distance_transform_edt(values < 20, sampling=image.GetSpacing()[::-1])
    generator = np.random.default_rng(2)
    centers: list[np.ndarray] = []
    while len(centers) < 6:
        index = generator.uniform(9.0, np.array(image.GetSize()) - 9.0)
        k, j, i = np.rint(index[::-1]).astype(int)
        at = affine @ index + image.GetOrigin()
        if clear[k, j, i] > 9.0 and all(np.linalg.norm(at - other) > 18.0 for other in centers):
            centers.append(at)
            low, high = np.array([i - 9, j - 9, k - 5]), np.array([i + 10, j + 10, k + 6])
            box = np.stack(np.meshgrid(*map(np.arange, low, high), indexing="ij"), -1)
            share = np.zeros(box.shape[:3])
            deep, weights = np.polynomial.legendre.leggauss(9)
            for node, weight in zip(deep, weights, strict=True):
                away = (box - index + [0, 0, 0.5 * node]) @ affine.T
                distance = np.linalg.norm(away, axis=-1)
                share += 0.5 * weight * blurred_ball(distance, radius_mm=5.0, sigma_mm=0.7)
            part = values[low[2] : high[2], low[1] : high[1], low[0] : high[0]]
            part += (250.0 - part) * share.transpose(2, 1, 0)
    painted = sitk.GetImageFromArray(np.clip(np.rint(values), 0, 255).astype(np.uint8))
    painted.CopyInformation(image)
    sitk.WriteImage(painted, str(tmp_path / "balls.nii.gz"))
    found = find_balls(read_volume(tmp_path / "balls.nii.gz"), ball_diameter_mm=10.0)
    assert len(found.balls) == len(centers)
    assert errors_mm(found, centers).max() < LIMIT_MM
