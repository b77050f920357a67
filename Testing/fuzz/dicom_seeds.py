"""Small series to be spoiled: oblique, anisotropic, off-origin, in every storage that is read."""

from __future__ import annotations

import io
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pydicom
from hexafix.imaging.golden_streams import golden_stream
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.encaps import encapsulate, get_frame
from pydicom.uid import (
    DeflatedExplicitVRLittleEndian,
    ExplicitVRBigEndian,
    ExplicitVRLittleEndian,
    ImplicitVRLittleEndian,
    JPEG2000Lossless,
    RLELossless,
)

ROOT = "1.2.826.0.1.3680043.8.498.77."
JPEG_LOSSLESS = "1.2.840.10008.1.2.4.70"
JPEG_LS = "1.2.840.10008.1.2.4.80"


@dataclass(frozen=True)
class Seed:
    """A whole series as bytes of files.

    Attributes
    ----------
    name : str
    files : tuple of bytes
        A deflated file stands here as it is before its data set is packed.
    order : str
        ``<`` or ``>``.
    explicit : bool
        Whether value representations are written.
    deflated : bool
    """

    name: str
    files: tuple[bytes, ...]
    order: str = "<"
    explicit: bool = True
    deflated: bool = False


def deflate(file: bytes) -> bytes:
    """A plain explicit little-endian file as a deflated one."""
    start = 144 + int.from_bytes(file[140:144], "little")
    packer = zlib.compressobj(9, zlib.DEFLATED, -zlib.MAX_WBITS)
    body = packer.compress(file[start:]) + packer.flush()
    return file[:start] + body + b"\0" * (len(body) % 2)


def _axes(seed: int) -> tuple[np.ndarray, np.ndarray]:
    turned, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return turned[0], turned[1]


def _base(values: np.ndarray, *, stored: int) -> Dataset:
    item = Dataset()
    item.SOPClassUID = "1.2.840.10008.5.1.4.1.1.2"
    item.PatientName, item.PatientID, item.PatientBirthDate = "Fuzz^A", "1", "19700101"
    item.SeriesInstanceUID, item.FrameOfReferenceUID = ROOT + "1", ROOT + "2"
    item.StudyInstanceUID = ROOT + "3"
    item.Modality, item.ImageType = "CT", ["ORIGINAL", "PRIMARY", "AXIAL"]
    item.SamplesPerPixel, item.PhotometricInterpretation = 1, "MONOCHROME2"
    item.Rows, item.Columns = values.shape[-2:]
    item.BitsAllocated = values.dtype.itemsize * 8
    item.BitsStored, item.HighBit = stored, stored - 1
    item.PixelRepresentation = int(values.dtype.kind == "i")
    return item


def _ds(values: object) -> list[str]:
    return [f"{value:.12f}"[:16] for value in np.asarray(values, float).ravel()]


def _file(item: Dataset, syntax: str) -> bytes:
    item.file_meta = FileMetaDataset()
    item.file_meta.TransferSyntaxUID = syntax
    item.file_meta.MediaStorageSOPClassUID = item.SOPClassUID
    item.file_meta.MediaStorageSOPInstanceUID = item.SOPInstanceUID
    plain = {ImplicitVRLittleEndian, ExplicitVRBigEndian}
    buffer = io.BytesIO()
    # A deflated file is packed by `deflate` after it has been spoiled.
    named = ExplicitVRLittleEndian if syntax == DeflatedExplicitVRLittleEndian else syntax
    item.file_meta.TransferSyntaxUID = named if syntax in plain else ExplicitVRLittleEndian
    pydicom.dcmwrite(
        buffer,
        item,
        enforce_file_format=True,
        implicit_vr=syntax == ImplicitVRLittleEndian,
        little_endian=syntax != ExplicitVRBigEndian,
    )
    file = buffer.getvalue()
    if item["PixelData"].VR == "OB":
        # Encapsulated: the length is not given, an item says where the pixels end.
        at = file.index(b"\xe0\x7f\x10\0OB\0\0") + 8
        file = file[:at] + b"\xff" * 4 + file[at + 4 :] + b"\xfe\xff\xdd\xe0\0\0\0\0"
    return _named(file, syntax)


def _named(file: bytes, syntax: str) -> bytes:
    """The file with another transfer syntax in its meta header."""
    at = file.index(b"\2\0\x10\0UI")
    length = int.from_bytes(file[at + 6 : at + 8], "little")
    name = syntax.encode() + b"\0" * (len(syntax) % 2)
    total = int.from_bytes(file[140:144], "little") + len(name) - length
    head = file[:140] + total.to_bytes(4, "little") + file[144 : at + 6]
    return head + len(name).to_bytes(2, "little") + name + file[at + 8 + length :]


def _slices(
    number: int,
    volume: np.ndarray,
    *,
    syntax: str = ExplicitVRLittleEndian,
    stored: int = 16,
    lean: tuple[float, float] = (0.0, 0.0),
    left_handed: bool = False,
    encode: Callable[[Dataset, np.ndarray], None] | None = None,
    **attributes: object,
) -> tuple[bytes, ...]:
    """One file for each slice of `volume`, shape (K, J, I)."""
    row, column = _axes(number)
    normal = np.cross(row, column) * (-1 if left_handed else 1)
    step = 1.25 * normal + lean[0] * row + lean[1] * column
    files = []
    for k, values in enumerate(volume):
        item = _base(values, stored=stored)
        item.SOPInstanceUID = f"{ROOT}4.{k + 1}"
        item.InstanceNumber = k + 1
        item.ImagePositionPatient = _ds(np.array([-30.25, 12.5, 400.0]) + k * step)
        item.ImageOrientationPatient = _ds([row, column])
        item.PixelSpacing = ["0.7", "0.45"]
        item.SliceThickness = "1.25"
        item.RescaleSlope, item.RescaleIntercept, item.RescaleType = "1", "-1024", "HU"
        for keyword, value in attributes.items():
            setattr(item, keyword, value)
        if encode:
            encode(item, values)
        else:
            order = ">" if syntax == ExplicitVRBigEndian else "<"
            item.PixelData = values.astype(values.dtype.newbyteorder(order)).tobytes()
            item["PixelData"].VR = "OW"
        files.append(_file(item, syntax))
    return tuple(files)


def _enhanced(number: int, volume: np.ndarray, *, syntax: str, stored: int) -> tuple[bytes]:
    """The whole volume in one file, its geometry in the functional groups."""
    row, column = _axes(number)
    step = 1.25 * np.cross(row, column)
    item = _base(volume, stored=stored)
    item.SOPClassUID, item.SOPInstanceUID = "1.2.840.10008.5.1.4.1.1.2.1", ROOT + "4.1"
    item.NumberOfFrames = len(volume)
    measures, plane, values, shared = Dataset(), Dataset(), Dataset(), Dataset()
    measures.PixelSpacing, measures.SliceThickness = ["0.7", "0.45"], "1.25"
    plane.ImageOrientationPatient = _ds([row, column])
    values.RescaleSlope, values.RescaleIntercept, values.RescaleType = "1", "-1024", "HU"
    shared.PixelMeasuresSequence, shared.PlaneOrientationSequence = [measures], [plane]
    shared.PixelValueTransformationSequence = [values]
    item.SharedFunctionalGroupsSequence = [shared]
    frames = []
    for k in range(len(volume)):
        position, frame = Dataset(), Dataset()
        position.ImagePositionPatient = _ds(np.array([-30.25, 12.5, 400.0]) + k * step)
        frame.PlanePositionSequence = [position]
        frames.append(frame)
    item.PerFrameFunctionalGroupsSequence = frames
    if syntax == JPEG2000Lossless:
        _encapsulate(item, [_encoded(frame, syntax, stored) for frame in volume])
    else:
        item.PixelData = volume.tobytes()
        item["PixelData"].VR = "OW"
    return (_file(item, syntax),)


def _encapsulate(item: Dataset, streams: list[bytes]) -> None:
    item.PixelData = encapsulate(streams)
    item["PixelData"].VR = "OB"
    item["PixelData"].is_undefined_length = True


@cache
def _encoded_bytes(raw: bytes, shape: tuple[int, int], kind: str, syntax: str, stored: int):
    values = np.frombuffer(raw, kind).reshape(shape)
    item = _base(values, stored=stored)
    item.SOPInstanceUID = ROOT + "4.1"
    item.file_meta = FileMetaDataset()
    item.compress(syntax, values, generate_instance_uid=False)
    return get_frame(item.PixelData, 0, number_of_frames=1)


def _encoded(values: np.ndarray, syntax: str, stored: int) -> bytes:
    """One frame by pydicom's encoder."""
    return _encoded_bytes(values.tobytes(), values.shape, values.dtype.str, syntax, stored)


def _golden(number: int, syntax: str) -> tuple[bytes, ...]:
    """Slices that all show the known image of a codec for which there is no encoder here."""
    golden = golden_stream(syntax)
    known = pydicom.dcmread(io.BytesIO(golden.file), force=True)
    stream = get_frame(known.PixelData, 0, number_of_frames=1)
    values = np.zeros((4, known.Rows, known.Columns), f"u{known.BitsAllocated // 8}")
    return _slices(
        number,
        values,
        syntax=syntax,
        stored=known.BitsStored,
        encode=lambda item, _: _encapsulate(item, [stream]),
    )


def dicom_seeds() -> dict[str, Seed]:
    """Every seed series by name."""
    k, j, i = np.meshgrid(range(5), range(6), range(7), indexing="ij")
    coded = 1000 * k + 10 * j + i
    plain = coded.astype("<u2")
    signed = (coded - 1500).astype("<i2")
    small = (coded % 4096).astype("<u2")
    # OpenJPEG halves an image five times.
    k, j, i = np.meshgrid(range(4), range(33), range(34), indexing="ij")
    wide = ((1000 * k + 10 * j + i) % 4096).astype("<u2")
    deflated = str(DeflatedExplicitVRLittleEndian)

    def packed(syntax: str, stored: int) -> Callable[[Dataset, np.ndarray], None]:
        return lambda item, values: _encapsulate(item, [_encoded(values, syntax, stored)])

    seeds = [
        Seed("explicit", _slices(1, plain)),
        Seed(
            "signed",
            _slices(2, signed, RescaleIntercept="0", PixelPaddingValue=-1500, left_handed=True),
        ),
        Seed("implicit", _slices(3, small, syntax=ImplicitVRLittleEndian, stored=12), "<", False),
        Seed("big-endian", _slices(4, plain, syntax=ExplicitVRBigEndian), ">"),
        Seed("deflated", _slices(5, plain, syntax=deflated), deflated=True),
        Seed("tilted", _slices(6, plain, lean=(0.0, -0.37))),
        Seed("tilted-twice", _slices(7, signed, lean=(0.21, 0.16), RescaleIntercept="0")),
        Seed("fractions", _slices(8, plain, RescaleSlope="0.25", RescaleIntercept="-1000.5")),
        Seed("bytes", _slices(9, (coded % 251).astype("u1"), stored=8)),
        Seed("enhanced", _enhanced(10, plain, syntax=ExplicitVRLittleEndian, stored=16)),
    ]
    seeds += [
        Seed("rle", _slices(11, plain, syntax=RLELossless, encode=packed(RLELossless, 16))),
        Seed("rle-signed", _slices(12, signed, syntax=RLELossless, RescaleIntercept="0",
                                   encode=packed(RLELossless, 16))),
        Seed("jpeg-2000", _slices(13, wide, syntax=JPEG2000Lossless, stored=12,
                                  encode=packed(JPEG2000Lossless, 12))),
        Seed("enhanced-jpeg-2000",
             _enhanced(14, wide, syntax=JPEG2000Lossless, stored=12)),
        Seed("jpeg-lossless", _golden(15, JPEG_LOSSLESS)),
        Seed("jpeg-ls", _golden(16, JPEG_LS)),
    ]  # fmt: skip
    return {seed.name: seed for seed in seeds}


COMPRESSED = ("rle", "rle-signed", "jpeg-2000", "enhanced-jpeg-2000", "jpeg-lossless", "jpeg-ls")
