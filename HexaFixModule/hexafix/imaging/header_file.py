"""DICOM files as the header's parser may see them: regular, bounded, inflated only so far."""

from __future__ import annotations

import io
import os
import stat
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO, cast

from pydicom.filereader import read_dataset
from pydicom.tag import BaseTag

# A data set of nothing but empty items takes three reads and 1.5 kB for each of them; the headers
# of a thousand frames with all their functional groups take 200 000 reads.
_MAX_READS = 1_000_000
_MAX_READ_BYTES = 1 << 28
MAX_ELEMENT_BYTES = 1 << 25
"""No element that is looked at may be longer; a thousand functional groups need a few MB."""

# A deflated header can blow up a thousandfold; no CT slice or multi-frame CT needs more than this.
_MAX_INFLATED = 1 << 30
_MAX_INFLATED_HEADER = 1 << 26
_BLOCK = 1 << 20
_EXPLICIT_LITTLE = b"1.2.840.10008.1.2.1\0"


class NotAnImage(Exception):
    """The file holds no image slice; the text is the reason shown to the user."""


class BoundedFile:
    """A file that a parser may read only so often and so far (H52).

    Parameters
    ----------
    file : BinaryIO
    """

    __slots__ = ("_left", "_read", "_reads", "name", "seek", "tell")

    def __init__(self, file: BinaryIO) -> None:
        self._read: Callable[[int], bytes] = file.read
        self.seek = file.seek
        self.tell = file.tell
        self.name = ""
        self._reads = _MAX_READS
        self._left = _MAX_READ_BYTES

    def read(self, size: int = -1) -> bytes:
        """As of a file; ValueError where no header reads so much."""
        self._reads -= 1
        self._left -= size
        if self._reads < 0 or self._left < 0 or not 0 <= size <= MAX_ELEMENT_BYTES:
            raise ValueError("more than any header needs")
        return self._read(size)


def open_regular(path: Path) -> tuple[BinaryIO, int]:
    """An open file and its size.

    A FIFO or a device would keep its reader waiting, or never end: they are not even opened to
    be waited for.

    Raises
    ------
    NotAnImage
        If it is no regular file, or an empty one.
    OSError
    """
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    # Opening a device may already do something, so it is asked for its kind before, too.
    if not stat.S_ISREG(path.stat().st_mode):
        raise NotAnImage("not a regular file")
    descriptor = os.open(path, flags)
    try:
        status = os.fstat(descriptor)
        if not stat.S_ISREG(status.st_mode):
            raise NotAnImage("not a regular file")
        if status.st_size == 0:
            raise NotAnImage("empty file")
        return os.fdopen(descriptor, "rb"), status.st_size
    except BaseException:
        os.close(descriptor)
        raise


def inflate(file: BinaryIO) -> tuple[BinaryIO, int]:
    """A deflated DICOM file as a plain one, as far as a header reaches, and its whole length.

    Parameters
    ----------
    file : BinaryIO
        Its meta header names the deflated transfer syntax.

    Returns
    -------
    plain : BinaryIO
        Preamble, a transfer syntax of explicit little endian, and the beginning of the data set.
    size : int
        Bytes that `plain` would have with the whole data set, counted in bounded memory.

    Raises
    ------
    NotAnImage
        If it inflates beyond reason.
    zlib.error
        If the compressed data are damaged or incomplete.
    """
    file.seek(132)
    read_dataset(cast(BinaryIO, BoundedFile(file)), False, True, stop_when=_after_meta)
    uid = struct.pack("<HH2sH", 2, 0x10, b"UI", len(_EXPLICIT_LITTLE)) + _EXPLICIT_LITTLE
    plain = io.BytesIO()
    plain.write(b"\0" * 128 + b"DICM" + uid)
    inflater, size = zlib.decompressobj(-zlib.MAX_WBITS), plain.tell()
    while not inflater.eof and (data := inflater.unconsumed_tail or file.read(_BLOCK)):
        block = inflater.decompress(data, _BLOCK)
        size += len(block)
        if size > _MAX_INFLATED:
            raise NotAnImage("deflated DICOM that inflates to more than 1 GB")
        if plain.tell() < _MAX_INFLATED_HEADER:
            plain.write(block)
    if not inflater.eof:
        raise zlib.error("incomplete")
    plain.seek(0)
    return plain, size


def _after_meta(tag: BaseTag, vr: str | None, length: int) -> bool:
    return tag >> 16 != 2
