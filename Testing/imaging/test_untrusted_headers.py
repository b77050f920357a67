"""Headers made to exhaust memory or time, and files that never end, are skipped with a reason."""

from __future__ import annotations

import copy
import os
import struct
import zlib

import numpy as np
import pytest
from hexafix.errors import HexaFixError, ImageRefused, InputError
from hexafix.imaging import dicom_header, header_file, read_volume
from hexafix.imaging.header_file import NotAnImage
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    ExplicitVRBigEndian,
    ExplicitVRLittleEndian,
)

UNDEFINED = b"\xff\xff\xff\xff"


@pytest.fixture
def a_slice(tmp_path, writer, grid):
    """The bytes of one good slice, and where its data set begins."""
    folder = writer.save(tmp_path / "good", writer.slices(grid))
    file = (folder / "0000.dcm").read_bytes()
    return file, 144 + int.from_bytes(file[140:144], "little")


@pytest.fixture
def reason(tmp_path):
    """Why a file is no image."""

    def ask(content: bytes) -> str:
        path = tmp_path / "one.dcm"
        path.write_bytes(content)
        with pytest.raises(NotAnImage) as caught:
            dicom_header.read_headers(path)
        return str(caught.value)

    return ask


def codes(folder, error=ImageRefused):
    with pytest.raises(error) as caught:
        read_volume(folder)
    return {fault.code for fault in caught.value.faults}


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no FIFOs")
def test_what_is_no_regular_file_is_left_out_and_never_waited_for(tmp_path, writer, grid):
    folder = writer.save(tmp_path / "ct", writer.slices(grid))
    os.mkfifo(folder / "waiting")
    (folder / "endless").symlink_to("/dev/zero")
    (folder / "loop").symlink_to("loop")
    (folder / "nothing").touch()
    volume = read_volume(folder)
    assert volume.size_ijk == (7, 6, 5)
    assert set(volume.source.warnings) == {
        "skipped: 2 x not a regular file",
        "skipped: 1 x file cannot be opened",
        "skipped: 1 x empty file",
    }


def test_a_link_to_a_slice_is_read(tmp_path, writer, grid):
    stored = writer.save(tmp_path / "stored", writer.slices(grid))
    (tmp_path / "ct").mkdir()
    for path in stored.iterdir():
        (tmp_path / "ct" / path.name).symlink_to(path)
    assert read_volume(tmp_path / "ct").size_ijk == (7, 6, 5)


def test_sequences_nested_2500_deep_are_skipped(a_slice, reason):
    file, start = a_slice
    level = b"\x09\0\x10\x10SQ\0\0" + UNDEFINED + b"\xfe\xff\x00\xe0" + UNDEFINED
    assert reason(file[:start] + level * 2500 + file[start:]) == "DICOM header is corrupt"


def test_an_attribute_that_claims_gigabytes_is_not_allocated(a_slice, reason, monkeypatch):
    file, start = a_slice
    claimed = b"\x08\0\x08\0UT\0\0" + struct.pack("<L", 0x7FFFFFFF)
    asked = []
    reads = header_file.BoundedFile.read

    def read(self, size=-1):
        answer = reads(self, size)
        asked.append(size)
        return answer

    monkeypatch.setattr(header_file.BoundedFile, "read", read)
    assert reason(file[:start] + claimed + file[start:]) == "DICOM header is corrupt"
    assert max(asked) < header_file.MAX_ELEMENT_BYTES


def test_a_private_element_of_gigabytes_before_the_pixels_is_passed_over(tmp_path, a_slice):
    file, start = a_slice
    path = tmp_path / "sparse.dcm"
    with path.open("wb") as sparse:
        sparse.write(file[:start] + b"\x07\0\x10\x10OB\0\0" + struct.pack("<L", 0xFFFFFF00))
        sparse.seek(0xFFFFFF00, os.SEEK_CUR)
        sparse.write(file[start:])
    (header,) = dicom_header.read_headers(path)
    assert (header.columns, header.rows, header.position_mm) == (7, 6, (-30.0, 12.5, 400.0))


def test_a_header_of_endless_empty_items_is_given_up(a_slice, reason, monkeypatch):
    file, start = a_slice
    empty = b"\xfe\xff\x00\xe0" + b"\0" * 4
    items = b"\x09\0\x10\x10SQ\0\0" + UNDEFINED + empty * 5000 + b"\xfe\xff\xdd\xe0" + b"\0" * 4
    bomb = file[:start] + items + file[start:]
    (path,) = [reason.__closure__[0].cell_contents / "bomb.dcm"]
    path.write_bytes(bomb)
    assert len(dicom_header.read_headers(path)) == 1
    monkeypatch.setattr(header_file, "_MAX_READS", 10_000)
    assert reason(bomb).startswith("DICOM header")


def test_more_functional_groups_than_any_ct_are_not_unfolded(tmp_path, writer, grid, monkeypatch):
    folder = writer.save(tmp_path / "ct", [writer.enhanced(grid)])
    assert read_volume(folder).size_ijk == (7, 6, 5)
    monkeypatch.setattr(dicom_header, "_MAX_ITEMS", 5)
    assert codes(folder, InputError) == {"no-dicom-image"}


@pytest.mark.parametrize(
    ("keyword", "value", "said"),
    [
        ("NumberOfFrames", "999999999", "frames"),
        ("NumberOfFrames", "0", "frames"),
        ("NumberOfFrames", "-3", "frames"),
        ("Columns", 65535, "pixels"),
    ],
)
def test_impossible_sizes_are_skipped_before_anything_is_made_of_them(
    keyword, value, said, tmp_path, writer, grid, reason
):
    item = writer.slices(grid)[0]
    item.Rows = 65535 if keyword == "Columns" else item.Rows
    setattr(item, keyword, value)
    folder = writer.save(tmp_path / "ct", [item])
    assert said in reason((folder / "0000.dcm").read_bytes())


@pytest.mark.parametrize("keyword", ["PixelRepresentation", "BitsStored", "HighBit"])
def test_how_pixels_are_stored_is_never_guessed(keyword, tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[2][keyword]
    assert codes(writer.save(tmp_path, items)) == {"pixel-format"}


def test_colours_by_a_palette_are_no_grey_values(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[1].PhotometricInterpretation = "PALETTE COLOR"
    assert codes(writer.save(tmp_path, items)) == {"pixel-format"}


def test_bytes_within_big_endian_words_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        writer.set_pixels(item, np.zeros((6, 7), np.uint8))
    assert codes(writer.save(tmp_path, items, syntax=ExplicitVRBigEndian)) == {"pixel-format"}


def test_floating_point_pixels_are_not_taken_for_whole_numbers(tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        item.BitsAllocated = item.BitsStored = 32
        item.HighBit = 31
        del item.PixelData
        item.add_new(0x7FE00008, "OF", np.zeros((6, 7), np.float32).tobytes())
    assert codes(writer.save(tmp_path, items)) == {"no-pixel-data"}


@pytest.mark.parametrize(("slope", "intercept"), [("1e5", "0"), ("1", "-2e5"), ("0.5", "9e5")])
def test_grey_values_beyond_all_sense_are_refused(slope, intercept, tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        item.RescaleSlope, item.RescaleIntercept = slope, intercept
    folder = writer.save(tmp_path, items)
    if abs(float(intercept)) + float(slope) * 5000 < 1e6:
        assert read_volume(folder).voxels.dtype == np.float32
    else:
        assert codes(folder) == {"impossible-values"}


@pytest.mark.parametrize("text", ["1_0\\0.45", "1e400\\0.45", "nan\\0.45", "1e7\\0.45"])
def test_numbers_that_no_scanner_writes_are_no_geometry(text, tmp_path, writer, grid):
    items = writer.slices(grid)
    items[0]["PixelSpacing"]._value = text
    folder = writer.save(tmp_path, items)
    assert codes(folder) == {"no-geometry"}


def test_a_number_under_a_damaged_representation_is_no_number(tmp_path, a_slice):
    file, _ = a_slice
    folder = tmp_path / "good"
    at = file.index(b"\x28\0\x30\0DS")
    (folder / "0000.dcm").write_bytes(file[: at + 4] + b"D\x02" + file[at + 6 :])
    assert "no-geometry" in codes(folder, HexaFixError)


def test_a_damaged_meta_header_is_skipped_whatever_pydicom_raises(a_slice, reason):
    file, _ = a_slice
    longer = file[:138] + b"\x11\0" + file[140:]
    assert reason(longer).startswith("DICOM header")


def test_deflated_pixels_of_the_wrong_length_are_refused_before_decoding(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[2].PixelData = items[2].PixelData[:-20]
    folder = writer.save(tmp_path, items, syntax=DeflatedExplicitVRLittleEndian)
    assert codes(folder) == {"truncated-pixel-data"}


def test_a_deflated_file_cut_short_is_skipped(tmp_path, writer, grid, reason):
    folder = writer.save(
        tmp_path / "ct", writer.slices(grid), syntax=DeflatedExplicitVRLittleEndian
    )
    file = (folder / "0000.dcm").read_bytes()
    assert reason(file[:-30]).startswith("DICOM header")


def test_what_a_deflated_header_keeps_in_memory_is_bounded(tmp_path, writer, grid, monkeypatch):
    item = writer.slices(grid)[0]
    item.add_new(0x00091010, "OB", b"\0" * (4 << 20))
    folder = writer.save(tmp_path, [item], syntax=DeflatedExplicitVRLittleEndian)
    path = folder / "0000.dcm"
    monkeypatch.setattr(header_file, "_MAX_INFLATED_HEADER", 1 << 20)
    with path.open("rb") as file:
        plain, size = header_file.inflate(file)
    assert plain.seek(0, os.SEEK_END) <= 2 << 20 < 4 << 20 < size


def test_the_transfer_syntax_of_a_deflated_file_cannot_be_hidden(tmp_path, a_slice, reason):
    """Far behind in the meta header it is not found, and the parser must not inflate by itself."""
    file, start = a_slice
    long = b"\x02\0\x02\x01OB\0\0" + struct.pack("<L", 2000) + b"\0" * 2000
    uid = b"1.2.840.10008.1.2.1.99"
    meta = long + b"\x02\0\x10\0UI" + struct.pack("<H", len(uid)) + uid
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    body = packer.compress(file[start:]) + packer.flush()
    head = file[:132] + b"\x02\0\0\0UL\x04\0" + struct.pack("<L", len(meta))
    assert reason(head + meta + body) == "DICOM header is corrupt"


def test_a_transfer_syntax_that_is_no_name_is_refused_without_a_warning(tmp_path, writer, grid):
    folder = writer.save(tmp_path, writer.slices(grid))
    for path in folder.iterdir():
        path.write_bytes(
            path.read_bytes().replace(b"1.2.840.10008.1.2.1\0", b"1.2.8\x000.10008.1.2.1\0")
        )
    assert "transfer-syntax" in codes(folder)


def test_doubles_are_compared_pair_by_pair(tmp_path, writer, grid):
    items = writer.slices(grid)
    copies = copy.deepcopy(items)
    folder = writer.save(tmp_path, [*items, *copies])
    assert read_volume(folder).size_ijk == (7, 6, 5)
    values = np.frombuffer(copies[3].PixelData, np.uint16).copy()
    values[5] += 1
    copies[3].PixelData = values.tobytes()
    writer.save(tmp_path, [*items, *copies])
    assert codes(tmp_path) == {"duplicate-slice"}


@pytest.mark.parametrize("case", ["decoded", "padded"])
def test_bits_above_the_lowest_places_are_refused_where_they_are_ambiguous(
    case, tmp_path, writer, grid
):
    items = writer.slices(grid)
    for item in items:
        item.BitsStored, item.HighBit = 12, 15
        if case == "padded":
            item.add_new("PixelPaddingValue", "US", 0)
    syntax = DeflatedExplicitVRLittleEndian if case == "decoded" else ExplicitVRLittleEndian
    assert codes(writer.save(tmp_path, items, syntax=syntax)) == {"pixel-format"}
