"""NIfTI headers: both forms, the units, and whether they agree."""

from __future__ import annotations

import gzip
import struct
import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, ImageRefused, InputError
from hexafix.imaging.file_geometry import (
    CORNER_TOLERANCE_MM,
    FileGeometry,
    corners_mm,
    refuse_geometry,
)

_UNITS_MM = {1: 1000.0, 2: 1.0, 3: 1e-3}
_LPS_FROM_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])
_WHERE = "NIfTI header"
_BLOCK = 1 << 20
# DT_UINT8, INT16, INT32, FLOAT32, FLOAT64, INT8, UINT16, UINT32, INT64, UINT64.
_VOXEL_BITS = {2: 8, 4: 16, 8: 32, 16: 32, 64: 64, 256: 8, 512: 16, 768: 32, 1024: 64, 1280: 64}
# The voxels follow header and extensions; float32 counts bytes exactly up to here.
_FIRST_START = 352.0
_LAST_START = float(1 << 24)


def read_nifti_header(path: Path) -> FileGeometry:
    """Geometry of a NIfTI-1 file by its own header.

    Raises
    ------
    InputError
        If it is no three-dimensional NIfTI-1 file.
    ImageRefused
        If it has no form (H07), or forms that disagree or an unknown unit (H08).
    """
    head, order = _header(path)
    dim = struct.unpack_from(order + "8h", head, 40)
    size = tuple(dim[1:4])
    if dim[0] < 3 or any(extra > 1 for extra in dim[4 : dim[0] + 1]) or min(size) < 1:
        raise InputError.of(
            "not-a-volume",
            "the image is not one three-dimensional volume",
            value=" x ".join(map(str, dim[1 : max(dim[0], 0) + 1])),
            where=_WHERE,
            next_step="store one three-dimensional volume",
        )
    unit = _UNITS_MM.get(head[123] & 7)
    if unit is None:
        raise ImageRefused(
            refuse_geometry(
                "the unit of length is not given",
                _WHERE,
                value=f"code {head[123] & 7}",
                limit="metre, millimetre or micrometre",
                hazard="H08",
            )
        )
    qform_code, sform_code = struct.unpack_from(order + "2h", head, 252)
    forms = {}
    if qform_code > 0:
        forms["qform"] = _qform(head, order)
    if sform_code > 0:
        forms["sform"] = _sform(head, order)
    if not forms:
        raise ImageRefused(refuse_geometry("neither sform nor qform is given", _WHERE))
    if not all(np.isfinite(form).all() for form in forms.values()):
        raise ImageRefused(refuse_geometry("sform or qform is not finite", _WHERE))
    affines = {name: _LPS_FROM_RAS @ _scaled(form, unit) for name, form in forms.items()}
    shape = (size[0], size[1], size[2])
    _refuse_disagreement(affines, shape)
    _refuse_truncation(path, head, order, shape)
    return FileGeometry(shape, affines.get("sform", affines.get("qform", np.eye(4))), unit)


def _refuse_disagreement(
    affines: dict[str, NDArray[np.float64]], size_ijk: tuple[int, int, int]
) -> None:
    if len(affines) < 2:
        return
    s, q = (corners_mm(size_ijk, affines[name]) for name in ("sform", "qform"))
    apart = float(np.max(np.linalg.norm(s - q, axis=1)))
    # Written so that a number that is not finite is refused too.
    if not apart <= CORNER_TOLERANCE_MM:
        raise ImageRefused(
            Fault(
                "forms-disagree",
                "sform and qform place the image differently",
                value=f"{apart:.3f} mm at a corner",
                limit=f"{CORNER_TOLERANCE_MM:g} mm",
                next_step="convert the CT again from DICOM",
                hazard="H08",
                where=_WHERE,
            )
        )


def _refuse_truncation(path: Path, head: bytes, order: str, size_ijk: tuple[int, int, int]) -> None:
    """ITK fills what is missing at the end of a NIfTI file and says nothing."""
    datatype, bits = struct.unpack_from(order + "2h", head, 70)
    if _VOXEL_BITS.get(datatype) != bits:
        raise _broken("a type of voxel that HexaFix does not read")
    (start,) = struct.unpack_from(order + "f", head, 108)
    if not (_FIRST_START <= start <= _LAST_START and start.is_integer()):
        raise _broken("the voxels begin at an impossible place")
    expected = int(start) + size_ijk[0] * size_ijk[1] * size_ijk[2] * (bits // 8)
    present = _length(path, expected)
    if present < expected:
        raise ImageRefused(
            Fault(
                "truncated-pixel-data",
                "the file ends before its last voxel",
                value=f"{present} bytes",
                limit=f"{expected} bytes",
                next_step="copy or convert the image again",
                hazard="H09",
                where=_WHERE,
            )
        )


def _length(path: Path, expected: int) -> int:
    """Length of the file; of a compressed one unpacked, with its checksum verified.

    ITK takes a damaged archive for what it can unpack. Counting stops soon after `expected`, so
    that an archive cannot inflate without end.
    """
    with path.open("rb") as plain:
        if plain.read(2) != b"\x1f\x8b":
            return path.stat().st_size
    counted = 0
    try:
        with gzip.open(path) as file:
            while counted < expected + _BLOCK and (block := file.read(_BLOCK)):
                counted += len(block)
    except (EOFError, zlib.error, gzip.BadGzipFile):
        raise _broken("compressed data are damaged") from None
    return counted


def _scaled(form: NDArray[np.float64], unit: float) -> NDArray[np.float64]:
    scaled = form.copy()
    scaled[:3] *= unit
    return scaled


def _sform(head: bytes, order: str) -> NDArray[np.float64]:
    rows = np.array(struct.unpack_from(order + "12f", head, 280)).reshape(3, 4)
    return np.vstack([rows, [0.0, 0.0, 0.0, 1.0]])


def _qform(head: bytes, order: str) -> NDArray[np.float64]:
    """The affine of the unit quaternion; pixdim[0] carries the handedness."""
    pixdim = struct.unpack_from(order + "8f", head, 76)
    b, c, d, *offset = struct.unpack_from(order + "6f", head, 256)
    a = np.sqrt(max(0.0, 1.0 - (b * b + c * c + d * d)))
    rotation = np.array(
        [
            [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
            [2 * (b * c + a * d), a * a + c * c - b * b - d * d, 2 * (c * d - a * b)],
            [2 * (b * d - a * c), 2 * (c * d + a * b), a * a + d * d - c * c - b * b],
        ]
    )
    handed = -1.0 if pixdim[0] < 0 else 1.0
    form = np.eye(4)
    form[:3, :3] = rotation * np.array([pixdim[1], pixdim[2], handed * pixdim[3]])
    form[:3, 3] = offset
    return form


def _header(path: Path) -> tuple[bytes, str]:
    try:
        with path.open("rb") as plain:
            packed = plain.read(2) == b"\x1f\x8b"
        with gzip.open(path) if packed else path.open("rb") as file:
            head = file.read(352)
    except (OSError, EOFError, zlib.error):
        raise _broken("compressed data are damaged") from None
    if len(head) >= 348:
        for order in "<>":
            if struct.unpack_from(order + "i", head)[0] == 348:
                if head[344:348] == b"n+1\0":
                    return head, order
                raise _broken("only single-file NIfTI-1 is read")
    raise _broken("header length is not 348")


def _broken(what: str) -> InputError:
    return InputError.of(
        "bad-nifti",
        "the NIfTI header cannot be read",
        value=what,
        where=_WHERE,
        next_step="store the image again as .nii or .nii.gz",
    )
