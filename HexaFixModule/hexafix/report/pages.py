"""The pages of a PDF as pictures, for a screen."""

from __future__ import annotations

import struct
import zlib

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import InputError, MissingLibrary
from hexafix.threads import PDFIUM

DPI_RANGE = 20.0, 400.0
"""Resolutions that a screen can need; more would only fill the memory."""


def pdf_pages(pdf: bytes, *, dpi: float = 110.0) -> list[bytes]:
    """Each page as a PNG picture, RGB, in order.

    Parameters
    ----------
    pdf : bytes
    dpi : float
        Pixels to the inch of the page.

    Raises
    ------
    InputError
        If the resolution is none or the bytes are no PDF.
    MissingLibrary
        If the library that draws PDF pages is not installed.
    """
    if not DPI_RANGE[0] <= dpi <= DPI_RANGE[1]:
        raise InputError.of(
            "page-resolution",
            "the pages cannot be drawn at this resolution",
            value=f"{dpi:g} dpi",
            limit=f"{DPI_RANGE[0]:g} to {DPI_RANGE[1]:g} dpi",
        )
    try:
        # Not at the top: only a page on a screen needs it.
        import pypdfium2
    except ImportError as error:
        raise MissingLibrary.of(
            "library-missing",
            "pages cannot be shown without pypdfium2",
            next_step="install pypdfium2, or open the PDF in another program",
        ) from error
    try:
        with PDFIUM, pypdfium2.PdfDocument(pdf) as document:
            return [_png(_drawn(page, dpi)) for page in document]
    except pypdfium2.PdfiumError as error:
        raise InputError.of("not-a-pdf", "the pages cannot be drawn: this is no PDF") from error


def _drawn(page: object, dpi: float) -> NDArray[np.uint8]:
    """A page's pixels, shape (rows, columns, 3)."""
    bitmap = page.render(scale=dpi / 72.0, rev_byteorder=True, prefer_bgrx=False)  # type: ignore[attr-defined]
    return np.ascontiguousarray(bitmap.to_numpy()[..., :3])


def _png(pixels: NDArray[np.uint8]) -> bytes:
    """RGB pixels, shape (rows, columns, 3), as a PNG file."""
    rows, columns = pixels.shape[:2]
    # each line starts with its filter, 0: none
    lines = np.concatenate([np.zeros((rows, 1), np.uint8), pixels.reshape(rows, -1)], axis=1)
    header = struct.pack(">IIBBBBB", columns, rows, 8, 2, 0, 0, 0)
    parts = ((b"IHDR", header), (b"IDAT", zlib.compress(lines.tobytes(), 6)), (b"IEND", b""))
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))
        for name, data in parts
    )
