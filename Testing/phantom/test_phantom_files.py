"""The files: a DICOM series that three readers agree on, NRRD, truth and case."""

import dataclasses
import json
from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK
from hexafix.errors import InputError
from hexafix.imaging import read_volume
from hexafix.phantom import PhantomSpec, make_phantom, write_phantom
from hexafix.phantom.dicom_series import decimal_string


@pytest.fixture(scope="module")
def a_small_phantom():
    spec = PhantomSpec(
        seed=3,
        size_ijk=(40, 52, 12),
        spacing_mm=(0.7, 0.85, 1.1),
        slice_thickness_mm=1.5,
        image_angles_rad=(0.31, -0.23, 0.12),
        partial_frame=True,
        side="right",
    )
    return make_phantom(spec)


@pytest.fixture(scope="module")
def a_series(a_small_phantom, tmp_path_factory) -> Path:
    out = tmp_path_factory.mktemp("phantom") / "one"
    write_phantom(a_small_phantom, out)
    return out


def test_pydicom_sees_every_slice_at_its_true_place(a_series, a_small_phantom) -> None:
    volume = a_small_phantom.volume
    files = sorted((a_series / "ct").iterdir())
    slices = [pydicom.dcmread(path) for path in files]
    assert len(slices) == 12
    order = [int(s.InstanceNumber) for s in slices]
    assert order != sorted(order)
    assert len({s.SOPInstanceUID for s in slices}) == 12
    for s in slices:
        k = int(s.InstanceNumber) - 1
        row, column = np.array(s.ImageOrientationPatient, float).reshape(2, 3)
        spacing = np.array(s.PixelSpacing, float)
        position = np.array(s.ImagePositionPatient, float)
        for i, j in ((0, 0), (39, 51), (7, 30)):
            point = position + i * spacing[1] * row + j * spacing[0] * column
            np.testing.assert_allclose(point, volume.lps_from_ijk([i, j, k]), atol=1e-8)
        hu = s.pixel_array.astype(int) * int(s.RescaleSlope) + int(s.RescaleIntercept)
        np.testing.assert_array_equal(hu, volume.voxels[k])
        assert s.SOPClassUID == pydicom.uid.CTImageStorage
        assert (s.Laterality, s.Modality, float(s.SliceThickness)) == ("R", "CT", 1.5)


def test_simpleitk_reads_the_same_geometry_and_hu(a_series, a_small_phantom) -> None:
    volume = a_small_phantom.volume
    names = SimpleITK.ImageSeriesReader.GetGDCMSeriesFileNames(str(a_series / "ct"))
    image = SimpleITK.ReadImage(names)
    np.testing.assert_array_equal(SimpleITK.GetArrayFromImage(image), volume.voxels)
    for ijk in ((0, 0, 0), (39, 0, 11), (5, 51, 6)):
        point = image.TransformIndexToPhysicalPoint(ijk)
        np.testing.assert_allclose(point, volume.lps_from_ijk(ijk), atol=1e-6)


@pytest.mark.parametrize("image_format", ["dicom", "nrrd", "metaimage"])
def test_hexafix_reads_back_what_was_made(a_small_phantom, tmp_path, image_format) -> None:
    case_file = write_phantom(a_small_phantom, tmp_path / "out", image_format=image_format)
    case = json.loads(case_file.read_text(encoding="utf-8"))
    read = read_volume(case_file.parent / case["image"]["path"])
    np.testing.assert_array_equal(read.voxels, a_small_phantom.volume.voxels)
    np.testing.assert_allclose(read.ijk_to_lps, a_small_phantom.volume.ijk_to_lps, atol=1e-8)
    assert read.source.sha256 == a_small_phantom.volume.source.sha256


def test_truth_and_case_stand_beside_the_image(a_series, a_small_phantom) -> None:
    assert json.loads((a_series / "truth.json").read_text("utf-8")) == a_small_phantom.truth
    assert json.loads((a_series / "case.json").read_text("utf-8")) == a_small_phantom.case


def test_the_same_spec_gives_the_same_bytes(a_series, a_small_phantom, tmp_path) -> None:
    again = make_phantom(a_small_phantom.spec, workers=1)
    write_phantom(again, tmp_path / "again")
    for path in sorted(a_series.rglob("*")):
        if path.is_file():
            twin = tmp_path / "again" / path.relative_to(a_series)
            assert twin.read_bytes() == path.read_bytes(), path.name


def test_another_seed_gives_another_series(a_small_phantom, a_series, tmp_path) -> None:
    other = make_phantom(dataclasses.replace(a_small_phantom.spec, seed=4))
    write_phantom(other, tmp_path / "other")
    uids = [
        {pydicom.dcmread(path).SeriesInstanceUID for path in (folder / "ct").iterdir()}
        for folder in (a_series, tmp_path / "other")
    ]
    assert len(uids[0]) == len(uids[1]) == 1
    assert uids[0] != uids[1]


@pytest.mark.parametrize(
    "value", [0.7, -0.0123456789012345, 1 / 3, -1234.56789012345678, 1e-7, 0.0, -0.99999999999995]
)
def test_decimal_strings_fit_and_keep_the_number(value: float) -> None:
    text = decimal_string(value)
    assert len(text) <= 16
    assert float(text) == pytest.approx(value, abs=1e-9, rel=1e-9)


def test_a_folder_in_use_is_left_alone(a_small_phantom, tmp_path) -> None:
    (tmp_path / "note.txt").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match="new or an empty folder"):
        write_phantom(a_small_phantom, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["note.txt"]
    with pytest.raises(InputError, match="unknown image format"):
        write_phantom(a_small_phantom, tmp_path / "new", image_format="jpeg")
