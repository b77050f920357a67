"""The header of one DICOM file: what the geometry, the grey values and the choice of series need.

Only the attributes listed here are ever looked at. What names the patient is read for one purpose,
to see whether all slices are of one patient: only a keyed hash of it is kept, in memory.
"""

from __future__ import annotations

import hashlib
import secrets
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO, cast

from pydicom import dcmread
from pydicom.dataset import Dataset, FileDataset
from pydicom.errors import InvalidDicomError
from pydicom.tag import Tag

from hexafix.imaging.header_file import (
    BoundedFile,
    NotAnImage,
    inflate,
    open_regular,
)

IMPLICIT_LITTLE = "1.2.840.10008.1.2"
EXPLICIT_LITTLE = "1.2.840.10008.1.2.1"
EXPLICIT_BIG = "1.2.840.10008.1.2.2"
DEFLATED = "1.2.840.10008.1.2.1.99"
PLAIN_SYNTAXES = frozenset({IMPLICIT_LITTLE, EXPLICIT_LITTLE, EXPLICIT_BIG})
MEDIA_DIRECTORY = "1.2.840.10008.1.3.10"

_KEYWORDS = (
    *("ImageType", "Modality", "SOPClassUID", "SOPInstanceUID", "SeriesInstanceUID"),
    *("FrameOfReferenceUID", "ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing"),
    *("SliceThickness", "PatientPosition", "BodyPartExamined", "Laterality", "ImageLaterality"),
    *("Rows", "Columns", "NumberOfFrames", "SamplesPerPixel", "BitsAllocated", "BitsStored"),
    *("HighBit", "PixelRepresentation", "PixelPaddingValue", "PixelPaddingRangeLimit"),
    *("RescaleSlope", "RescaleIntercept", "RescaleType", "ModalityLUTSequence"),
    *("PhotometricInterpretation", "LossyImageCompression", "ExtendedOffsetTable"),
    "SharedFunctionalGroupsSequence",
    *("PerFrameFunctionalGroupsSequence", "PatientName", "PatientID", "PatientBirthDate"),
)
_TAGS = [Tag(keyword) for keyword in _KEYWORDS]
_TAG = dict(zip(_KEYWORDS, _TAGS, strict=True))
_PIXEL_DATA = 0x7FE00010
_UNDEFINED = 0xFFFFFFFF
# None: implicit. With any other, the header is damaged or its writer meant something else.
_DECIMAL_VRS = frozenset({None, "UN", "DS"})
_WORD_VRS = frozenset({None, "UN", "US", "SS"})
_SIGNED: dict[int | None, bool] = {0: False, 1: True}
_ITEMS = (b"\xfe\xff\x00\xe0", b"\xff\xfe\xe0\x00")
_MAX_ITEMS = 400_000
# Far above any CT: 8192 x 8192 pixels, and a frame for each 0.1 mm of a limb.
_MAX_PIXELS = 1 << 26
_MAX_FRAMES = 20_000
# Beyond a kilometre there is no patient, and no scanner writes underscores as Python allows them.
_LARGEST_MM = 1e6
# A new key in every process: outside of it the hashes of patients tell nothing.
_PATIENT_KEY = secrets.token_bytes(16)


@dataclass(frozen=True, slots=True)
class PixelFormat:
    """How the pixels of a file are stored and become Hounsfield units.

    Attributes
    ----------
    transfer_syntax : str
    bits_allocated, bits_stored, high_bit, samples : int
        0, 0 and -1 for the first three where the header lacks them.
    signed : bool or None
        None when the header does not say.
    photometric : str
    extended_offsets : bool
        Whether an extended offset table places the frames.
    padding, padding_limit : int or None
        PixelPaddingValue and PixelPaddingRangeLimit, reduced to `bits_allocated` bits.
    offset, length : int or None
        Where the pixel bytes lie in the file, or in what a deflated file inflates to; length None
        when they are encapsulated, both None when there are no pixels.
    available : int
        Bytes present from `offset` to the end of the file.
    """

    transfer_syntax: str
    bits_allocated: int
    bits_stored: int
    high_bit: int
    signed: bool | None
    photometric: str
    extended_offsets: bool
    samples: int
    padding: int | None
    padding_limit: int | None
    offset: int | None
    length: int | None
    available: int


@dataclass(frozen=True, slots=True)
class SliceHeader:
    """One image slice: a file, or one frame of a multi-frame file.

    Attributes
    ----------
    path : Path
    frame, frames : int
        Index of the frame and number of frames in the file.
    position_mm : tuple of 3 floats or None
        ImagePositionPatient, LPS, mm.
    orientation : tuple of 6 floats or None
        ImageOrientationPatient: direction along a row, then along a column.
    pixel_spacing_mm : tuple of 2 floats or None
        PixelSpacing: between rows (along j) first, then between columns (along i).
    slope, intercept : float or None
        Rescale to HU.
    patient : bytes
        Keyed hash of name, id and birth date, good for comparing slices within this process only.
    """

    path: Path
    frame: int
    frames: int
    series_uid: str
    frame_of_reference: str
    sop_uid: str
    sop_class: str
    modality: str
    image_type: tuple[str, ...]
    rows: int
    columns: int
    position_mm: tuple[float, ...] | None
    orientation: tuple[float, ...] | None
    pixel_spacing_mm: tuple[float, ...] | None
    slope: float | None
    intercept: float | None
    rescale_type: str | None
    modality_lut: bool
    lossy: bool
    thickness_mm: float | None
    laterality: str | None
    body_part: str | None
    patient_position: str | None
    pixels: PixelFormat
    patient: bytes = b""


def read_headers(path: Path) -> list[SliceHeader]:
    """Headers of all frames of one DICOM file.

    Raises
    ------
    NotAnImage
        If the file is not DICOM, cannot be parsed or holds no image; the text has the reason.
    """
    try:
        file, size = open_regular(path)
        with file:
            head = file.read(1024)
            if head[128:132] != b"DICM":
                raise NotAnImage("not DICOM (no preamble)")
            if DEFLATED.encode() in head:
                plain, size = inflate(file)
                return _parse(path, plain, size, DEFLATED)
            file.seek(0)
            return _parse(path, file, size)
    except NotAnImage:
        raise
    except OSError as error:
        # pydicom raises OSError too, with the tag it wanted: only our wording goes out.
        reason = "DICOM header ends early or is corrupt"
        raise NotAnImage("file cannot be opened" if error.errno else reason) from None
    except (InvalidDicomError, zlib.error):
        raise NotAnImage("DICOM header ends early or is corrupt") from None
    except Exception as error:
        # pydicom has no family of errors: a damaged header raises whatever it happens to meet.
        raise NotAnImage("DICOM header is corrupt") from error


def _parse(path: Path, file: BinaryIO, size: int, syntax: str | None = None) -> list[SliceHeader]:
    """The headers of an open file; `syntax` where it is not the one that the file names."""
    bounded = cast(BinaryIO, BoundedFile(file))
    dataset = dcmread(bounded, stop_before_pixels=True, specific_tags=_TAGS)
    syntax = syntax or str(dataset.file_meta.get("TransferSyntaxUID", "") or "")
    if not syntax:
        raise NotAnImage("DICOM without a transfer syntax")
    offset, length = _locate_pixels(bounded, dataset)
    rows, columns = _integer(dataset, "Rows"), _integer(dataset, "Columns")
    if not rows or not columns:
        if dataset.file_meta.get("MediaStorageSOPClassUID") == MEDIA_DIRECTORY:
            raise NotAnImage("DICOM media directory")
        raise NotAnImage("DICOM object without an image")
    if rows * columns > _MAX_PIXELS:
        raise NotAnImage("DICOM image with more pixels than any CT slice")
    counted = _text(dataset, "NumberOfFrames") or "1"
    frames = int(counted) if counted.isascii() and counted.isdigit() else 0
    if not 1 <= frames <= _MAX_FRAMES:
        raise NotAnImage("DICOM image with an impossible number of frames")
    bits = _integer(dataset, "BitsAllocated") or 0
    high = _integer(dataset, "HighBit")
    pixels = PixelFormat(
        transfer_syntax=syntax,
        bits_allocated=bits,
        bits_stored=_integer(dataset, "BitsStored") or 0,
        high_bit=-1 if high is None else high,
        signed=_SIGNED.get(_integer(dataset, "PixelRepresentation")),
        photometric=_text(dataset, "PhotometricInterpretation") or "",
        extended_offsets=_raw(dataset, "ExtendedOffsetTable") is not None,
        samples=_integer(dataset, "SamplesPerPixel") or 1,
        padding=_integer(dataset, "PixelPaddingValue"),
        padding_limit=_integer(dataset, "PixelPaddingRangeLimit"),
        offset=offset,
        length=length,
        available=0 if offset is None else size - offset,
    )
    common = _common(dataset, path, frames, rows, columns, pixels)
    return _frames(dataset, common, frames)


def _locate_pixels(file: BinaryIO, dataset: FileDataset) -> tuple[int | None, int | None]:
    """Offset and length of the pixel bytes; the file stands at their element after the parse."""
    start = file.tell()
    head = file.read(12)
    little = bool(dataset.original_encoding[1])
    order = "<" if little else ">"
    if len(head) < 8:
        return None, None
    group, element = struct.unpack_from(order + "HH", head)
    if (group << 16 | element) != _PIXEL_DATA:
        return None, None
    if dataset.original_encoding[0]:
        length, data = struct.unpack_from(order + "L", head, 4)[0], start + 8
    elif len(head) == 12 and head[4:6] in (b"OW", b"OB"):
        length, data = struct.unpack_from(order + "L", head, 8)[0], start + 12
    else:
        return None, None
    return data, None if length == _UNDEFINED else length


def _raw(dataset: Dataset, keyword: str) -> Any:
    """The element's value; raw bytes where pydicom has not converted it, None where absent."""
    element = cast(Any, dataset.get_item(_TAG[keyword]))
    return None if element is None else element.value


def _text(dataset: Dataset, keyword: str) -> str | None:
    """A string attribute, None where absent or empty.

    Read from the raw bytes: code strings, decimals and UIDs are ASCII, and pydicom's conversion of
    each would cost more than the whole rest of the header.
    """
    return _as_text(_raw(dataset, keyword))


def _as_text(value: Any) -> str | None:
    if value is None:
        return None
    if isinstance(value, bytes):
        text = value.decode("ascii", "replace")
    elif isinstance(value, Sequence) and not isinstance(value, str):
        text = "\\".join(str(item) for item in value)
    else:
        text = str(value)
    return text.strip(" \0") or None


def _numbers(dataset: Dataset, keyword: str, count: int) -> tuple[float, ...] | None:
    """`count` plausible decimals, None where the attribute is absent, incomplete or no number."""
    element = cast(Any, dataset.get_item(_TAG[keyword]))
    if element is None or element.VR not in _DECIMAL_VRS:
        return None
    text = _as_text(element.value)
    if text is None or "_" in text:  # Python would read 1_0 as ten
        return None
    try:
        values = tuple(float(part) for part in text.split("\\"))
    except ValueError:
        return None
    if len(values) != count or not all(-_LARGEST_MM <= value <= _LARGEST_MM for value in values):
        return None
    return values


def _number(dataset: Dataset, keyword: str) -> float | None:
    values = _numbers(dataset, keyword, 1)
    return values[0] if values else None


def _integer(dataset: Dataset, keyword: str) -> int | None:
    """A US or SS attribute as its unsigned bit pattern."""
    element = cast(Any, dataset.get_item(_TAG[keyword]))
    if element is None or element.VR not in _WORD_VRS:
        return None
    if isinstance(element.value, bytes):
        if len(element.value) != 2:
            return None
        return int.from_bytes(element.value, "little" if element.is_little_endian else "big")
    return None if element.value is None else int(element.value)


def _common(
    dataset: FileDataset, path: Path, frames: int, rows: int, columns: int, pixels: PixelFormat
) -> dict[str, Any]:
    """The fields of `SliceHeader` as the top level of the data set gives them."""
    lossy_flag = _text(dataset, "LossyImageCompression")
    return {
        "path": path,
        "frames": frames,
        "series_uid": _text(dataset, "SeriesInstanceUID") or "",
        "frame_of_reference": _text(dataset, "FrameOfReferenceUID") or "",
        "sop_uid": _text(dataset, "SOPInstanceUID") or "",
        "sop_class": _text(dataset, "SOPClassUID") or "",
        "modality": _text(dataset, "Modality") or "",
        "image_type": tuple(
            part.strip() for part in (_text(dataset, "ImageType") or "").split("\\")
        ),
        "rows": rows,
        "columns": columns,
        "position_mm": _numbers(dataset, "ImagePositionPatient", 3),
        "orientation": _numbers(dataset, "ImageOrientationPatient", 6),
        "pixel_spacing_mm": _numbers(dataset, "PixelSpacing", 2),
        "slope": _number(dataset, "RescaleSlope"),
        "intercept": _number(dataset, "RescaleIntercept"),
        "rescale_type": _text(dataset, "RescaleType"),
        "modality_lut": _TAG["ModalityLUTSequence"] in dataset,
        "lossy": lossy_flag == "01",
        "thickness_mm": _number(dataset, "SliceThickness"),
        "laterality": _text(dataset, "ImageLaterality") or _text(dataset, "Laterality"),
        "body_part": _text(dataset, "BodyPartExamined"),
        "patient_position": _text(dataset, "PatientPosition"),
        "pixels": pixels,
        "patient": _patient(dataset),
    }


def _patient(dataset: Dataset) -> bytes:
    """Keyed hash of the identity, blind to padding, case and empty name components."""
    parts = []
    for keyword in ("PatientName", "PatientID", "PatientBirthDate"):
        value = _raw(dataset, keyword)
        raw = value if isinstance(value, bytes) else str(value or "").encode()
        parts.append(raw.strip(b" \0").rstrip(b"^ ").upper())
    return hashlib.blake2b(b"\n".join(parts), key=_PATIENT_KEY, digest_size=16).digest()


def _frames(dataset: FileDataset, common: dict[str, Any], frames: int) -> list[SliceHeader]:
    if _TAG["PerFrameFunctionalGroupsSequence"] not in dataset:
        if frames > 1:
            # One position at the top level cannot place several frames.
            common |= {"position_mm": None}
        return [SliceHeader(frame=index, **common) for index in range(frames)]
    for keyword in ("PerFrameFunctionalGroupsSequence", "SharedFunctionalGroupsSequence"):
        raw = _raw(dataset, keyword)
        if isinstance(raw, bytes) and sum(map(raw.count, _ITEMS)) > _MAX_ITEMS:
            raise NotAnImage("DICOM with more functional groups than any CT")
    per_frame = list(dataset.PerFrameFunctionalGroupsSequence)
    shared = list(dataset.get("SharedFunctionalGroupsSequence") or [])
    if len(per_frame) != frames:
        raise NotAnImage("multi-frame DICOM whose functional groups do not match its frames")
    return [
        SliceHeader(frame=index, **(common | _functional_groups([item, *shared])))
        for index, item in enumerate(per_frame)
    ]


def _functional_groups(groups: list[Dataset]) -> dict[str, Any]:
    """Geometry and rescale of one frame: its own functional group wins over the shared one."""

    def find(macro: str) -> Dataset:
        for group in groups:
            items = group.get(macro)
            if items:
                return items[0]
        return Dataset()

    measures, transform = find("PixelMeasuresSequence"), find("PixelValueTransformationSequence")
    found: dict[str, Any] = {
        "position_mm": _numbers(find("PlanePositionSequence"), "ImagePositionPatient", 3),
        "orientation": _numbers(find("PlaneOrientationSequence"), "ImageOrientationPatient", 6),
        "pixel_spacing_mm": _numbers(measures, "PixelSpacing", 2),
        "slope": _number(transform, "RescaleSlope"),
        "intercept": _number(transform, "RescaleIntercept"),
        "rescale_type": _text(transform, "RescaleType"),
        "thickness_mm": _number(measures, "SliceThickness"),
    }
    anatomy = find("FrameAnatomySequence").get("FrameLaterality")
    if anatomy:
        found["laterality"] = str(anatomy)
    return found
