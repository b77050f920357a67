"""NRRD, NIfTI and MetaImage: same places as DICOM, and no geometry that is not certain."""

from __future__ import annotations

import gzip

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import ImageRefused, InputError
from hexafix.imaging import itk_file, read_volume
from hexafix.imaging.itk_reader import load_with_itk
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

pytestmark = pytest.mark.usefixtures("itk_in_process")

SUFFIXES = ["nrrd", "nhdr", "nii", "nii.gz", "mha", "mhd"]
TILT = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()


def codes(path, error=ImageRefused):
    with pytest.raises(error) as caught:
        read_volume(path)
    return {fault.code: fault.hazard for fault in caught.value.faults}


@pytest.fixture
def oblique(writer):
    return writer.grid(row=tuple(TILT[:, 0]), column=tuple(TILT[:, 1]))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_every_format_keeps_value_and_place(suffix, tmp_path, oblique, assert_coded, coded_image):
    path = tmp_path / f"image.{suffix}"
    sitk.WriteImage(coded_image(oblique), str(path), useCompression=suffix == "nrrd")
    volume = read_volume(path)
    # NIfTI rounds its numbers to single precision: 400 mm to 3e-5 mm.
    np.testing.assert_allclose(
        volume.lps_from_ijk([6, 5, 4]),
        oblique.place(6, 5, 4),
        atol=1e-4 if "nii" in suffix else 1e-9,
    )
    np.testing.assert_array_equal(volume.voxels, sitk.GetArrayFromImage(coded_image(oblique)))
    assert volume.voxels.dtype == np.int16
    assert volume.source.kind == {"n": "nifti", "m": "metaimage"}.get(
        suffix[0] if suffix[:2] != "nr" and suffix != "nhdr" else "", "nrrd"
    )


@pytest.mark.parametrize("suffix", ["nrrd", "nii", "mha"])
def test_a_left_handed_file_keeps_its_sign(suffix, tmp_path, writer, coded_image):
    grid = writer.grid()
    direction = np.diag([1.0, 1.0, -1.0])
    path = tmp_path / f"image.{suffix}"
    sitk.WriteImage(coded_image(grid, direction), str(path))
    volume = read_volume(path)
    assert np.linalg.det(volume.direction) == pytest.approx(-1.0)
    expected = np.array(grid.origin) - [0, 0, 4 * 1.25]
    np.testing.assert_allclose(volume.lps_from_ijk([0, 0, 4]), expected, atol=1e-4)
    assert volume.voxels[4, 0, 0] == 4000 - 1024


@settings(
    max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    turn=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
    mirrored=st.booleans(),
    spacing=st.tuples(*[st.floats(0.2, 3.0)] * 3),
    origin=st.tuples(*[st.floats(-900, 900)] * 3),
    suffix=st.sampled_from(["nrrd", "nii", "mha"]),
)
def test_any_grid_survives_any_format(turn, mirrored, spacing, origin, suffix, tmp_path_factory):
    frame = Rotation.from_quat(turn).as_matrix() * [1, -1 if mirrored else 1, 1]
    image = sitk.Image([3, 4, 5], sitk.sitkInt16)
    image.SetDirection(frame.ravel())
    image.SetSpacing(spacing)
    image.SetOrigin(origin)
    path = tmp_path_factory.mktemp("file") / f"image.{suffix}"
    sitk.WriteImage(image, str(path))
    volume = read_volume(path)
    for index in [(0, 0, 0), (2, 0, 4), (2, 3, 4)]:
        np.testing.assert_allclose(
            volume.lps_from_ijk(index), image.TransformIndexToPhysicalPoint(index), atol=5e-4
        )


def test_the_hash_is_that_of_the_image_however_it_was_stored(tmp_path, writer, grid, coded_image):
    dicom = read_volume(writer.save(tmp_path / "dicom", writer.slices(grid))).source.sha256
    for suffix in SUFFIXES:
        path = tmp_path / f"image.{suffix}"
        sitk.WriteImage(coded_image(grid), str(path))
        assert read_volume(path).source.sha256 == dicom, suffix
    sitk.WriteImage(coded_image(grid, dtype=np.float32), str(tmp_path / "float.nrrd"))
    assert read_volume(tmp_path / "float.nrrd").source.sha256 == dicom


def test_the_hash_differs_for_one_voxel_and_for_one_hundredth_of_a_millimetre(
    tmp_path, grid, coded_image
):
    image = coded_image(grid)
    hashes = set()
    for name in ("same", "voxel", "place", "spacing"):
        if name == "voxel":
            image[3, 3, 3] = 0
        if name == "place":
            image.SetOrigin((-30.0, 12.5, 400.01))
        if name == "spacing":
            image.SetSpacing((0.45, 0.7, 1.26))
        sitk.WriteImage(image, str(tmp_path / "image.nrrd"))
        hashes.add(read_volume(tmp_path / "image.nrrd").source.sha256)
    assert len(hashes) == 4


def nrrd(path, *, drop=(), **changes):
    """A hand-written NRRD: 3 x 4 x 5 shorts in LPS."""
    fields = {
        "type": "short",
        "dimension": "3",
        "space": "left-posterior-superior",
        "sizes": "3 4 5",
        "space directions": "(0.5,0,0) (0,0.6,0) (0,0,0.7)",
        "endian": "little",
        "encoding": "raw",
        "space origin": "(1,2,3)",
    }
    fields.update({key.replace("_", " "): value for key, value in changes.items()})
    lines = [f"{key}: {value}" for key, value in fields.items() if key not in drop]
    data = np.arange(60, dtype="<i2").tobytes()
    path.write_bytes(("NRRD0005\n" + "\n".join(lines) + "\n\n").encode() + data)
    return path


@pytest.mark.parametrize(
    ("space", "sign"),
    [
        ("left-posterior-superior", (1, 1, 1)),
        ("right-anterior-superior", (-1, -1, 1)),
        ("RAS", (-1, -1, 1)),
        ("left-anterior-superior", (1, -1, 1)),
    ],
)
def test_nrrd_spaces_are_turned_into_lps(space, sign, tmp_path):
    volume = read_volume(nrrd(tmp_path / "a.nrrd", space=space))
    np.testing.assert_allclose(
        volume.lps_from_ijk([1, 1, 1]), np.array([1.5, 2.6, 3.7]) * sign, atol=1e-12
    )
    assert np.sign(np.linalg.det(volume.direction)) == np.prod(sign)


def test_nrrd_in_centimetres_is_turned_into_millimetres(tmp_path):
    volume = read_volume(nrrd(tmp_path / "a.nrrd", space_units='"cm" "cm" "cm"'))
    np.testing.assert_allclose(volume.lps_from_ijk([1, 1, 1]), [15, 26, 37])


@pytest.mark.parametrize(
    ("fault", "changes", "expected"),
    [
        ("no space", {"drop": ["space"]}, {"no-geometry": "H07"}),
        ("scanner", {"space": "scanner-xyz"}, {"no-geometry": "H07"}),
        ("no directions", {"drop": ["space directions"]}, {"no-geometry": "H07"}),
        ("no origin", {"drop": ["space origin"]}, {"no-geometry": "H07"}),
        ("unknown unit", {"space_units": '"in" "in" "in"'}, {"no-geometry": "H08"}),
        ("shear", {"space_directions": "(0.5,0,0) (0.001,0.6,0) (0,0,0.7)"}, {"sheared": "H08"}),
        ("zero", {"space_directions": "(0.5,0,0) (0,0,0) (0,0,0.7)"}, {"no-geometry": "H07"}),
        ("nan", {"space_origin": "(nan,0,0)"}, {"no-geometry": "H07"}),
        ("foreign data", {"data_file": "../secret.raw"}, {"detached-data": "H50"}),
        ("absolute data", {"data_file": "/etc/passwd"}, {"detached-data": "H50"}),
        ("one slice", {"sizes": "3 20 1"}, {"too-few-slices": "H03"}),
    ],
)
def test_nrrd_that_is_not_certain_is_refused(fault, changes, expected, tmp_path):
    (tmp_path / "secret.raw").write_bytes(b"\0" * 120)
    folder = tmp_path / "folder"
    folder.mkdir()
    assert codes(nrrd(folder / "a.nrrd", **changes)) == expected


def test_nrrd_with_a_list_of_foreign_files_is_refused(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    path = nrrd(folder / "a.nhdr", data_file="LIST 2\n../a.raw\n../b.raw")
    assert codes(path) == {"detached-data": "H50"}


def test_a_link_inside_the_folder_does_not_lead_out_of_it(tmp_path):
    folder = tmp_path / "folder"
    folder.mkdir()
    (tmp_path / "secret.raw").write_bytes(b"\0" * 120)
    (folder / "data.raw").symlink_to(tmp_path / "secret.raw")
    assert codes(nrrd(folder / "a.nhdr", data_file="data.raw")) == {"detached-data": "H50"}


@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("suffix", ["nrrd", "nii", "mha", "nii.gz"])
def test_truncated_files_are_refused(suffix, packed, tmp_path, grid, coded_image):
    path = tmp_path / f"image.{suffix}"
    sitk.WriteImage(coded_image(grid), str(path), useCompression=packed)
    path.write_bytes(path.read_bytes()[:-20])
    own = suffix == "nii.gz" or (suffix == "mha" and packed)
    expected = {"corrupt-pixel-data", "truncated-pixel-data", "bad-nifti", "bad-metaimage"}
    assert set(codes(path, InputError if own else ImageRefused)) <= expected


@pytest.mark.parametrize("suffix", ["nrrd", "mha", "nii.gz"])
def test_one_changed_byte_in_packed_voxels_is_noticed(suffix, tmp_path):
    noise = np.random.default_rng(3).integers(-1000, 1000, (9, 20, 20)).astype(np.int16)
    path = tmp_path / f"image.{suffix}"
    sitk.WriteImage(sitk.GetImageFromArray(noise), str(path), useCompression=True)
    data = bytearray(path.read_bytes())
    data[-1000] ^= 0x40
    path.write_bytes(data)
    error = ImageRefused if suffix == "nrrd" else InputError
    assert set(codes(path, error)) <= {"corrupt-pixel-data", "bad-nifti", "bad-metaimage"}


def test_header_rubbish_is_an_input_error(tmp_path):
    for name, code in (("a.nrrd", "nrrd"), ("a.nii", "nifti"), ("a.mha", "metaimage")):
        (tmp_path / name).write_bytes(b"rubbish" * 100)
        assert codes(tmp_path / name, InputError) == {f"bad-{code}": None}
    (tmp_path / "a.nii.gz").write_bytes(gzip.compress(b"x" * 999)[:20])
    assert codes(tmp_path / "a.nii.gz", InputError) == {"bad-nifti": None}


def metaimage(path, *, drop=(), **changes):
    fields = {
        "ObjectType": "Image",
        "NDims": "3",
        "BinaryData": "True",
        "BinaryDataByteOrderMSB": "False",
        "TransformMatrix": "1 0 0 0 1 0 0 0 1",
        "Offset": "1 2 3",
        "ElementSpacing": "0.5 0.6 0.7",
        "DimSize": "3 4 5",
        "ElementType": "MET_SHORT",
    }
    fields.update(changes)
    fields["ElementDataFile"] = fields.pop("ElementDataFile", "LOCAL")
    lines = [f"{key} = {value}\n" for key, value in fields.items() if key not in drop]
    path.write_bytes("".join(lines).encode() + np.arange(60, dtype="<i2").tobytes())
    return path


def test_metaimage_directions_belong_to_the_index_axes(tmp_path):
    volume = read_volume(metaimage(tmp_path / "a.mha", TransformMatrix="0 1 0 0 0 1 1 0 0"))
    np.testing.assert_allclose(volume.lps_from_ijk([1, 0, 0]), [1, 2.5, 3])


@pytest.mark.parametrize(
    ("fault", "changes", "expected"),
    [
        ("no offset", {"drop": ["Offset"]}, {"no-geometry": "H07"}),
        ("no matrix", {"drop": ["TransformMatrix"]}, {"no-geometry": "H07"}),
        ("no spacing", {"drop": ["ElementSpacing"]}, {"no-geometry": "H07"}),
        ("two origins", {"Position": "9 9 9"}, {"no-geometry": "H07"}),
        ("inches", {"DistanceUnits": "inch"}, {"no-geometry": "H08"}),
        ("shear", {"TransformMatrix": "1 0 0 0.01 1 0 0 0 1"}, {"sheared": "H08"}),
        ("foreign", {"ElementDataFile": "../../secret.raw"}, {"detached-data": "H50"}),
        ("list", {"ElementDataFile": "LIST"}, {"detached-data": "H50"}),
    ],
)
def test_metaimage_that_is_not_certain_is_refused(fault, changes, expected, tmp_path):
    assert codes(metaimage(tmp_path / "a.mha", **changes)) == expected


def test_a_warning_of_itk_is_heard(tmp_path, monkeypatch):
    path = nrrd(tmp_path / "a.nrrd")
    execute = sitk.ImageFileReader.Execute
    assert load_with_itk(path, "NrrdImageIO")[0]["warnings"] == 0

    def warn(self, *args):
        sitk.LoggerBase.GetGlobalITKLogger().DisplayWarningText("WARNING: geometry was changed")
        return execute(self, *args)

    monkeypatch.setattr(sitk.ImageFileReader, "Execute", warn)
    assert load_with_itk(path, "NrrdImageIO")[0]["warnings"] == 1


def test_a_reader_that_warns_is_refused(tmp_path, monkeypatch):
    load = itk_file.load_isolated

    def warned(*args):
        about, array = load(*args)
        return about | {"warnings": 1}, array

    monkeypatch.setattr(itk_file, "load_isolated", warned)
    assert codes(nrrd(tmp_path / "a.nrrd")) == {"reader-warning": "H53"}


def test_two_readers_that_disagree_are_refused(tmp_path, monkeypatch):
    load = itk_file.load_isolated

    def moved(*args):
        about, array = load(*args)
        about["affine"][2][2] *= -1
        return about, array

    monkeypatch.setattr(itk_file, "load_isolated", moved)
    assert codes(nrrd(tmp_path / "a.nrrd")) == {"readers-disagree": "H08"}


def test_float_values_stay_float_where_they_are_not_whole(tmp_path, grid, coded_image):
    image = sitk.Cast(coded_image(grid), sitk.sitkFloat64) + 0.5
    sitk.WriteImage(image, str(tmp_path / "a.nrrd"))
    volume = read_volume(tmp_path / "a.nrrd")
    assert volume.voxels.dtype == np.float32
    assert volume.voxels[0, 0, 0] == -1023.5


def test_values_that_are_no_numbers_are_refused(tmp_path, grid, coded_image):
    image = coded_image(grid, dtype=np.float32)
    image[2, 2, 2] = float("nan")
    sitk.WriteImage(image, str(tmp_path / "a.nrrd"))
    assert codes(tmp_path / "a.nrrd") == {"not-finite": "H55"}


def test_a_vector_image_is_an_input_error(tmp_path):
    image = sitk.Image([3, 4, 5], sitk.sitkVectorUInt8, 3)
    sitk.WriteImage(image, str(tmp_path / "a.mha"))
    assert codes(tmp_path / "a.mha", InputError) == {"not-a-volume": None}


def test_a_series_cannot_be_chosen_in_a_file_without_series(tmp_path):
    with pytest.raises(InputError):
        read_volume(nrrd(tmp_path / "a.nrrd"), series_instance_uid="1.2.3")


def test_the_path_does_not_stand_in_any_message(tmp_path, secret):
    folder = tmp_path / secret
    folder.mkdir()
    path = nrrd(folder / f"{secret}.nrrd", space="scanner-xyz", data_file="../x.raw")
    with pytest.raises(ImageRefused) as caught:
        read_volume(path)
    assert secret not in str(caught.value)
