"""Encapsulated pixels: fragments, frames and their codestreams, checked before any decoding.

Only item headers, the beginning and the end of each frame are read, so memory stays bounded
whatever the file claims (H09, H52).
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import BinaryIO

from hexafix.errors import Fault
from hexafix.imaging.codestream import FrameSize, doubt_about
from hexafix.imaging.dicom_header import DEFLATED, PLAIN_SYNTAXES, SliceHeader
from hexafix.imaging.header_file import NotAnImage, open_regular

_ITEM, _END = b"\xfe\xff\x00\xe0", b"\xfe\xff\xdd\xe0"
_MAX_FRAGMENTS = 200_000
# Tables and application segments stand before the start of frame; in CT they are a few hundred.
_HEAD_BYTES = 1 << 16
_TAIL_BYTES = 16


class _Doubtful(Exception):
    """The text says why the encapsulation cannot be trusted."""


@dataclass(frozen=True, slots=True)
class _Fragment:
    offset: int
    length: int


def faults_of_streams(slices: Sequence[SliceHeader]) -> list[Fault]:
    """Compressed slices whose stream is incomplete or is not what their header says.

    Parameters
    ----------
    slices : sequence of SliceHeader
        Frames of one file may be any part of its frames.
    """
    doubts: list[str] = []
    checked = 0
    by_file: dict[Path, list[SliceHeader]] = {}
    for item in slices:
        syntax = item.pixels.transfer_syntax
        if syntax not in PLAIN_SYNTAXES and syntax != DEFLATED and item.pixels.offset is not None:
            by_file.setdefault(item.path, []).append(item)
    for frames in by_file.values():
        checked += len(frames)
        doubts += _doubts_of_file(frames)
    if not doubts:
        return []
    kinds = sorted(set(doubts), key=lambda doubt: (-doubts.count(doubt), doubt))
    more = f" and {len(kinds) - 3} other reasons" if len(kinds) > 3 else ""
    return [
        Fault(
            "bad-codestream",
            "compressed pixels are incomplete or are not what their header says",
            value=f"{len(doubts)} of {checked} slices: {'; '.join(kinds[:3])}{more}",
            limit="0",
            next_step="copy the series again, or export it uncompressed",
            hazard="H09",
        )
    ]


def _doubts_of_file(frames: Sequence[SliceHeader]) -> list[str]:
    """A reason for each frame that cannot be trusted."""
    first = frames[0]
    try:
        file, size = open_regular(first.path)
        with file:
            fragments = _frames_of(file, size, first)
            found = [_doubt(file, fragments[item.frame], item) for item in frames]
    except _Doubtful as doubt:
        return [str(doubt)] * len(frames)
    except (OSError, NotAnImage):
        return ["the file cannot be read again"] * len(frames)
    return [doubt for doubt in found if doubt is not None]


def _frames_of(file: BinaryIO, size: int, item: SliceHeader) -> list[list[_Fragment]]:
    """The fragments of each frame."""
    if item.pixels.length is not None:
        raise _Doubtful("compressed pixels that are not encapsulated")
    if item.pixels.extended_offsets:
        # It would rule over the fragments that are checked here.
        raise _Doubtful("an extended table of offsets, which HexaFix does not read")
    offsets, fragments = _walk(file, size, item)
    if offsets:
        places = {fragment.offset - fragments[0].offset: k for k, fragment in enumerate(fragments)}
        edges = [*(places.get(offset, -1) for offset in offsets), len(fragments)]
        ascending = all(a < b for a, b in pairwise(edges))
        if edges[0] != 0 or len(offsets) != item.frames or not ascending:
            raise _Doubtful("a table of offsets that does not fit the frames")
        return [fragments[a:b] for a, b in pairwise(edges)]
    if item.frames == 1:
        return [fragments]
    if len(fragments) != item.frames:
        raise _Doubtful(f"{len(fragments)} fragments for {item.frames} frames")
    return [[fragment] for fragment in fragments]


def _walk(file: BinaryIO, size: int, item: SliceHeader) -> tuple[list[int], list[_Fragment]]:
    """The basic offset table and all fragments, by the headers of the items."""
    at = item.pixels.offset or 0
    table, offsets = True, []
    fragments: list[_Fragment] = []
    while True:
        file.seek(at)
        head = file.read(8)
        if len(head) < 8:
            raise _Doubtful("the pixels end early")
        length = int.from_bytes(head[4:], "little")
        if head[:4] == _END and length == 0 and fragments:
            return offsets, fragments
        at += 8
        if head[:4] != _ITEM or at + length > size:
            raise _Doubtful("damaged or incomplete fragments")
        if table:
            if length % 4 or length > 4 * item.frames:
                raise _Doubtful("a table of offsets that does not fit the frames")
            offsets = list(struct.unpack(f"<{length // 4}L", file.read(length)))
            table = False
        else:
            fragments.append(_Fragment(at, length))
            if length == 0 or len(fragments) > _MAX_FRAGMENTS:
                raise _Doubtful("empty fragments, or more than any image has")
        at += length


def _doubt(file: BinaryIO, fragments: Sequence[_Fragment], item: SliceHeader) -> str | None:
    pixels = item.pixels
    head, tail = b"", b""
    for fragment in fragments:
        file.seek(fragment.offset)
        head += file.read(min(fragment.length, _HEAD_BYTES - len(head)))
        if len(head) >= _HEAD_BYTES:
            break
    for fragment in reversed(fragments):
        wanted = min(fragment.length, _TAIL_BYTES - len(tail))
        file.seek(fragment.offset + fragment.length - wanted)
        tail = file.read(wanted) + tail
        if len(tail) >= _TAIL_BYTES:
            break
    size = FrameSize(
        rows=item.rows,
        columns=item.columns,
        samples=pixels.samples,
        bits_allocated=pixels.bits_allocated,
        bits_stored=pixels.bits_stored,
    )
    length = sum(fragment.length for fragment in fragments)
    return doubt_about(head, tail, length, pixels.transfer_syntax, size)
