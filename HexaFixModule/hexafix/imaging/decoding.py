"""Decoding of compressed pixels: the one place where foreign codecs see foreign bytes."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydicom import dcmread
from pydicom.pixels.decoders.base import get_decoder
from pydicom.pixels.utils import pixel_array
from pydicom.uid import UID

from hexafix.errors import Fault, ImageRefused, MissingLibrary
from hexafix.imaging.dicom_header import DEFLATED, PLAIN_SYNTAXES

# Transfer syntaxes that always lose something; J2K and JPEG XL tell it in LossyImageCompression.
LOSSY_SYNTAXES = frozenset(
    "1.2.840.10008.1.2.4." + tail for tail in ("50", "51", "52", "53", "54", "55", "56", "81")
)


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
        decoder = get_decoder(UID(transfer_syntax))
    except NotImplementedError:
        return [
            Fault(
                "transfer-syntax",
                "the pixels are compressed in a way that HexaFix cannot decode",
                value=transfer_syntax,
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


def decode_frame(path: Path, frame: int, transfer_syntax: str) -> NDArray:
    """Stored pixel values of one frame, shape (J, I), before rescale; always a fresh array.

    Raises
    ------
    ImageRefused
        If the decoder fails on the pixels.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # pydicom finds the pixels by file position, which a deflated file does not have.
            source = dcmread(path) if transfer_syntax == DEFLATED else path
            return np.array(pixel_array(source, index=frame, raw=True))
    except Exception as error:  # any codec failure means the same to the user
        raise ImageRefused.of(
            "corrupt-pixel-data",
            "the compressed pixels of a slice cannot be decoded",
            value=type(error).__name__,
            next_step="export the series again, uncompressed if possible",
            hazard="H09",
        ) from error
