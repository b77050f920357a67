"""Pixels of an arranged stack: checked for completeness, read, rescaled and hashed."""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import closing
from dataclasses import dataclass
from threading import Event

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, ImageRefused, InputError
from hexafix.imaging.decoding import decode_frames, require_decoder
from hexafix.imaging.dicom_header import DEFLATED, EXPLICIT_BIG, PLAIN_SYNTAXES, SliceHeader
from hexafix.imaging.encapsulated import faults_of_streams
from hexafix.imaging.fingerprint import hash_slice
from hexafix.imaging.gantry_tilt import OrthogonalGrid
from hexafix.imaging.hounsfield import AIR_HU, NeedsFloat, convert, stored_type
from hexafix.imaging.slice_agreement import listed
from hexafix.imaging.slice_stack import SliceStack
from hexafix.imaging.volume import MAX_VOXELS
from hexafix.progress import Progress
from hexafix.threads import thread_count

_BATCH = 8
_CHILD_BATCH = 16
_POLL_SECONDS = 0.05


@dataclass(frozen=True, eq=False)
class Pixels:
    """The pixels of a stack.

    Attributes
    ----------
    voxels : ndarray, shape (K, J, I), int16 or float32
        HU, on the orthogonal grid where the stack is tilted.
    slice_hashes : list of bytes
        Of each slice as it was acquired.
    lowest_hu : float
        The lowest acquired value.
    """

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
        if pixels.offset is None:
            missing.append(f"({where})")
        elif pixels.transfer_syntax in PLAIN_SYNTAXES or pixels.transfer_syntax == DEFLATED:
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
    return faults + faults_of_streams(slices)


def read_pixels(stack: SliceStack, progress: Progress) -> Pixels:
    """Read, rescale and hash the slices of a stack on several threads.

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
    grid = stack.orthogonal_grid()
    shape = (grid or stack).size_ijk[::-1]
    if np.prod(shape, dtype=float) > MAX_VOXELS:
        raise InputError.of(
            "volume-too-large",
            "the series has more voxels than any CT of a limb",
            value=" x ".join(map(str, shape)),
            limit=f"{MAX_VOXELS:.2g} voxels",
            next_step="crop or reconstruct the CT around the fixator",
        )
    try:
        return _fill(stack.slices, np.empty(shape, np.int16), grid, progress)
    except NeedsFloat:
        return _fill(stack.slices, np.empty(shape, np.float32), grid, progress)


def _fill(
    slices: Sequence[SliceHeader], voxels: NDArray, grid: OrthogonalGrid | None, progress: Progress
) -> Pixels:
    hashes: list[bytes] = [b""] * len(slices)
    lowest = [0.0] * len(slices)
    stop = Event()
    threads = thread_count()
    # A child process that decodes should serve many slices; plain reading is best in small turns.
    plain = all(item.pixels.transfer_syntax in PLAIN_SYNTAXES for item in slices)
    batch = _BATCH if plain else max(-(-len(slices) // threads), _CHILD_BATCH)

    def fill(start: int) -> None:
        end = min(start + batch, len(slices))
        if grid is None:
            acquired = list(voxels[start:end])
        else:
            # One slice in memory, used again for each: the moved one is all that is kept.
            acquired = [np.empty((slices[0].rows, slices[0].columns), voxels.dtype)] * (end - start)
        with closing(read_slices(slices[start:end], acquired)) as done:
            for k, values in zip(range(start, end), acquired, strict=True):
                if stop.is_set():
                    return
                next(done)
                lowest[k] = float(values.min())
                if grid is not None:
                    grid.place(values, k, voxels[k], outside=AIR_HU)
                hashes[k] = hash_slice(values)

    with ThreadPoolExecutor(threads) as pool:
        futures = [pool.submit(fill, start) for start in range(0, len(slices), batch)]
        try:
            pending = set(futures)
            while pending:
                finished, pending = wait(pending, timeout=_POLL_SECONDS)
                for future in finished:
                    future.result()
                progress("read CT slices", sum(map(bool, hashes)) / len(slices))
        finally:
            stop.set()
            pool.shutdown(cancel_futures=True)
    return Pixels(voxels, hashes, min(lowest))


def read_slices(slices: Sequence[SliceHeader], out: Iterable[NDArray]) -> Generator[None]:
    """Write the Hounsfield units of each slice into its part of `out`, one a step.

    Close the iterator when it is left early.

    Parameters
    ----------
    slices : sequence of SliceHeader
    out : iterable of ndarray, shape (J, I) each, int16 or float32

    Raises
    ------
    ImageRefused
        If the pixels cannot be read or decoded.
    NeedsFloat
        If `out` is int16 and would lose something.
    """
    packed = [item for item in slices if item.pixels.transfer_syntax not in PLAIN_SYNTAXES]
    with closing(decode_frames(packed)) as decoded:
        for item, target in zip(slices, out, strict=True):
            if item.pixels.transfer_syntax in PLAIN_SYNTAXES:
                _read_plain(item, target)
            else:
                stored = next(decoded, None)
                if stored is None or stored.shape != target.shape:
                    raise _unreadable("decoded size differs from the header")
                convert(stored, item, target)
            yield


def _read_plain(item: SliceHeader, out: NDArray) -> None:
    pixels = item.pixels
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
    pairs = [(stack.slices[index], double) for index, double in stack.doubled]
    flat = [item for pair in pairs for item in pair]
    # One pair in memory at a time: a file's compressed doubles are as many as it likes.
    latest: deque[NDArray] = deque(maxlen=2)

    def values() -> Iterator[NDArray]:
        for item in flat:
            latest.append(np.empty((item.rows, item.columns), np.float32))
            yield latest[-1]

    with closing(read_slices(flat, values())) as done:
        for (index, _), pair in zip(stack.doubled, pairs, strict=True):
            next(done)
            next(done)
            kept, double = latest
            if _same_place(*pair) and np.array_equal(kept, double):
                continue
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


def _same_place(kept: SliceHeader, double: SliceHeader) -> bool:
    apart = np.subtract(kept.position_mm or (), double.position_mm or ())
    return bool(
        (kept.rows, kept.columns) == (double.rows, double.columns) and np.linalg.norm(apart) < 0.01
    )
