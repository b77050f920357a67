"""A compressed frame that is not what its header says is refused before any decoder sees it."""

from __future__ import annotations

import io
import struct

import pydicom
import pytest
from hexafix.errors import ImageRefused
from hexafix.imaging import decoding, read_volume
from hexafix.imaging.codestream import FrameSize, doubt_about
from hexafix.imaging.golden_streams import golden_stream
from pydicom.encaps import encapsulate, encapsulate_extended, get_frame

RLE = "1.2.840.10008.1.2.5"
BASELINE, LOSSLESS, JPEG_LS, JPEG_2000 = (
    f"1.2.840.10008.1.2.4.{tail}" for tail in ("50", "70", "80", "90")
)


def known(syntax):
    """Codestream and size of a small image in a transfer syntax."""
    item = pydicom.dcmread(io.BytesIO(golden_stream(syntax).file), force=True)
    stream = get_frame(item.PixelData, 0, number_of_frames=1)
    size = FrameSize(
        rows=item.Rows,
        columns=item.Columns,
        samples=1,
        bits_allocated=item.BitsAllocated,
        bits_stored=item.BitsStored,
    )
    return stream, size


def doubt(stream, size, syntax):
    return doubt_about(stream, stream[-16:], len(stream), syntax, size)


def put(stream, at, kind, value):
    changed = bytearray(stream)
    struct.pack_into(kind, changed, at, value)
    return bytes(changed)


def start_of_frame(stream):
    return next(stream.index(mark) for mark in (b"\xff\xc0", b"\xff\xc3", b"\xff\xf7")
                if mark in stream)  # fmt: skip


@pytest.mark.parametrize("syntax", [RLE, BASELINE, LOSSLESS, JPEG_LS, JPEG_2000])
def test_a_good_stream_raises_no_doubt(syntax):
    stream, size = known(syntax)
    assert doubt(stream, size, syntax) is None


@pytest.mark.parametrize("syntax", [BASELINE, LOSSLESS, JPEG_LS])
@pytest.mark.parametrize(
    ("field", "kind", "value", "said"),
    [
        (4, ">B", 255, "255 bits"),
        (5, ">H", 1, "pixels for"),
        (5, ">H", 0, "pixels for"),
        (7, ">H", 65535, "pixels for"),
        (9, ">B", 3, "3 components"),
        (1, ">B", 0xC1 + 4, "another kind"),
        (0, ">B", 0, "no start of frame"),
    ],
)
def test_every_field_of_a_jpeg_frame_is_compared(syntax, field, kind, value, said):
    stream, size = known(syntax)
    spoiled = put(stream, start_of_frame(stream) + field, kind, value)
    assert said in doubt(spoiled, size, syntax)


@pytest.mark.parametrize(
    ("field", "kind", "value", "said"),
    [
        (8, ">L", 33, "pixels for"),
        (12, ">L", 64, "pixels for"),
        (16, ">L", 40, "impossible size"),
        (24, ">L", 0, "impossible size"),
        (40, ">H", 16384, "components"),
        (42, ">B", 37, "38 bits"),
        (43, ">B", 2, "subsampled"),
        (44, ">B", 0, "subsampled"),
        (2, ">H", 0xFF52, "no JPEG 2000"),
    ],
)
def test_every_field_of_a_jpeg_2000_frame_is_compared(field, kind, value, said):
    stream, size = known(JPEG_2000)
    assert said in doubt(put(stream, field, kind, value), size, JPEG_2000)


def test_tiles_by_the_million_are_refused():
    stream, size = known(JPEG_2000)
    large = put(put(stream, 8, ">L", 4096), 12, ">L", 4096)
    tiny = put(put(large, 24, ">L", 1), 28, ">L", 1)
    wide = FrameSize(4096, 4096, 1, size.bits_allocated, size.bits_stored)
    assert "16777216 tiles" in doubt(tiny, wide, JPEG_2000)


@pytest.mark.parametrize(
    ("field", "value", "said"),
    [(0, 3, "3 RLE segments"), (0, 0, "0 RLE segments"), (4, 60, "places"), (8, 64, "places"),
     (8, 1 << 30, "places"), (12, 9, "places")],
)  # fmt: skip
def test_every_field_of_an_rle_header_is_compared(field, value, said):
    stream, size = known(RLE)
    assert said in doubt(put(stream, field, "<L", value), size, RLE)


def test_rle_too_short_for_any_run_is_refused():
    stream, size = known(RLE)
    wide = FrameSize(512, 512, 1, size.bits_allocated, size.bits_stored)
    assert "too short" in doubt(stream, wide, RLE)


@pytest.mark.parametrize("syntax", [BASELINE, LOSSLESS, JPEG_LS, JPEG_2000])
def test_a_stream_without_its_end_is_refused(syntax):
    stream, size = known(syntax)
    assert "no end" in doubt(stream.rstrip(b"\0")[:-2], size, syntax)
    assert doubt(stream.rstrip(b"\0") + b"\xff", size, syntax) is None


def test_a_codestream_in_the_boxes_of_a_file_is_found():
    stream, size = known(JPEG_2000)
    boxes = struct.pack(">L4sL", 12, b"jP  ", 0x0D0A870A) + struct.pack(">L4s", 8, b"free")
    boxed = boxes + struct.pack(">L4s", 8 + len(stream), b"jp2c") + stream
    assert doubt(boxed, size, JPEG_2000) is None
    assert "pixels for" in doubt(put(boxed, 28 + 8, ">L", 31), size, JPEG_2000)


@pytest.mark.parametrize("syntax", [RLE, LOSSLESS, JPEG_LS, JPEG_2000])
@pytest.mark.parametrize("length", [0, 1, 2, 5, 20, 60])
def test_the_beginning_of_a_stream_alone_is_a_doubt_and_no_exception(syntax, length):
    stream, size = known(syntax)
    assert doubt(stream[:length], size, syntax) is not None


# whole files ------------------------------------------------------------------------------


@pytest.fixture
def series(tmp_path, writer, grid, monkeypatch):
    """Saves a JPEG-LS series around a body of encapsulated pixels, and reads it."""
    stream, size = known(JPEG_LS)

    def read(body=None, *, frames=None, decodes=False, **attributes):
        items = writer.slices(grid)[: 1 if frames else None]
        for item in items:
            item.Rows, item.Columns = size.rows, size.columns
            item.BitsStored, item.HighBit = size.bits_stored, size.bits_stored - 1
            item.PixelData = body if body is not None else encapsulate([stream])
            item["PixelData"].VR = "OB"
            item["PixelData"].is_undefined_length = True
            if frames:
                item.NumberOfFrames = frames
            for keyword, value in attributes.items():
                setattr(item, keyword, value)
        folder = writer.save(tmp_path / "ct", items, syntax=JPEG_LS)
        if not decodes:
            monkeypatch.setattr(decoding, "run_isolated", lambda *_, **__: pytest.fail("decoded"))
        return read_volume(folder)

    read.stream = stream
    return read


def refusal(read, *arguments, **options):
    with pytest.raises(ImageRefused) as caught:
        read(*arguments, **options)
    faults = {fault.code: fault for fault in caught.value.faults}
    assert faults["bad-codestream"].hazard == "H09"
    return faults["bad-codestream"].value


def test_good_fragments_are_decoded(series):
    stream = series.stream
    assert series(encapsulate([stream], fragments_per_frame=3), decodes=True).size_ijk[2] == 5


def test_a_header_that_differs_from_its_stream_is_refused_before_decoding(series):
    assert "32 x 32 pixels for 32 x 31" in refusal(series, Rows=31)
    assert "12 bits for 11" in refusal(series, BitsStored=11, HighBit=10)


def test_fragments_that_end_early_are_refused(series):
    whole = encapsulate([series.stream])
    for cut in (4, 30, len(whole) - 8):
        assert refusal(series, whole[:cut])


def test_an_empty_fragment_is_refused(series):
    item = b"\xfe\xff\x00\xe0" + b"\0" * 4
    assert "empty fragments" in refusal(series, encapsulate([series.stream]) + item)


@pytest.mark.parametrize(
    "table", [b"\4\0\0\0", b"\0\0\0\0\4\0\0\0", b"\0\0\0"], ids=["shifted", "of-two", "odd"]
)
def test_a_table_of_offsets_that_does_not_fit_is_refused(series, table):
    rest = encapsulate([series.stream], has_bot=False)[8:]
    body = b"\xfe\xff\x00\xe0" + len(table).to_bytes(4, "little") + table + rest
    assert refusal(series, body)


def test_frames_and_fragments_are_counted(series):
    three = [series.stream] * 3
    bare = encapsulate(three, has_bot=False)
    halves = encapsulate(three, fragments_per_frame=2, has_bot=False)
    for frames, body in ((4, encapsulate(three)), (4, bare), (2, halves)):
        assert "frames" in refusal(series, body, frames=frames)


def test_an_extended_table_of_offsets_is_refused_because_it_would_rule(series):
    body, offsets, lengths = encapsulate_extended([series.stream])
    said = refusal(series, body, ExtendedOffsetTable=offsets, ExtendedOffsetTableLengths=lengths)
    assert "extended" in said


def test_compressed_pixels_of_a_stated_length_are_refused(tmp_path, writer, grid):
    folder = writer.save(tmp_path, writer.slices(grid))
    for path in folder.iterdir():
        file = path.read_bytes()
        head = file.replace(b"UI\x14\x001.2.840.10008.1.2.1\0", b"UI\x14\x001.2.840.10008.1.2.5\0")
        path.write_bytes(head)
    with pytest.raises(ImageRefused) as caught:
        read_volume(folder)
    assert "not encapsulated" in caught.value.faults[0].value
