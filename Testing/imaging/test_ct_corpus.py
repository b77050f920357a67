"""Real files: what must be read is read like SimpleITK where that is right, the rest is refused."""

from __future__ import annotations

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import HexaFixError, ImageRefused
from hexafix.imaging import read_volume
from hexafix.imaging.dicom_header import read_headers
from hexafix.imaging.pixel_data import read_slices
from hexafix.imaging.slice_stack import arrange
from scipy.ndimage import map_coordinates

pytestmark = pytest.mark.usefixtures("itk_in_process")


@pytest.mark.parametrize(
    "name",
    [
        "dcm_qa_ct/Philips_plain5mm",
        "dcmqi_ct3",
        "pydicom/dicomdirtests_98892001_CT5N",
        "dicom2nifti_failing/non_isotropic_oblique",
    ],
)
def test_a_real_series_is_read_as_simpleitk_reads_it(name, ct_corpus):
    volume = read_volume(ct_corpus / name)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(ct_corpus / name)))
    image = reader.Execute()
    # A padding value below air is air here and stays in SimpleITK.
    expected = np.maximum(sitk.GetArrayFromImage(image), -1024)
    np.testing.assert_allclose(np.maximum(volume.voxels, -1024), expected, rtol=1e-6)
    for corner in np.ndindex(2, 2, 2):
        index = [int(c * (n - 1)) for c, n in zip(corner, volume.size_ijk, strict=True)]
        np.testing.assert_allclose(
            volume.lps_from_ijk(index), image.TransformIndexToPhysicalPoint(index), atol=1e-3
        )


def test_a_left_handed_enhanced_ct_keeps_its_places(ct_corpus):
    path = ct_corpus / "pydicom-data/eCT_Supplemental.dcm"
    volume, image = read_volume(path), sitk.ReadImage(str(path))
    values = sitk.GetArrayFromImage(image)
    for index in [(0, 0, 0), (511, 0, 0), (0, 511, 0), (100, 200, 1), (511, 511, 1)]:
        here = np.rint(volume.ijk_from_lps(image.TransformIndexToPhysicalPoint(index))).astype(int)
        assert volume.voxels[tuple(here[::-1])] == values[tuple(index[::-1])]


def test_lossless_transfer_syntaxes_give_one_image(ct_corpus):
    folder = ct_corpus / "cornerstone_transfer_syntaxes"
    tails = ["1.2.2", "1.2.1.99", "4.90", "4.80", "4.57", "4.70", "1.2.5"]
    paths = [folder / "CTImage.dcm", *(next(folder.glob(f"*{tail}.dcm")) for tail in tails)]
    headers = [header for path in paths for header in read_headers(path)]
    images = np.empty((len(paths), 512, 512), np.float32)
    assert len(list(read_slices(headers, images))) == len(paths)
    for tail, image in zip(tails, images[1:], strict=True):
        np.testing.assert_array_equal(image, images[0], err_msg=tail)


@pytest.mark.parametrize("name", ["3mm", "4mm", "5mm", "10mm", "20mm"])
def test_sagittal_nrrd_spheres_are_read_as_simpleitk_reads_them(name, ct_corpus):
    path = ct_corpus / f"spheres_nrrd/{name}FiducialTest.nrrd"
    volume, image = read_volume(path), sitk.ReadImage(str(path))
    np.testing.assert_array_equal(volume.voxels, sitk.GetArrayFromImage(image))
    np.testing.assert_allclose(
        volume.lps_from_ijk([10, 20, 30]), image.TransformIndexToPhysicalPoint([10, 20, 30])
    )


def test_an_oblique_nifti_is_read(ct_corpus):
    path = ct_corpus / "niivue/CT_pitch.nii.gz"
    volume, image = read_volume(path), sitk.ReadImage(str(path))
    index = (174, 247, 57)
    np.testing.assert_allclose(
        volume.lps_from_ijk(index), image.TransformIndexToPhysicalPoint(index), atol=1e-3
    )
    normal = volume.direction[:, 2]
    assert np.degrees(np.arccos(abs(normal[2]))) == pytest.approx(16.5, abs=0.1)


@pytest.mark.parametrize(
    ("name", "tilt"),
    [
        ("dcm_qa_ct/Philips_tilt_m18.5", -18.5),
        ("dcm_qa_ct/GE_tilt_varspacing", -18.5),
        ("dcm_qa_ct/Philips_tilt_p16.5", 16.5),
        ("dicom2nifti_failing/gantrytilting/001", -14.0),
        ("dicom2nifti_failing/sliceincrement/002", -15.5),
    ],
)
def test_the_tilt_is_found_from_positions_whatever_the_tag_says(name, tilt, ct_corpus):
    slices = [h for file in sorted((ct_corpus / name).iterdir()) for h in read_headers(file)]
    stack, _ = arrange(slices)
    assert stack is not None
    assert stack.tilt_deg == pytest.approx(tilt, abs=0.01)


@pytest.mark.parametrize(
    "name",
    [
        "dcm_qa_ct/Philips_tilt_m18.5",
        "dcm_qa_ct/Philips_tilt_p16.5",
        "dicom2nifti_failing/gantrytilting/001",
    ],
)
def test_a_real_tilted_voxel_has_the_value_of_its_own_slice_at_its_place(name, ct_corpus):
    volume = read_volume(ct_corpus / name)
    for path in (ct_corpus / name).iterdir():
        item = pydicom.dcmread(path)
        hu = item.pixel_array * float(item.RescaleSlope) + float(item.RescaleIntercept)
        row, column = np.reshape(np.array(item.ImageOrientationPatient, float), (2, 3))
        between_rows, between_columns = (float(value) for value in item.PixelSpacing)
        origin = np.array(item.ImagePositionPatient, float)
        k = round(float(volume.ijk_from_lps(origin)[2]))
        i, j, _ = volume.size_ijk
        index = np.stack(np.meshgrid(np.arange(i), np.arange(j)), -1).reshape(-1, 2)
        away = volume.lps_from_ijk(np.c_[index, np.full(len(index), k)]) - origin
        assert np.abs(away @ np.cross(row, column)).max() < 1e-3
        at = np.stack([away @ column / between_rows, away @ row / between_columns])
        got = volume.voxels[k].reshape(-1)
        beyond = np.maximum(-at, at - (np.array([[item.Rows], [item.Columns]]) - 1)).max(axis=0)
        assert np.all(got[beyond > 1e-3] == -1024)
        # Near the rim the two splines go on differently.
        deep = at[:, beyond < -15.0]
        around = np.stack([hu[tuple(edge(deep).astype(int))] for edge in (np.floor, np.ceil)])
        spline = map_coordinates(hu, deep, order=3, mode="mirror")
        expected = np.clip(spline, around.min(axis=0), around.max(axis=0))
        np.testing.assert_allclose(got[beyond < -15.0], expected, atol=0.55)


def test_no_corpus_file_ends_in_anything_but_a_volume_or_a_refusal(ct_corpus):
    outcomes, leaks = set(), 0
    for path in sorted(p for p in ct_corpus.rglob("*") if p.is_file()):
        if path.parent.name == "GE_tilt_varspacing":
            continue
        try:
            read_volume(path)
            outcomes.add("read")
        except HexaFixError as error:
            outcomes.add(type(error).__name__)
            leaks += str(ct_corpus) in str(error)
    assert leaks == 0
    assert outcomes == {"read", "ImageRefused", "InputError"}


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_mirrored_copy_of_a_real_series_is_never_read_as_the_same_image(
    axis, ct_corpus, tmp_path
):
    image = sitk.ReadImage(str(ct_corpus / "spheres_nrrd/10mmFiducialTest.nrrd"))
    flipped = [axis == 0, axis == 1, axis == 2]
    mirror = sitk.GetImageFromArray(np.flip(sitk.GetArrayFromImage(image), 2 - axis))
    mirror.CopyInformation(image)
    same = sitk.Flip(image, flipped)
    hashes = []
    for name, item in (("mirror", mirror), ("same", same)):
        sitk.WriteImage(item, str(tmp_path / f"{name}.nrrd"))
        volume = read_volume(tmp_path / f"{name}.nrrd")
        hashes.append(volume.source.sha256)
        expected = -1.0 if name == "same" else 1.0
        assert np.linalg.det(volume.direction) == pytest.approx(expected)
    assert hashes[0] != hashes[1]


def test_dropped_geometry_is_never_replaced(ct_corpus):
    with pytest.raises(ImageRefused) as caught:
        read_volume(ct_corpus / "fo-dicom/GH355.dcm")
    assert [fault.hazard for fault in caught.value.faults] == ["H07"]
