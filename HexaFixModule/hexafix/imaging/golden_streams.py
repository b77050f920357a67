"""A compressed image of known pixels for each codec: what a decoder must get right first (H54).

Every child process that decodes a user's pixels decodes one of these before them. The streams were
made once by encoders (Pillow, GDCM, CharLS, OpenJPEG) from whole-number ramps; the run-length one
is written out by hand, the deflated one is packed by Python's zlib.
"""

from __future__ import annotations

from base64 import b64decode
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from numpy.typing import NDArray
from pydicom.pixels.decoders.base import get_decoder
from pydicom.uid import UID

from hexafix.errors import ImageRefused, SelfTestFailed
from hexafix.imaging.dicom_header import DEFLATED
from hexafix.imaging.golden_dicom import GoldenPixels, dicom_file
from hexafix.libraries import untrusted

RLE = "1.2.840.10008.1.2.5"
_JPEG = "1.2.840.10008.1.2.4."

_JPEG_BASELINE = (
    "/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDAAEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQEBAQ"
    "EBAQEBAQEBAQEBAQEBAQEBAQEBAQH/wAALCAAIABgBAREA/8QAFQABAQAAAAAAAAAAAAAAAAAACgv/xAAUEAEAAAAA"
    "AAAAAAAAAAAAAAAA/9oACAEBAAA/ADvqMA67/9k="
)
_JPEG_LOSSLESS = (
    "/9j/wwALEAAEAAgBAREA/8QAFgABAQEAAAAAAAAAAAAAAAAABAkQ/9oACAEBAAEAAM1rWta2+jWta1rb6Na1rWtvo1rW"
    "ta3/2QA="
)
_JPEG_LS = (
    "/9j/9wALDAAgACABAREA/9oACAEBAAAAAAAAzzZdM8tZznOc5mZmZmZmZmZmaJE6ZVRNSlJSlKqqoiIiIiJJ"
    "JOEiSSSSSSSSSSVVVTGNVVVVVVVf9TE//3//aGF//3//TMD/f/9/ovv/f/9+i8//f/96Lr//f/9kuP9//3+S"
    "2/9//35LT/9//3ksv/9//2lh/3//f0rv/3//elZ//3//Uqv/f/9+FR//f/9wpv9//3+FJ/9//3wov/9//2FB"
    "/3//fwnv/3//eE5//3//Qmv/f/9+Ex//f/9xLf9//38Sn/9//3El/3//fxIf/3//cR3/f/9/AP/Z"
)
_JPEG_2000 = (
    "/0//UQApAAAAAAAgAAAAIAAAAAAAAAAAAAAAIAAAACAAAAAAAAAAAAABCwEB/1IADAAAAAEABQQEAAH/XAAT"
    "QGBoaHBoaHBoaHBoaHBoaHD/ZAAlAAFDcmVhdGVkIGJ5IE9wZW5KUEVHIHZlcnNpb24gMi41LjL/kAAKAAAA"
    "AABoAAH/k8fsBAcgwPwAY/kCAAQABcB9oFD9gUANAws3/n3vwD6gOD8wYCIaFQN+YYt/G8AfOEgfgFA2oZnP"
    "PaYu1lrUsWirj8AHwiwH2hhfp8cz352sKV1L2K0AwVqHH//Z"
)

_SMALL = GoldenPixels([500 * j + 13 * i for j in range(4) for i in range(8)], 4, 8)
_LARGE = GoldenPixels(
    [500 + 100 * j + 7 * i for j in range(32) for i in range(32)], 32, 32, bits_stored=12
)
_BLOCKS = GoldenPixels(
    [(60, 200, 131)[i // 8] for _ in range(8) for i in range(24)],
    8,
    24,
    bits_stored=8,
    bits_allocated=8,
)
"""Blocks of one value each, which lossy JPEG keeps exactly."""


@dataclass(frozen=True)
class GoldenStream:
    """One compressed image of known pixels.

    Attributes
    ----------
    transfer_syntax : str
        Of the golden image.
    library : str
        What decodes it, for the message.
    pixels : GoldenPixels
        The known answer.
    file : bytes
        The image as a DICOM file.
    """

    transfer_syntax: str
    library: str
    pixels: GoldenPixels
    file: bytes


SYNTAXES = {
    DEFLATED: "deflated",
    RLE: "RLE",
    _JPEG + "50": "JPEG baseline",
    _JPEG + "70": "JPEG lossless",
    _JPEG + "80": "JPEG-LS",
    _JPEG + "90": "JPEG 2000",
}
"""Transfer syntaxes of the golden images, and what people call them."""


def golden_stream(transfer_syntax: str) -> GoldenStream | None:
    """The golden image of the codec that decodes a transfer syntax.

    It has the syntax itself or another of the same codec; None where there is none.
    """
    if transfer_syntax == DEFLATED:
        return _made(DEFLATED, ("pydicom",), _SMALL, None)
    if transfer_syntax == RLE:
        return _made(RLE, _libraries(RLE, ""), _SMALL, _run_lengths(_SMALL.values))
    tail = transfer_syntax.removeprefix(_JPEG)
    for tails, usual, pixels, stream in (
        (("50", "51"), "libjpeg", _BLOCKS, _JPEG_BASELINE),
        (("70", "57"), "libjpeg", _SMALL, _JPEG_LOSSLESS),
        (("80", "81"), "libjpeg", _LARGE, _JPEG_LS),
        (("90", "91", "201", "202", "203"), "openjpeg", _LARGE, _JPEG_2000),
    ):
        if tail in tails:
            syntax = _JPEG + tails[0]
            return _made(syntax, _libraries(syntax, usual), pixels, b64decode(stream))
    return None


def _made(
    syntax: str, libraries: Sequence[str], pixels: GoldenPixels, stream: bytes | None
) -> GoldenStream:
    file = dicom_file([], pixels, transfer_syntax=syntax, stream=stream)
    return GoldenStream(syntax, " + ".join(libraries), pixels, file)


def _libraries(syntax: str, usual: str) -> list[str]:
    """Pydicom and its installed plugins for a syntax, which it tries in turn."""
    plugins = [plugin for plugin in get_decoder(UID(syntax)).available_plugins
               if plugin != "pydicom"]  # fmt: skip
    return ["pydicom", *(f"{p}-{usual}" if p == "pylibjpeg" and usual else p for p in plugins)]


def _run_lengths(values: Sequence[int]) -> bytes:
    """RLE of 16-bit values (DICOM PS3.5 Annex G): high bytes as runs of one, low bytes literal."""
    high = b"".join(bytes((0, value >> 8)) for value in values)
    low = bytes((len(values) - 1, *(value & 0xFF for value in values)))
    low += b"\x80" * (len(low) % 2)
    offsets = (2, 64, 64 + len(high), *(0,) * 13)
    return b"".join(offset.to_bytes(4, "little") for offset in offsets) + high + low


class DecoderProof:
    """Golden images on disk, which a child process decodes before it decodes the user's.

    Use it as a context manager, which removes the files.

    Parameters
    ----------
    transfer_syntaxes : iterable of str
        Of the user's images.
    """

    def __init__(self, transfer_syntaxes: Iterable[str]) -> None:
        found = (golden_stream(syntax) for syntax in sorted(set(transfer_syntaxes)))
        streams = {item.transfer_syntax: item for item in found if item is not None}
        self._streams = list(streams.values())
        self._folder = TemporaryDirectory(prefix="hexafix-golden-")

    def __enter__(self) -> DecoderProof:
        for index, item in enumerate(self._streams):
            self._path(index).write_bytes(item.file)
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    def _path(self, index: int) -> Path:
        return Path(self._folder.name, f"{index}.dcm")

    @property
    def requests(self) -> list[tuple[str, int, str]]:
        """What to ask the child for first: path, frame and transfer syntax."""
        return [
            (str(self._path(index)), 0, item.transfer_syntax)
            for index, item in enumerate(self._streams)
        ]

    def check(self, results: Iterator[tuple[Any, NDArray]]) -> None:
        """Take the golden images off the child's results and compare them.

        Raises
        ------
        SelfTestFailed
            At the first that is not what it must be.
        """
        for item in self._streams:
            try:
                result = next(results, None)
                found = self._difference(result[1], item.pixels) if result else "nothing"
            except ImageRefused as refused:
                found = str(refused.faults[0].value or refused.faults[0].code)
            if found:
                name = SYNTAXES[item.transfer_syntax]
                raise SelfTestFailed(
                    untrusted(
                        f"compressed pixels ({name})",
                        item.library,
                        expected=f"{len(item.pixels.values)} known pixels",
                        found=found,
                    )
                )

    @staticmethod
    def _difference(stored: NDArray, pixels: GoldenPixels) -> str:
        """In words how decoded pixels differ from the known ones, empty if they do not."""
        if stored.shape != (pixels.rows, pixels.columns):
            return f"an image of {' x '.join(map(str, stored.shape))}"
        wrong = sum(
            value != known
            for value, known in zip(stored.ravel().tolist(), pixels.values, strict=True)
        )
        return f"{wrong} other pixels" if wrong else ""
