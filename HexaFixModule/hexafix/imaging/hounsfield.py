"""From stored pixel values to Hounsfield units."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, ImageRefused
from hexafix.imaging.dicom_header import EXPLICIT_BIG, PLAIN_SYNTAXES, SliceHeader

AIR_HU = -1024
_INT16 = np.iinfo(np.int16)


# Dense metal on an extended scale stays below 100 000 HU.
LARGEST_HU = 1e6


class NeedsFloat(Exception):
    """The values of this slice are not whole numbers that fit 16 bits."""


def faults_of_values(slices: Sequence[SliceHeader]) -> list[Fault]:
    """What forbids to turn the pixels of a series into Hounsfield units (H10)."""
    faults = []
    luts = sum(item.modality_lut for item in slices)
    if luts:
        faults.append(
            Fault(
                "modality-lut",
                "the grey values need a Modality LUT, not slope and intercept",
                value=f"{luts} of {len(slices)} slices",
                limit="0",
                next_step="export the original CT series",
                hazard="H10",
            )
        )
    bare = sum(
        not item.slope or item.intercept is None
        for item in slices
        if item.modality == "CT" and not item.modality_lut
    )
    if bare:
        faults.append(
            Fault(
                "no-rescale",
                "CT slices without RescaleSlope and RescaleIntercept",
                value=f"{bare} of {len(slices)} slices",
                limit="0",
                next_step="export the original CT series",
                hazard="H10",
            )
        )
    odd = sum(not _format_ok(item) for item in slices)
    if odd:
        faults.append(
            Fault(
                "pixel-format",
                "pixels are not stored as 8, 16 or 32 bit grey values, signed or unsigned",
                value=f"{odd} of {len(slices)} slices",
                limit="0",
                next_step="export the original CT series",
                hazard="H10",
            )
        )
    return faults


def _format_ok(item: SliceHeader) -> bool:
    pixels = item.pixels
    # Bits above the lowest places: decoders take the lowest ones all the same, and what padding
    # would mean there nobody says.
    shifted = pixels.high_bit != pixels.bits_stored - 1
    if shifted and (pixels.transfer_syntax not in PLAIN_SYNTAXES or pixels.padding is not None):
        return False
    return (
        pixels.samples == 1
        and pixels.signed is not None
        and pixels.photometric in ("MONOCHROME1", "MONOCHROME2")
        # Eight-bit pixels of big-endian words change their order with the VR.
        and not (pixels.transfer_syntax == EXPLICIT_BIG and pixels.bits_allocated == 8)
        and pixels.bits_allocated in (8, 16, 32)
        and 1 <= pixels.bits_stored <= pixels.bits_allocated
        and pixels.bits_stored - 1 <= pixels.high_bit < pixels.bits_allocated
    )


def stored_type(item: SliceHeader, *, big_endian: bool = False) -> np.dtype:
    """NumPy type of the pixels as they lie in the file."""
    kind = "i" if item.pixels.signed else "u"
    return np.dtype(f"{'>' if big_endian else '<'}{kind}{item.pixels.bits_allocated // 8}")


def convert(stored: NDArray, item: SliceHeader, out: NDArray) -> None:
    """Write the Hounsfield units of one slice into `out`.

    Parameters
    ----------
    stored : ndarray, shape (J, I)
        Pixel values, 8, 16 or 32 bit; changed in place. May share memory with `out`.
    item : SliceHeader
    out : ndarray, shape (J, I), int16 or float32

    Raises
    ------
    NeedsFloat
        If `out` is int16 and would lose something.
    ImageRefused
        If slope and intercept lead beyond anything that could be Hounsfield units (H10).
    """
    slope = 1.0 if item.slope is None else item.slope
    intercept = 0.0 if item.intercept is None else item.intercept
    _flatten_padding(stored, item, slope, intercept)
    _keep_stored_bits(stored, item)
    low, high = sorted(slope * float(end) + intercept for end in (stored.min(), stored.max()))
    if max(abs(low), abs(high)) > LARGEST_HU:
        raise ImageRefused.of(
            "impossible-values",
            "RescaleSlope and RescaleIntercept give impossible grey values",
            value=f"{low:.3g} to {high:.3g} HU",
            limit=f"±{LARGEST_HU:.0e} HU",
            next_step="export the original CT series",
            hazard="H10",
        )
    if out.dtype == np.float32:
        out[...] = slope * stored.astype(np.float64) + intercept
        return
    whole = slope.is_integer() and intercept.is_integer()
    if not whole or low < _INT16.min or high > _INT16.max:
        raise NeedsFloat
    # The result fits 16 bits, so arithmetic modulo 2^16 reaches it whatever happens between.
    values = stored.astype(np.int16, copy=False) if stored.dtype.itemsize != 2 else stored
    values = values.view(np.int16)
    if slope != 1.0:
        np.multiply(values, np.int16(((int(slope) + 32768) % 65536) - 32768), out=values)
    np.add(values, np.int16(((int(intercept) + 32768) % 65536) - 32768), out=out)


def _flatten_padding(stored: NDArray, item: SliceHeader, slope: float, intercept: float) -> None:
    """Give padding outside the field of view the value of air, where it lies below air."""
    pixels = item.pixels
    if pixels.padding is None or slope <= 0:
        return
    first = _signed(pixels.padding, item)
    last = first if pixels.padding_limit is None else _signed(pixels.padding_limit, item)
    first, last = min(first, last), max(first, last)
    air = (AIR_HU - intercept) / slope
    # A padding value inside the range of tissue may be tissue: it stays as it is.
    if last >= air:
        return
    mask = stored == first if first == last else (stored >= first) & (stored <= last)
    if mask.any():
        limits = np.iinfo(stored.dtype)
        stored[mask] = min(max(round(air), limits.min), limits.max)


def _signed(pattern: int, item: SliceHeader) -> int:
    """A US-or-SS attribute by the sign that PixelRepresentation demands."""
    return pattern - 0x10000 if item.pixels.signed and pattern >= 0x8000 else pattern


def _keep_stored_bits(stored: NDArray, item: SliceHeader) -> None:
    """Drop what lies outside the stored bits (old overlays) and extend the sign."""
    pixels = item.pixels
    spare = pixels.bits_allocated - pixels.bits_stored
    if spare == 0:
        return
    shift = pixels.bits_allocated - 1 - pixels.high_bit
    span = 1 << pixels.bits_stored
    low, high = (-span // 2, span // 2 - 1) if pixels.signed else (0, span - 1)
    if shift == spare and stored.min() >= low and stored.max() <= high:
        return
    stored <<= shift
    stored >>= spare
