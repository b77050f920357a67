"""Pixels of an arranged stack: checked for completeness, read, rescaled and hashed."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, ImageRefused, InputError
from hexafix.imaging.decoding import decode_frame, require_decoder
from hexafix.imaging.dicom_header import DEFLATED, EXPLICIT_BIG, PLAIN_SYNTAXES, SliceHeader
from hexafix.imaging.fingerprint import THREADS, hash_slice
from hexafix.imaging.hounsfield import NeedsFloat, convert, stored_type
from hexafix.imaging.slice_stack import SliceStack, listed
from hexafix.progress import Progress

# Far above any CT of a limb (1024 x 1024 x 1500), far below what would exhaust a workstation.
MAX_VOXELS = 1_600_000_000
_BATCH = 8


@dataclass(frozen=True, eq=False)
class Pixels:
    """Voxels in HU, shape (K, J, I), int16 or float32; each slice's hash; the lowest value."""

    voxels: NDArray
    slice_hashes: list[bytes]
    lowest_hu: float


def frame_bytes(item: SliceHeader) -> int:
    """Bytes of one uncompressed frame."""
    pixels = item.pixels
    return item.rows * item.columns * pixels.samples * (pixels.bits_allocated // 8)


def faults_of_length(slices: Sequence[SliceHeader]) -> list[Fault]:
    """Missing, short or overlong pixel data, found before anything is decoded (H09)."""
    faults = []
    missing, short = [], []
    for item in slices:
        pixels = item.pixels
        where = "?" if item.position_mm is None else ", ".join(f"{v:.2f}" for v in item.position_mm)
        if pixels.transfer_syntax == DEFLATED:
            continue
        if pixels.offset is None:
            missing.append(f"({where})")
        elif pixels.transfer_syntax in PLAIN_SYNTAXES:
            expected = frame_bytes(item) * item.frames
            stated = pixels.length or 0
            # An odd number of bytes is padded to an even one.
            if not expected <= stated <= expected + 1 or pixels.available < expected:
                present = min(stated, pixels.available)
                short.append(f"({where}): {present} of {expected} bytes")
    if missing:
        faults.append(
            Fault(
                "no-pixel-data",
                "slices without pixels",
                value=f"{len(missing)} of {len(slices)} slices, origins at {listed(missing)}",
                limit="0",
                next_step="copy the series again",
                hazard="H09",
            )
        )
    if short:
        faults.append(
            Fault(
                "truncated-pixel-data",
                "slices whose pixels are not as long as their header says",
                value=f"{len(short)} of {len(slices)} slices, origins at {listed(short)}",
                limit="0",
                next_step="copy the series again",
                hazard="H09",
            )
        )
    for syntax in sorted({item.pixels.transfer_syntax for item in slices}):
        faults += require_decoder(syntax)
    return faults


def read_pixels(stack: SliceStack, progress: Progress) -> Pixels:
    """Read, rescale and hash the slices of a stack with two threads.

    Parameters
    ----------
    stack : SliceStack
        Its slices have passed every check of headers and lengths.
    progress : Progress

    Raises
    ------
    ImageRefused
        If pixels cannot be read.
    InputError
        If the volume is larger than any CT.
    """
    first = stack.slices[0]
    shape = (len(stack.slices), first.rows, first.columns)
    if np.prod(shape, dtype=float) > MAX_VOXELS:
        raise InputError.of(
            "volume-too-large",
            "the series has more voxels than any CT of a limb",
            value=" x ".join(map(str, shape)),
            limit=f"{MAX_VOXELS:.2g} voxels",
            next_step="crop or reconstruct the CT around the fixator",
        )
    try:
        return _fill(stack.slices, np.empty(shape, np.int16), progress)
    except NeedsFloat:
        return _fill(stack.slices, np.empty(shape, np.float32), progress)


def _fill(slices: Sequence[SliceHeader], voxels: NDArray, progress: Progress) -> Pixels:
    hashes: list[bytes] = [b""] * len(slices)
    lowest = [0.0] * len(slices)

    def fill(start: int) -> None:
        for k in range(start, min(start + _BATCH, len(slices))):
            read_slice(slices[k], voxels[k])
            hashes[k] = hash_slice(voxels[k])
            lowest[k] = float(voxels[k].min())

    with ThreadPoolExecutor(THREADS) as pool:
        futures = [pool.submit(fill, start) for start in range(0, len(slices), _BATCH)]
        try:
            for done, future in enumerate(as_completed(futures)):
                future.result()
                progress("read CT slices", (done + 1) / len(futures))
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
    return Pixels(voxels, hashes, min(lowest))


def read_slice(item: SliceHeader, out: NDArray) -> None:
    """Write the Hounsfield units of one slice into `out`, shape (J, I), int16 or float32.

    Raises
    ------
    ImageRefused
        If the pixels cannot be read or decoded.
    NeedsFloat
        If `out` is int16 and would lose something.
    """
    pixels = item.pixels
    if pixels.transfer_syntax not in PLAIN_SYNTAXES:
        stored = decode_frame(item.path, item.frame, pixels.transfer_syntax)
        if stored.shape != out.shape:
            raise _unreadable("decoded size differs from the header")
        convert(stored, item, out)
        return
    kind = stored_type(item, big_endian=pixels.transfer_syntax == EXPLICIT_BIG)
    direct = kind.itemsize == out.dtype.itemsize == 2 and kind.isnative
    stored = out.view(kind) if direct else np.empty(out.shape, kind)
    try:
        with item.path.open("rb", buffering=0) as file:
            file.seek((pixels.offset or 0) + item.frame * frame_bytes(item))
            if file.readinto(stored.reshape(-1).view(np.uint8).data) != stored.nbytes:
                raise _unreadable("the file ends early")
    except OSError as error:
        raise _unreadable(error.strerror or "read error") from error
    convert(stored if kind.isnative else stored.astype(kind.newbyteorder("=")), item, out)


def _unreadable(why: str) -> ImageRefused:
    return ImageRefused.of(
        "corrupt-pixel-data",
        "the pixels of a slice cannot be read",
        value=why,
        next_step="copy the series again",
        hazard="H09",
    )


def faults_of_doubles(stack: SliceStack) -> list[Fault]:
    """Compare the further slices at one position with the slice that was kept (H04).

    Identical pixels are the same slice twice and no fault; the stack holds it once.
    """
    different = []
    for index, double in stack.doubled:
        kept = stack.slices[index]
        if not _same_place(kept, double) or not np.array_equal(_read(kept), _read(double)):
            different.append(f"{stack.origins_mm[index] @ stack.axes[2]:.3f}")
    if not different:
        return []
    fault = Fault(
        "duplicate-slice",
        "different slices lie at one position",
        value=f"{len(different)} at {listed(different)} mm along the slice normal",
        limit="0",
        next_step="export one reconstruction, or one time point, alone",
        hazard="H04",
    )
    return [fault]


def _read(item: SliceHeader) -> NDArray[np.float32]:
    out = np.empty((item.rows, item.columns), np.float32)
    read_slice(item, out)
    return out


def _same_place(kept: SliceHeader, double: SliceHeader) -> bool:
    apart = np.subtract(kept.position_mm or (), double.position_mm or ())
    return bool(
        (kept.rows, kept.columns) == (double.rows, double.columns) and np.linalg.norm(apart) < 0.01
    )
