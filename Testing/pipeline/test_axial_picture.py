"""The slice that is shown while the workstation starts, against SimpleITK's own resampling."""

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.imaging import ImageSource, Volume
from hexafix.pipeline.axial_picture import axial_picture
from hexafix.pipeline.look import image_document
from scipy.spatial.transform import Rotation

SIZE_PX = 96


@pytest.fixture(scope="module")
def an_oblique_volume():
    """Smooth blobs of all sizes on an askew, anisotropic grid off the origin."""
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(30, 44, 36))
    smooth = np.fft.ifftn(
        np.fft.fftn(noise)
        * np.exp(
            -40
            * sum(
                f**2 for f in np.meshgrid(*[np.fft.fftfreq(n) for n in noise.shape], indexing="ij")
            )
        )
    ).real
    voxels = (400 + 9000 * smooth).clip(-1000, 3000).astype(np.int16)
    affine = np.eye(4)
    turn = Rotation.from_rotvec([0.3, -0.4, 0.25]).as_matrix()
    affine[:3, :3] = turn @ np.diag([0.9, 0.8, 1.7])
    affine[:3, 3] = [-60.0, 210.0, -35.0]
    return Volume(voxels, affine, ImageSource(kind="memory", sha256="0" * 64))


def test_each_pixel_is_the_nearest_voxel_of_the_axial_plane_through_the_middle(an_oblique_volume):
    volume = an_oblique_volume
    picture = axial_picture(volume, size_px=SIZE_PX)
    image = sitk.GetImageFromArray(volume.voxels)
    axes = volume.ijk_to_lps[:3, :3]
    spacing = np.linalg.norm(axes, axis=0)
    image.SetSpacing(spacing.tolist())
    image.SetDirection((axes / spacing).ravel().tolist())
    image.SetOrigin(volume.ijk_to_lps[:3, 3].tolist())
    middle = image.TransformContinuousIndexToPhysicalPoint([(n - 1) / 2 for n in image.GetSize()])
    half_mm = (np.abs(axes[:2]) @ (np.array(image.GetSize()) / 2)).max()
    grid = sitk.Image(SIZE_PX, SIZE_PX, 1, sitk.sitkInt16)
    step = 2 * half_mm / (SIZE_PX - 1)
    grid.SetSpacing((step, step, 1.0))
    grid.SetOrigin((middle[0] - half_mm, middle[1] - half_mm, middle[2]))
    cut = sitk.GetArrayFromImage(
        sitk.Resample(image, grid, sitk.Transform(), sitk.sitkNearestNeighbor, -9999)
    )[0]
    window = image_document(volume)
    low = window["level_hu"] - window["window_hu"] / 2
    grey = np.rint(255 * np.clip((cut - low) / window["window_hu"], 0, 1))
    grey[cut == -9999] = 0
    assert picture.s_mm == pytest.approx(middle[2])
    assert len(np.unique(grey)) > 30
    # Where a pixel lies midway between two voxels either is right.
    assert np.mean(picture.grey != grey) < 0.01


def test_the_patients_left_front_is_at_the_upper_right():
    voxels = np.full((9, 40, 40), -1000, np.int16)
    # an axis that runs to the right, and one that runs to the front: no index order may be trusted
    voxels[:, 28:33, 6:10] = 2000
    affine = np.diag([-1.0, -1.0, 2.0, 1.0])
    affine[:3, 3] = [15.0, -40.0, 300.0]
    volume = Volume(voxels, affine, ImageSource(kind="memory", sha256="0" * 64))
    rows, columns = np.nonzero(axial_picture(volume, size_px=200).grey > 100)
    assert rows.mean() < 80
    assert columns.mean() > 120


def test_the_picture_cannot_be_written_to(an_oblique_volume):
    with pytest.raises(ValueError, match="read-only"):
        axial_picture(an_oblique_volume, size_px=8).grey[0, 0] = 1
