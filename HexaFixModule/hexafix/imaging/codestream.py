"""What a compressed frame says about itself: JPEG, JPEG-LS, JPEG 2000 and RLE headers.

Nothing is decoded. A decoder believes these headers and not DICOM's, and some decoders crash on
what they find there (H52), so they must say the same before any decoder sees them.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

RLE = "1.2.840.10008.1.2.5"
_JPEG = "1.2.840.10008.1.2.4."
# Which start of frame each transfer syntax allows.
_START_OF_FRAME = {
    _JPEG + "50": (0xC0,),
    _JPEG + "51": (0xC0, 0xC1),
    _JPEG + "57": (0xC3,),
    _JPEG + "70": (0xC3,),
    _JPEG + "80": (0xF7,),
    _JPEG + "81": (0xF7,),
}
_JPEG_2000 = frozenset(_JPEG + tail for tail in ("90", "91", "201", "202", "203"))
_MAX_TILES = 65535
_RLE_HEADER = 64


@dataclass(frozen=True, slots=True)
class FrameSize:
    """What DICOM's header says about a frame: what its codestream has to say too."""

    rows: int
    columns: int
    samples: int
    bits_allocated: int
    bits_stored: int


def doubt_about(head: bytes, tail: bytes, length: int, syntax: str, size: FrameSize) -> str | None:
    """Why a compressed frame cannot be what its DICOM header says, None where it can.

    Parameters
    ----------
    head : bytes
        The beginning of the frame; the whole frame where it is short.
    tail : bytes
        The end of the frame.
    length : int
        Bytes of the whole frame.
    syntax : str
        Transfer syntax.
    size : FrameSize

    Returns
    -------
    str or None
        None also for a transfer syntax whose streams are not known here.
    """
    if syntax == RLE:
        return _rle(head, length, size)
    if syntax in _START_OF_FRAME:
        return _ends(tail) or _jpeg(head, _START_OF_FRAME[syntax], size)
    if syntax in _JPEG_2000:
        return _ends(tail) or _jpeg_2000(head, size)
    return None


def _ends(tail: bytes) -> str | None:
    # A byte of padding makes the length even: by the standard 0, in many files 255.
    if tail.rstrip(b"\0\xff").endswith(b"\xff\xd9"):
        return None
    return "the compressed stream has no end"


def _jpeg(head: bytes, allowed: tuple[int, ...], size: FrameSize) -> str | None:
    """Walk the marker segments up to the start of frame."""
    if head[:2] != b"\xff\xd8":
        return "no JPEG stream"
    at = 2
    while at + 4 <= len(head) and head[at] == 0xFF:
        marker = head[at + 1]
        if marker == 0xFF:  # fill byte
            at += 1
            continue
        (length,) = struct.unpack_from(">H", head, at + 2)
        # C4, C8 and CC are tables within the range of the starts of frame.
        if marker == 0xF7 or (0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC)):
            if marker not in allowed:
                return "another kind of JPEG than the transfer syntax says"
            if at + 10 > len(head):
                break
            precision, rows, columns, samples = struct.unpack_from(">BHHB", head, at + 4)
            return _compare(rows, columns, samples, precision, size)
        if length < 2 or marker in (0xD8, 0xD9, 0xDA):
            break
        at += 2 + length
    return "no start of frame in the JPEG stream"


def _jpeg_2000(head: bytes, size: FrameSize) -> str | None:
    """The image and tile size segment, which follows the start of the codestream at once."""
    at = _codestream(head)
    if at is None or len(head) < at + 45 or head[at : at + 4] != b"\xff\x4f\xff\x51":
        return "no JPEG 2000 codestream"
    x1, y1, x0, y0, tile_x, tile_y, tile_x0, tile_y0, samples = struct.unpack_from(
        ">8LH", head, at + 8
    )
    depth, step_x, step_y = struct.unpack_from("3B", head, at + 42)
    if not (x0 < x1 and y0 < y1 and tile_x and tile_y and tile_x0 <= x0 and tile_y0 <= y0):
        return "impossible size of image or tiles"
    tiles = -(-(x1 - tile_x0) // tile_x) * -(-(y1 - tile_y0) // tile_y)
    if tiles > _MAX_TILES:
        return f"{tiles} tiles"
    if (step_x, step_y) != (1, 1):
        return "subsampled pixels"
    return _compare(y1 - y0, x1 - x0, samples, (depth & 0x7F) + 1, size)


def _codestream(head: bytes) -> int | None:
    """Where the codestream begins: at once, or in a box of the file format JP2."""
    if head[4:8] != b"jP  ":
        return 0
    at = 0
    while at + 8 <= len(head):
        length, kind = struct.unpack_from(">L4s", head, at)
        if kind == b"jp2c":
            return at + 8
        if length < 8:
            return None
        at += length
    return None


def _compare(rows: int, columns: int, samples: int, precision: int, size: FrameSize) -> str | None:
    if (rows, columns) != (size.rows, size.columns):
        return f"{columns} x {rows} pixels for {size.columns} x {size.rows}"
    if samples != size.samples:
        return f"{samples} components for {size.samples}"
    if precision not in (size.bits_stored, size.bits_allocated):
        return f"{precision} bits for {size.bits_stored}"
    return None


def _rle(head: bytes, length: int, size: FrameSize) -> str | None:
    """The sixteen numbers at the start: how many segments, and where each begins."""
    if len(head) < _RLE_HEADER:
        return "no RLE header"
    count, *offsets = struct.unpack_from("<16L", head)
    expected = size.samples * (size.bits_allocated // 8)
    if count != expected:
        return f"{count} RLE segments for {expected}"
    used, unused = offsets[:count], offsets[count:]
    ends = [*used[1:], length]
    if (
        used[0] != _RLE_HEADER
        or any(unused)
        or any(a >= b for a, b in zip(used, ends, strict=True))
    ):
        return "impossible places of RLE segments"
    # The best a run can do is 128 bytes of pixels for two.
    shortest = -(-size.rows * size.columns // 128) * 2
    if any(b - a < shortest for a, b in zip(used, ends, strict=True)):
        return "an RLE segment too short for its pixels"
    return None
