"""What a series must not be: every refusal with an input that deserves it."""

from __future__ import annotations

import numpy as np
import pytest
from hexafix.errors import Cancelled, ImageRefused, InputError, MissingLibrary
from hexafix.imaging import pixel_data, read_volume
from pydicom.dataset import Dataset
from pydicom.encaps import encapsulate
from pydicom.uid import JPEG2000Lossless, RLELossless


def faults_of(folder, error=ImageRefused, **choice):
    with pytest.raises(error) as caught:
        read_volume(folder, **choice)
    return {fault.code: fault for fault in caught.value.faults}


def only(faults, code, hazard):
    assert set(faults) == {code}
    assert faults[code].hazard == hazard
    assert faults[code].next_step
    return faults[code]


def test_a_lost_slice_is_refused_with_its_place(tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[2]
    fault = only(faults_of(writer.save(tmp_path, items)), "missing-slice", "H03")
    assert "2.500 mm at 401.250..403.750" in fault.value


def test_uneven_spacing_is_refused_just_above_the_tolerance(tmp_path, writer, grid):
    def folder(name, shift):
        items = writer.slices(grid)
        items[-1].ImagePositionPatient[2] = 405.0 + shift
        return writer.save(tmp_path / name, items)

    only(faults_of(folder("far", 0.012)), "uneven-spacing", "H03")
    assert read_volume(folder("near", 0.008)).size_ijk == (7, 6, 5)


def test_spacing_that_drifts_is_refused_though_each_gap_is_within_tolerance(tmp_path, writer):
    grid = writer.grid(size=(4, 3, 14))
    items = writer.slices(grid)
    for k, item in enumerate(items):
        item.ImagePositionPatient[2] = 400 + 1.25 * k + 0.008 * max(0, k - 7)
    fault = only(faults_of(writer.save(tmp_path, items)), "uneven-spacing", "H03")
    assert "drift" in fault.what


@pytest.mark.parametrize(("degrees", "refused"), [(34.9, False), (35.1, True), (-40.0, True)])
def test_a_lean_beyond_any_gantry_is_refused(degrees, refused, tmp_path, writer):
    angle = np.radians(degrees)
    grid = writer.grid(step=2.0, step_direction=(0.0, np.sin(angle), np.cos(angle)))
    folder = writer.save(tmp_path, writer.slices(grid))
    if not refused:
        assert read_volume(folder).source.acquisition is not None
        return
    fault = only(faults_of(folder), "gantry-tilt", "H02")
    assert fault.value == f"{degrees:+.2f} deg about the row direction"
    assert fault.limit == "35 deg"


def test_tilt_and_a_lost_slice_are_both_named(tmp_path, writer):
    grid = writer.grid(step_direction=(0.0, np.sin(0.3), np.cos(0.3)))
    items = writer.slices(grid)
    del items[1]
    assert set(faults_of(writer.save(tmp_path, items))) == {"missing-slice", "gantry-tilt"}


def test_a_slice_shifted_in_its_plane_is_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[2].ImagePositionPatient[0] = -30.02
    fault = only(faults_of(writer.save(tmp_path, items)), "shifted-slice", "H03")
    assert "0.020 mm at 402.500" in fault.value


def test_corners_off_the_grid_are_refused_though_each_header_is_within_tolerance(tmp_path, writer):
    grid = writer.grid(size=(512, 512, 3), between_rows=2.0, between_columns=2.0)
    items = writer.slices(grid)
    items[1].ImageOrientationPatient = [1, 0.000095, 0, -0.000095, 1, 0]
    assert set(faults_of(writer.save(tmp_path, items))) == {"slice-corner"}


def test_identical_doubles_are_dropped_and_reported(tmp_path, writer, grid, assert_coded):
    items = writer.slices(grid)
    folder = writer.save(tmp_path, items)
    writer.save(tmp_path / "copy", items[1:3])
    volume = read_volume(folder)
    assert_coded(volume, grid)
    assert any("2 identical copies" in text for text in volume.source.warnings)


def test_different_slices_at_one_position_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    other = writer.one(grid, 2, items[0].SeriesInstanceUID)
    writer.set_pixels(other, np.full((6, 7), 77, np.uint16))
    fault = only(faults_of(writer.save(tmp_path, [*items, other])), "duplicate-slice", "H04")
    assert "402.500" in fault.value


def test_doubles_shifted_in_their_plane_are_refused_though_their_pixels_agree(
    tmp_path, writer, grid
):
    items = writer.slices(grid)
    other = writer.one(grid, 2, items[0].SeriesInstanceUID)
    other.ImagePositionPatient[0] = -20.0
    only(faults_of(writer.save(tmp_path, [*items, other])), "duplicate-slice", "H04")


def test_one_instance_uid_at_two_positions_is_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[3].SOPInstanceUID = items[1].SOPInstanceUID
    only(faults_of(writer.save(tmp_path, items)), "duplicate-instance", "H04")


MIXTURES = {
    "mixed-orientation": ("ImageOrientationPatient", [1, 0.0002, 0, -0.0002, 1, 0], "H06"),
    "mixed-spacing": ("PixelSpacing", [0.70001, 0.45], "H06"),
    "mixed-frame-of-reference": ("FrameOfReferenceUID", "1.2.3.4", "H05"),
    "mixed-image-type": ("ImageType", ["DERIVED", "PRIMARY", "AXIAL"], "H05"),
}


@pytest.mark.parametrize("code", MIXTURES)
def test_a_mixture_within_one_series_is_refused(code, tmp_path, writer, grid):
    keyword, value, hazard = MIXTURES[code]
    items = writer.slices(grid)
    setattr(items[1], keyword, value)
    fault = only(faults_of(writer.save(tmp_path, items)), code, hazard)
    assert "1 of 5 slices" in fault.value
    assert "401.25" in fault.value


def test_slices_of_different_size_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    writer.set_pixels(items[4], np.zeros((6, 8), np.uint16))
    only(faults_of(writer.save(tmp_path, items)), "mixed-size", "H06")


@pytest.mark.parametrize(
    "keyword", ["ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing"]
)
def test_missing_geometry_is_refused_and_never_invented(keyword, tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[0][keyword]
    fault = only(faults_of(writer.save(tmp_path, items)), "no-geometry", "H07")
    assert fault.value == "1 of 5 slices"


@pytest.mark.parametrize("spacing", [[0.0, 0.7], [-0.7, 0.7]])
def test_pixel_spacing_that_is_not_positive_is_no_geometry(spacing, tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        item.PixelSpacing = spacing
    only(faults_of(writer.save(tmp_path, items)), "no-geometry", "H07")


def test_an_orientation_that_is_no_pair_of_perpendicular_directions_is_refused(
    tmp_path, writer, grid
):
    items = writer.slices(grid)
    for item in items:
        item.ImageOrientationPatient = [1, 0, 0, 0.01, 1, 0]
    assert "bad-orientation" in faults_of(writer.save(tmp_path, items))


def test_two_slices_are_too_few(tmp_path, writer):
    grid = writer.grid(size=(7, 6, 2))
    only(faults_of(writer.save(tmp_path, writer.slices(grid))), "too-few-slices", "H03")


def test_one_slice_of_a_series_is_too_few(tmp_path, writer, grid):
    folder = writer.save(tmp_path, writer.slices(grid))
    only(faults_of(folder / "0002.dcm"), "too-few-slices", "H03")


def test_a_multi_frame_without_functional_groups_has_no_geometry(tmp_path, writer, grid):
    item = writer.enhanced(grid)
    del item.PerFrameFunctionalGroupsSequence
    item.ImagePositionPatient, item.ImageOrientationPatient = [0, 0, 0], [1, 0, 0, 0, 1, 0]
    item.PixelSpacing = [1, 1]
    item.RescaleSlope, item.RescaleIntercept = 1, 0
    only(faults_of(writer.save(tmp_path, [item])), "no-geometry", "H07")


def test_a_multi_frame_with_a_lost_frame_is_refused(tmp_path, writer, grid):
    item = writer.enhanced(grid)
    groups = item.PerFrameFunctionalGroupsSequence
    groups[4].PlanePositionSequence[0].ImagePositionPatient[2] = 406.25
    assert set(faults_of(writer.save(tmp_path, [item]))) == {"missing-slice"}


def test_a_multi_frame_whose_groups_do_not_match_is_not_read(tmp_path, writer, grid):
    item = writer.enhanced(grid)
    del item.PerFrameFunctionalGroupsSequence[4]
    faults = faults_of(writer.save(tmp_path, [item]), InputError)
    assert "functional groups" in faults["no-dicom-image"].value


@pytest.mark.parametrize("cut", [2, 40])
def test_truncated_pixels_are_refused_before_decoding(cut, tmp_path, writer, grid):
    folder = writer.save(tmp_path, writer.slices(grid))
    file = folder / "0003.dcm"
    file.write_bytes(file.read_bytes()[:-cut])
    fault = only(faults_of(folder), "truncated-pixel-data", "H09")
    assert f"403.75): {84 - cut} of 84 bytes" in fault.value


@pytest.mark.parametrize("change", [-4, 4])
def test_pixels_of_another_length_than_rows_times_columns_are_refused(
    change, tmp_path, writer, grid
):
    items = writer.slices(grid)
    items[1].PixelData = (items[1].PixelData + b"\0" * 4)[: 84 + change]
    # What follows the pixels must not be taken for pixels.
    items[1].add_new(0xFFFCFFFC, "OB", b"\0" * 20)
    only(faults_of(writer.save(tmp_path, items)), "truncated-pixel-data", "H09")


def test_a_slice_without_pixels_is_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[1].PixelData
    only(faults_of(writer.save(tmp_path, items)), "no-pixel-data", "H09")


def test_a_modality_lut_is_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    table = Dataset()
    table.LUTDescriptor, table.ModalityLUTType = [1, 0, 16], "HU"
    table["LUTDescriptor"].VR = "US"
    table.add_new("LUTData", "OW", b"\0\0")
    items[2].ModalityLUTSequence = [table]
    only(faults_of(writer.save(tmp_path, items)), "modality-lut", "H10")


@pytest.mark.parametrize("keyword", ["RescaleSlope", "RescaleIntercept"])
def test_ct_without_rescale_is_refused(keyword, tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[3][keyword]
    only(faults_of(writer.save(tmp_path, items)), "no-rescale", "H10")


def test_a_slope_of_zero_is_no_rescale(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[0].RescaleSlope = "0"
    only(faults_of(writer.save(tmp_path, items)), "no-rescale", "H10")


def test_impossible_bit_depths_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[0].BitsStored = 17
    only(faults_of(writer.save(tmp_path, items)), "pixel-format", "H10")


def test_corrupt_compressed_pixels_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        # Two segments where they should be, but each unpacks to one byte only.
        header = np.array([2, 64, 66, *[0] * 13], "<u4").tobytes()
        item.PixelData = encapsulate([header + b"\0\1" * 2])
        item["PixelData"].is_undefined_length = True
    folder = writer.save(tmp_path, items, syntax=RLELossless)
    only(faults_of(folder), "corrupt-pixel-data", "H09")


def encapsulated(items):
    for item in items:
        item.PixelData = encapsulate([b"abcd"])
        item["PixelData"].is_undefined_length = True
    return items


def test_an_unknown_compression_is_refused(tmp_path, writer, grid):
    items = encapsulated(writer.slices(grid))
    folder = writer.save(tmp_path, items, syntax="1.2.840.10008.1.2.4.55")
    only(faults_of(folder), "transfer-syntax", "H09")


def test_a_missing_codec_names_the_extra_to_install(tmp_path, writer, grid, monkeypatch):
    from pydicom.pixels.decoders import JPEG2000LosslessDecoder

    monkeypatch.setattr(JPEG2000LosslessDecoder, "_available", {})
    folder = writer.save(tmp_path, encapsulated(writer.slices(grid)), syntax=JPEG2000Lossless)
    fault = faults_of(folder, MissingLibrary)["codec-missing"]
    assert "hexafix[codecs]" in fault.next_step


def test_a_volume_beyond_any_ct_is_not_allocated(tmp_path, writer, grid, monkeypatch):
    folder = writer.save(tmp_path, writer.slices(grid))
    monkeypatch.setattr(pixel_data, "MAX_VOXELS", 7 * 6 * 5 - 1)
    assert set(faults_of(folder, InputError)) == {"volume-too-large"}


def test_every_fault_is_named_at_once(tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[2]
    items[0].PixelSpacing = [0.8, 0.45]
    items[1].RescaleSlope = None
    items[3].PixelData = b"\0\0"
    codes = set(faults_of(writer.save(tmp_path, items)))
    assert codes == {"missing-slice", "mixed-spacing", "no-rescale", "truncated-pixel-data"}


def test_no_message_names_the_patient_or_a_file(tmp_path, writer, grid, secret):
    items = writer.slices(grid)
    del items[2]
    items[0].PixelSpacing = [0.8, 0.45]
    items[3].ImageOrientationPatient = [1, 0.1, 0, -0.1, 1, 0]
    items[3].PixelData = b"\0\0"
    folder = writer.save(tmp_path / secret, items, names=lambda k: f"{secret}{k}.dcm")
    with pytest.raises(ImageRefused) as caught:
        read_volume(folder)
    assert secret not in str(caught.value)
    assert all(secret not in str(fault.as_json()) for fault in caught.value.faults)


def test_work_stops_when_the_user_cancels(tmp_path, writer, grid):
    folder = writer.save(tmp_path, writer.slices(grid))
    seen = []

    def stop(step, fraction):
        seen.append(step)
        if step == "read CT slices":
            raise Cancelled.of("cancelled", "stopped")

    with pytest.raises(Cancelled):
        read_volume(folder, progress=stop)
    assert seen[0] == "read DICOM headers"


def test_files_that_are_no_dicom_are_skipped_and_counted(tmp_path, writer, grid, assert_coded):
    folder = writer.save(tmp_path, writer.slices(grid))
    (folder / "notes.txt").write_text("x" * 500)
    (folder / "empty").touch()
    broken = (folder / "0000.dcm").read_bytes()[:400]
    (folder / "broken.dcm").write_bytes(broken)
    volume = read_volume(folder)
    assert_coded(volume, grid)
    assert "skipped: 1 x not DICOM (no preamble)" in volume.source.warnings
    assert "skipped: 1 x empty file" in volume.source.warnings
    assert sum(text.startswith("skipped") for text in volume.source.warnings) == 3


def test_a_folder_without_images_is_an_input_error(tmp_path):
    (tmp_path / "notes.txt").write_text("x" * 500)
    fault = faults_of(tmp_path, InputError)["no-dicom-image"]
    assert "1 x not DICOM" in fault.value


def test_a_path_that_is_not_there_is_an_input_error(tmp_path):
    assert "image-not-found" in faults_of(tmp_path / "nowhere", InputError)


def test_a_deflated_bomb_is_not_inflated(tmp_path, writer, grid, syntaxes, monkeypatch):
    from hexafix.imaging import header_file

    folder = writer.save(tmp_path, writer.slices(grid), syntax=syntaxes["deflated"])
    monkeypatch.setattr(header_file, "_MAX_INFLATED", 100)
    fault = faults_of(folder, InputError)["no-dicom-image"]
    assert "5 x deflated DICOM that inflates" in fault.value
