"""From stored bits to Hounsfield units."""

from __future__ import annotations

import numpy as np
import pytest
from hexafix.imaging import read_volume
from pydicom.uid import RLELossless


def series_of(writer, grid, pixels, **changes):
    items = writer.slices(grid)
    for item in items:
        writer.set_pixels(item, pixels, bits_stored=changes.get("BitsStored"))
        for keyword, value in changes.items():
            setattr(item, keyword, value)
    return items


@pytest.mark.parametrize("name", ["implicit", "explicit", "big-endian", "deflated"])
def test_every_uncompressed_transfer_syntax_gives_the_same_volume(
    name, tmp_path, writer, grid, syntaxes, assert_coded
):
    plain = read_volume(writer.save(tmp_path / "plain", writer.slices(grid)))
    items = writer.slices(grid)
    if name == "big-endian":
        for item in items:
            item.PixelData = np.frombuffer(item.PixelData, "<u2").astype(">u2").tobytes()
    volume = read_volume(writer.save(tmp_path / name, items, syntax=syntaxes[name]))
    assert_coded(volume, grid)
    assert volume.voxels.dtype == np.int16
    assert volume.source.sha256 == plain.source.sha256


def test_run_length_compression_gives_the_same_volume(tmp_path, writer, grid, assert_coded):
    items = writer.slices(grid)
    plain = read_volume(writer.save(tmp_path / "plain", items))
    writer.save(tmp_path / "rle", items)
    for item in items:
        item.compress(RLELossless)
    volume = read_volume(writer.save(tmp_path / "rle", items, syntax=RLELossless))
    assert_coded(volume, grid)
    assert volume.source.sha256 == plain.source.sha256


@pytest.mark.parametrize("dtype", ["int8", "uint8", "int16", "uint16", "int32", "uint32"])
def test_every_pixel_type_keeps_its_sign_and_value(dtype, tmp_path, writer, grid):
    info = np.iinfo(dtype)
    low, high = max(info.min, -31000), min(info.max, 31000)
    pixels = np.linspace(low, high, 42).astype(dtype).reshape(6, 7)
    items = series_of(writer, grid, pixels, RescaleIntercept="0")
    volume = read_volume(writer.save(tmp_path, items))
    assert volume.voxels.dtype == np.int16
    np.testing.assert_array_equal(volume.voxels[2], pixels.astype(int))


def test_slope_and_intercept_are_those_of_each_slice(tmp_path, writer, grid):
    items = writer.slices(grid)
    stored = [np.frombuffer(item.PixelData, "<u2").reshape(6, 7).astype(int) for item in items]
    rescale = [(1, -1024), (2, 0), (-1, 5), (3, -7), (1, 0)]
    for item, (slope, intercept) in zip(items, rescale, strict=True):
        item.RescaleSlope, item.RescaleIntercept = str(slope), str(intercept)
    volume = read_volume(writer.save(tmp_path, items))
    assert volume.voxels.dtype == np.int16
    for k, (slope, intercept) in enumerate(rescale):
        np.testing.assert_array_equal(volume.voxels[k], slope * stored[k] + intercept)


def test_a_broken_slope_gives_float_without_loss(tmp_path, writer, grid):
    pixels = np.arange(42, dtype=np.uint16).reshape(6, 7)
    items = series_of(writer, grid, pixels, RescaleSlope="0.25", RescaleIntercept="-1000.5")
    volume = read_volume(writer.save(tmp_path, items))
    assert volume.voxels.dtype == np.float32
    np.testing.assert_array_equal(volume.voxels[0], 0.25 * pixels - 1000.5)


@pytest.mark.parametrize(("dtype", "extreme"), [("uint16", 65535), ("int16", -32768)])
def test_values_beyond_sixteen_bits_are_kept_not_wrapped(dtype, extreme, tmp_path, writer, grid):
    pixels = np.full((6, 7), 1000, dtype)
    pixels[2, 3] = extreme
    items = series_of(writer, grid, pixels)
    volume = read_volume(writer.save(tmp_path, items))
    assert volume.voxels.dtype == np.float32
    assert volume.voxels[1, 2, 3] == extreme - 1024
    assert volume.voxels[1, 0, 0] == -24


@pytest.mark.parametrize("dtype", ["uint16", "int16"])
def test_bits_above_the_stored_ones_are_ignored(dtype, tmp_path, writer, grid):
    clean = np.linspace(0, 2047, 42).astype(dtype).reshape(6, 7)
    if dtype == "int16":
        clean -= 1000
    dirty = (clean.view(np.uint16) & 0x0FFF) | np.uint16(0x5000)
    items = series_of(writer, grid, dirty.view(dtype), BitsStored=12, HighBit=11)
    volume = read_volume(writer.save(tmp_path, items))
    np.testing.assert_array_equal(volume.voxels[0], clean.astype(int) - 1024)


def test_a_high_bit_above_the_lowest_place_is_shifted_down(tmp_path, writer, grid):
    pixels = np.linspace(0, 4095, 42).astype(np.uint16).reshape(6, 7)
    items = series_of(writer, grid, pixels << 4, BitsStored=12)
    for item in items:
        item.HighBit = 15
    volume = read_volume(writer.save(tmp_path, items))
    np.testing.assert_array_equal(volume.voxels[0], pixels.astype(int) - 1024)


@pytest.mark.parametrize("padding", [-2000, 63536])
def test_padding_below_air_becomes_air(padding, tmp_path, writer, grid):
    pixels = np.full((6, 7), 100, np.int16)
    pixels[0, :3] = -2000
    items = series_of(writer, grid, pixels)
    for item in items:
        item.add_new("PixelPaddingValue", "SS" if padding < 0 else "US", padding)
    volume = read_volume(writer.save(tmp_path, items))
    assert volume.voxels.dtype == np.int16
    assert (volume.voxels[:, 0, :3] == -1024).all()
    assert (volume.voxels[:, 1:] == -924).all()


def test_a_range_of_padding_becomes_air_as_a_whole(tmp_path, writer, grid):
    pixels = np.full((6, 7), 100, np.int16)
    pixels[0, :3] = [-2000, -1950, -1900]
    items = series_of(writer, grid, pixels)
    for item in items:
        item.add_new("PixelPaddingValue", "SS", -2000)
        item.add_new("PixelPaddingRangeLimit", "SS", -1900)
    volume = read_volume(writer.save(tmp_path, items))
    assert (volume.voxels[:, 0, :3] == -1024).all()


def test_a_padding_value_that_tissue_can_have_changes_nothing(tmp_path, writer, grid):
    pixels = np.full((6, 7), 1024, np.uint16)
    items = series_of(writer, grid, pixels)
    for item in items:
        item.add_new("PixelPaddingValue", "US", 1024)
    volume = read_volume(writer.save(tmp_path, items))
    assert (volume.voxels == 0).all()


def test_values_below_air_that_are_no_padding_stay(tmp_path, writer, grid):
    items = series_of(writer, grid, np.full((6, 7), -2000, np.int16))
    assert (read_volume(writer.save(tmp_path, items)).voxels == -3024).all()


def warnings_of(tmp_path, writer, items):
    return read_volume(writer.save(tmp_path, items)).source.warnings


def test_an_ordinary_series_has_no_warnings(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[0].PixelData = b"\0" * 84
    assert warnings_of(tmp_path, writer, items) == ()


@pytest.mark.parametrize("by", ["flag", "syntax"])
def test_lossy_pixels_are_marked(by, tmp_path, writer, grid, monkeypatch):
    from hexafix.imaging import dicom_volume

    items = writer.slices(grid)
    if by == "flag":
        items[2].LossyImageCompression = "01"
    else:
        monkeypatch.setattr(dicom_volume, "LOSSY_SYNTAXES", {"1.2.840.10008.1.2.1"})
    assert any(text.startswith("lossy (H10)") for text in warnings_of(tmp_path, writer, items))


@pytest.mark.parametrize("by", ["spacing", "thickness"])
def test_slices_above_two_millimetres_are_warned_about(by, tmp_path, writer, grid):
    items = writer.slices(writer.grid(step=2.01) if by == "spacing" else grid)
    for item in items:
        item.SliceThickness = "1.0" if by == "spacing" else "3.0"
    assert any(text.startswith("thick slices") for text in warnings_of(tmp_path, writer, items))


@pytest.mark.parametrize(
    ("keyword", "value", "start"),
    [
        ("Modality", "MR", "modality MR"),
        ("RescaleType", "OD", "rescale type"),
        ("ImageType", ["DERIVED", "SECONDARY", "AXIAL"], "secondary images"),
    ],
)
def test_what_may_be_no_plain_ct_is_warned_about(keyword, value, start, tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        setattr(item, keyword, value)
    assert any(text.startswith(start) for text in warnings_of(tmp_path, writer, items))


def test_a_volume_without_air_is_warned_about(tmp_path, writer, grid):
    items = series_of(writer, grid, np.full((6, 7), 1024, np.uint16))
    assert "no air (H10): the lowest value is 0 HU" in warnings_of(tmp_path, writer, items)


def test_the_source_tells_what_gates_compare_and_nothing_else(tmp_path, writer, grid, secret):
    source = read_volume(writer.save(tmp_path / secret, writer.slices(grid))).source
    assert (source.kind, source.laterality, source.body_part) == ("dicom", "L", "TIBIA")
    assert source.patient_position == "HFS"
    assert source.slice_thickness_mm == 1.25
    assert secret not in repr(source)
