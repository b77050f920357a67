"""A DICOM writer of one page: bytes by `struct`, so that no library can cancel its own fault."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from hexafix.imaging.dicom_header import (
    DEFLATED,
    EXPLICIT_BIG,
    EXPLICIT_LITTLE,
    IMPLICIT_LITTLE,
)

UID_ROOT = "1.2.826.0.1.3680043.8.498.54."
CT_STORAGE = "1.2.840.10008.5.1.4.1.1.2"
PIXEL_DATA = 0x7FE00010

Element = tuple[int, str, object]
"""Tag, value representation and value: text, whole number (US), numbers (DS) or bytes."""

_UNDEFINED = 0xFFFFFFFF


@dataclass(frozen=True)
class GoldenPixels:
    """How whole numbers are stored as pixels.

    Attributes
    ----------
    values : sequence of int
        Row after row.
    rows, columns : int
    signed : bool
    bits_stored, bits_allocated : int
    """

    values: Sequence[int]
    rows: int
    columns: int
    signed: bool = False
    bits_stored: int = 16
    bits_allocated: int = 16

    def elements(self) -> list[Element]:
        """The Image Pixel module without the pixels."""
        return [
            (0x00280002, "US", 1),
            (0x00280004, "CS", "MONOCHROME2"),
            (0x00280010, "US", self.rows),
            (0x00280011, "US", self.columns),
            (0x00280100, "US", self.bits_allocated),
            (0x00280101, "US", self.bits_stored),
            (0x00280102, "US", self.bits_stored - 1),
            (0x00280103, "US", int(self.signed)),
        ]

    def words(self, transfer_syntax: str) -> bytes:
        """16-bit pixels uncompressed, the bits above the stored ones zero."""
        order = ">" if transfer_syntax == EXPLICIT_BIG else "<"
        mask = (1 << self.bits_stored) - 1
        return struct.pack(f"{order}{len(self.values)}H", *(v & mask for v in self.values))


def dicom_file(
    elements: Iterable[Element],
    pixels: GoldenPixels,
    *,
    transfer_syntax: str = EXPLICIT_LITTLE,
    stream: bytes | None = None,
) -> bytes:
    """One image as a DICOM file.

    Parameters
    ----------
    elements : iterable of Element
        What the file says beside its pixels, in any order.
    pixels : GoldenPixels
    transfer_syntax : str
    stream : bytes, optional
        The pixels compressed; needed for every syntax that encapsulates.
    """
    meta = b"".join(
        _element(element, order="<", explicit=True)
        for element in (
            (0x00020001, "OB", b"\0\1"),
            (0x00020002, "UI", CT_STORAGE),
            (0x00020003, "UI", UID_ROOT + "1"),
            (0x00020010, "UI", transfer_syntax),
            (0x00020012, "UI", UID_ROOT + "2"),
        )
    )
    length = struct.pack("<HH2sHL", 2, 0, b"UL", 4, len(meta))
    order = ">" if transfer_syntax == EXPLICIT_BIG else "<"
    explicit = transfer_syntax != IMPLICIT_LITTLE
    header = sorted([*elements, *pixels.elements()])
    body = b"".join(_element(item, order=order, explicit=explicit) for item in header)
    if stream is None:
        words = (PIXEL_DATA, "OW", pixels.words(transfer_syntax))
        body += _element(words, order=order, explicit=explicit)
    else:
        body += _encapsulated(stream)
    if transfer_syntax == DEFLATED:
        deflate = zlib.compressobj(wbits=-zlib.MAX_WBITS)
        body = deflate.compress(body) + deflate.flush()
        body += b"\0" * (len(body) % 2)
    return b"\0" * 128 + b"DICM" + length + meta + body


def _element(element: Element, *, order: str, explicit: bool) -> bytes:
    tag, representation, given = element
    value = _encoded(given, order)
    value += (b"\0" if representation in ("UI", "OB", "OW") else b" ") * (len(value) % 2)
    head = struct.pack(order + "HH", tag >> 16, tag & 0xFFFF)
    if not explicit:
        return head + struct.pack(order + "L", len(value)) + value
    head += representation.encode()
    if representation in ("OB", "OW"):
        return head + struct.pack(order + "HL", 0, len(value)) + value
    return head + struct.pack(order + "H", len(value)) + value


def _encoded(value: object, order: str) -> bytes:
    if isinstance(value, bytes):
        return value
    if isinstance(value, int):
        return struct.pack(order + "H", value)
    if isinstance(value, tuple):
        return "\\".join(f"{number:.10g}" for number in value).encode()
    return str(value).encode()


def _encapsulated(stream: bytes) -> bytes:
    """The pixel element of one compressed frame: empty offset table, fragment, delimiter."""
    stream += b"\0" * (len(stream) % 2)
    return (
        struct.pack("<HH2sHL", 0x7FE0, 0x0010, b"OB", 0, _UNDEFINED)
        + struct.pack("<HHL", 0xFFFE, 0xE000, 0)
        + struct.pack("<HHL", 0xFFFE, 0xE000, len(stream))
        + stream
        + struct.pack("<HHL", 0xFFFE, 0xE0DD, 0)
    )
