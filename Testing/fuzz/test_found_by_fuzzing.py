"""What campaigns found, as the smallest file that shows it: read wrong, or no refusal."""

from __future__ import annotations

import gzip
import os
import runpy
import struct
from pathlib import Path

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.imaging import dicom_series, read_volume

SEEDS = runpy.run_path(str(Path(__file__).with_name("file_fuzz.py")))["file_seeds"]()


@pytest.fixture
def spoiled(tmp_path):
    """Reads a seed in which bytes of the opened file were replaced."""

    def read(name, old=b"", new=b""):
        for file, content in SEEDS[name].items():
            (tmp_path / file).write_bytes(content)
        first = tmp_path / next(iter(SEEDS[name]))
        content = first.read_bytes()
        assert old in content
        first.write_bytes(content.replace(old, new, 1))
        return read_volume(first)

    return read


def refused(read, *arguments):
    with pytest.raises(InputError) as caught:
        read(*arguments)
    return caught.value.faults[0].value


@pytest.mark.parametrize("name", sorted(SEEDS))
def test_the_seeds_themselves_are_read(spoiled, name):
    assert spoiled(name).voxels[2, 3, 4] == 234 - 1000


def test_packed_voxels_too_few_for_the_size_are_not_filled_with_zeros(spoiled):
    assert "length" in refused(spoiled, "mha-packed", b"DimSize = 5 4 3", b"DimSize = 5 4 9")


def test_a_packed_metaimage_says_how_long_its_packed_data_are(spoiled):
    assert "length" in refused(spoiled, "mha-packed", b"CompressedDataSize", b"SomethingElseSize")


def test_packed_data_have_no_header_of_their_own(spoiled):
    line = b"HeaderSize = -1\nDimSize"
    assert "behind a header" in refused(spoiled, "mha-packed", b"DimSize", line)


def test_voxels_in_the_same_file_follow_its_header_at_once(spoiled):
    assert "behind a header" in refused(spoiled, "mha", b"DimSize", b"HeaderSize = 2\nDimSize")


@pytest.mark.parametrize("field", [b"CompressedData", b"DimSize", b"Offset", b"TransformMatrix"])
def test_a_field_in_other_capitals_is_ours_but_not_itks(spoiled, field):
    assert "capital" in refused(spoiled, "mha-packed", b"\n" + field, b"\n" + field.swapcase())


def test_two_byte_orders_in_one_header_are_refused(spoiled):
    line = b"ElementByteOrderMSB = True\nDimSize"
    assert "byte orders" in refused(spoiled, "mhd", b"DimSize", line)


def test_voxels_written_as_text_are_refused(spoiled):
    assert "text" in refused(spoiled, "mha", b"BinaryData = True", b"BinaryData = False")
    assert refused(spoiled, "nrrd-raw", b"encoding: raw", b"encoding: ascii") == "encoding"


@pytest.mark.parametrize("name", ["nrrd-raw", "mha"])
@pytest.mark.parametrize("side", [b"0", b"-3", b"9" * 400, b"inf", b"nan", b"2.5", b"2000000"])
def test_impossible_sizes_are_refused_as_such(spoiled, name, side):
    old = b"sizes: 5 4 3" if name == "nrrd-raw" else b"DimSize = 5 4 3"
    assert refused(spoiled, name, old, old[:-1] + side)


@pytest.mark.parametrize("start", [0.0, 1.0, 348.0, 352.5, 1e30, float("inf"), float("nan")])
def test_nifti_voxels_begin_behind_the_header(spoiled, start):
    head = SEEDS["nii"]["image.nii"][:108]
    value = refused(spoiled, "nii", head + struct.pack("<f", 352), head + struct.pack("<f", start))
    assert "impossible place" in value


def test_nifti_bits_are_those_of_its_type(spoiled):
    old = struct.pack("<2h", 4, 16)
    assert "type of voxel" in refused(spoiled, "nii", old, struct.pack("<2h", 4, 0))


@pytest.mark.parametrize("number", [float("nan"), float("inf"), -float("inf")])
def test_a_nifti_form_that_is_not_finite_is_refused_without_a_warning(tmp_path, number):
    content = bytearray(SEEDS["nii"]["image.nii"])
    struct.pack_into("<f", content, 300, number)
    (tmp_path / "image.nii").write_bytes(content)
    with pytest.raises(ValueError, match="not finite"):
        read_volume(tmp_path / "image.nii")


def test_an_archive_of_nifti_is_held_to_the_same(tmp_path):
    content = bytearray(gzip.decompress(SEEDS["nii-gz"]["image.nii.gz"]))
    struct.pack_into("<f", content, 108, 1.0)
    (tmp_path / "image.nii.gz").write_bytes(gzip.compress(bytes(content)))
    with pytest.raises(InputError, match="impossible place"):
        read_volume(tmp_path / "image.nii.gz")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="the system has no FIFOs")
@pytest.mark.parametrize("name", ["nhdr", "mhd"])
def test_detached_data_that_are_no_file_are_not_waited_for(tmp_path, name):
    first, data = SEEDS[name]
    (tmp_path / first).write_bytes(SEEDS[name][first])
    os.mkfifo(tmp_path / data)
    with pytest.raises(InputError, match="no file"):
        read_volume(tmp_path / first)


def test_a_folder_as_large_as_a_disk_is_not_walked_to_its_end(tmp_path, monkeypatch):
    monkeypatch.setattr(dicom_series, "MAX_FILES", 5)
    for number in range(6):
        (tmp_path / f"{number}.txt").write_bytes(np.int64(number).tobytes())
    with pytest.raises(InputError) as caught:
        read_volume(tmp_path)
    assert caught.value.faults[0].code == "too-many-files"
