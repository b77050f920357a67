"""Decoding of compressed pixels: the one place where foreign codecs see foreign bytes."""

from __future__ import annotations

import warnings
from collections.abc import Generator, Sequence
from contextlib import closing
from functools import lru_cache
from pathlib import Path

from numpy.typing import NDArray
from pydicom import FileDataset, dcmread
from pydicom.pixels.decoders.base import get_decoder
from pydicom.pixels.utils import pixel_array
from pydicom.uid import UID, AllTransferSyntaxes

from hexafix.errors import Fault, MissingLibrary
from hexafix.imaging.dicom_header import DEFLATED, PLAIN_SYNTAXES, SliceHeader
from hexafix.imaging.golden_streams import DecoderProof
from hexafix.imaging.header_words import shown_transfer_syntax
from hexafix.imaging.isolation import run_isolated

# Transfer syntaxes that always lose something; J2K and JPEG XL tell it in LossyImageCompression.
LOSSY_SYNTAXES = frozenset(
    "1.2.840.10008.1.2.4." + tail for tail in ("50", "51", "52", "53", "54", "55", "56", "81")
)

# The child's limits. Memory: Python and the codecs, the frame in all stages of its decoder, and a
# deflated file as it is read, inflated and held. Time: for each frame by itself, so that a long
# series cannot be taken for a hang; a tenth of the slowest codec's speed on a slow machine.
_BASE_MEMORY = 2 << 30
_BYTES_PER_PIXEL = 64
_BASE_SECONDS = 60.0
_PIXELS_PER_SECOND = 2e5


def require_decoder(transfer_syntax: str) -> list[Fault]:
    """Faults if pixels of this transfer syntax can never be decoded.

    Raises
    ------
    MissingLibrary
        If an optional library would decode them.
    """
    if transfer_syntax in PLAIN_SYNTAXES or transfer_syntax == DEFLATED:
        return []
    try:
        # Checked first: pydicom would quote a name that is none in a warning.
        if transfer_syntax not in AllTransferSyntaxes:
            raise NotImplementedError
        decoder = get_decoder(UID(transfer_syntax))
    except NotImplementedError:
        return [
            Fault(
                "transfer-syntax",
                "the pixels are compressed in a way that HexaFix cannot decode",
                value=shown_transfer_syntax(transfer_syntax),
                next_step="export the series uncompressed",
                hazard="H09",
            )
        ]
    if not decoder.is_available:
        raise MissingLibrary.of(
            "codec-missing",
            "the pixels are compressed and the decoder is not installed",
            value=transfer_syntax,
            next_step="install hexafix[codecs] or export the series uncompressed",
        )
    return []


def decode_frames(slices: Sequence[SliceHeader]) -> Generator[NDArray]:
    """Stored pixel values of compressed slices, shape (J, I) each, decoded in a child process.

    The child decodes pixels that are known before it decodes these (H54).

    Close the iterator when it is left early.

    Raises
    ------
    ImageRefused
        If a decoder fails or the child dies.
    SelfTestFailed
        If a decoder does not give the known pixels.
    """
    if not slices:
        return
    largest = max(item.rows * item.columns for item in slices)
    inflated = max(3 * (item.pixels.length or 0) for item in slices)
    asked = [(str(item.path.resolve()), item.frame, item.pixels.transfer_syntax) for item in slices]
    proof = DecoderProof(syntax for _, _, syntax in asked)
    results = run_isolated(
        "decode",
        [*proof.requests, *asked],
        memory_bytes=_BASE_MEMORY + largest * _BYTES_PER_PIXEL + inflated,
        seconds=_BASE_SECONDS + largest / _PIXELS_PER_SECOND,
    )
    with proof, closing(results):
        proof.check(results)
        for _, stored in results:
            yield stored


def decode_frame(path: Path, frame: int, transfer_syntax: str) -> NDArray:
    """Stored pixel values of one frame, shape (J, I), before rescale.

    Runs in the child process: any exception, and any crash, means that the file is corrupt.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        # pydicom finds the pixels by file position, which a deflated file does not have.
        source = _inflated(path) if transfer_syntax == DEFLATED else path
        return pixel_array(source, index=frame, raw=True)


@lru_cache(maxsize=1)
def _inflated(path: Path) -> FileDataset:
    """The whole data set, kept for the next frame of the same file."""
    return dcmread(path)
