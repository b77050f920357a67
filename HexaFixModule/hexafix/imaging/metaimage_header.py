"""MetaImage headers: offset, directions, and where the voxels lie."""

from __future__ import annotations

import math
import re
import zlib
from pathlib import Path

import numpy as np

from hexafix.errors import ImageRefused, InputError
from hexafix.imaging.file_geometry import (
    FileGeometry,
    detached_fault,
    outside_folder,
    refuse_geometry,
    require_three_dimensions,
)

_MAX_HEADER = 1 << 16
_BLOCK = 1 << 20
_LARGEST_SIDE = 1e9
_VOXEL_BYTES = {
    "MET_CHAR": 1, "MET_UCHAR": 1, "MET_SHORT": 2, "MET_USHORT": 2, "MET_INT": 4, "MET_UINT": 4,
    "MET_LONG": 8, "MET_ULONG": 8, "MET_LONG_LONG": 8, "MET_ULONG_LONG": 8, "MET_FLOAT": 4,
    "MET_DOUBLE": 8,
}  # fmt: skip
# What decides place and values; ITK knows a field only in this very spelling.
_SPELLINGS = {
    name.lower(): name
    for name in (
        *("NDims", "DimSize", "ElementSpacing", "Offset", "Position", "Origin", "TransformMatrix"),
        *("Rotation", "Orientation", "DistanceUnits", "CompressedData", "CompressedDataSize"),
        *("ElementType", "ElementDataFile", "BinaryData", "BinaryDataByteOrderMSB", "HeaderSize"),
        *("ElementByteOrderMSB", "ElementNumberOfChannels", "ObjectType"),
    )
}
_BYTE_ORDERS = ("binarydatabyteordermsb", "elementbyteordermsb")
_UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3}


def read_metaimage_header(path: Path) -> FileGeometry:
    """Geometry of a MetaImage file by its own header.

    The world of a MetaImage is LPS by convention of ITK; AnatomicalOrientation names the direction
    of the axes for people and does not move anything.

    Raises
    ------
    InputError
        If it is no three-dimensional MetaImage file.
    ImageRefused
        If position or directions are missing (H07) or the data lie outside its folder (H50).
    """
    fields = _fields(path)
    where = "MetaImage header"
    data_file = fields.get("elementdatafile", "")
    if data_file.upper().startswith("LIST"):
        raise ImageRefused(detached_fault(where))
    local = data_file.upper() == "LOCAL"
    if not local and outside_folder(path, data_file):
        raise ImageRefused(detached_fault(where))
    if not local and not (path.parent / data_file).is_file():
        # A FIFO would keep its reader waiting, too.
        raise _broken("ElementDataFile is not there, or no file")
    size = _numbers(fields, ("dimsize",), where)
    require_three_dimensions(len(size), where)
    spacing = _numbers(fields, ("elementspacing",), where)
    origin = _numbers(fields, ("offset", "position", "origin"), where)
    axes = _numbers(fields, ("transformmatrix", "rotation", "orientation"), where)
    if (len(spacing), len(origin), len(axes)) != (3, 3, 9):
        raise _broken("offset, spacing or matrix has the wrong length")
    unit = _UNITS_MM.get(fields.get("distanceunits", "mm").strip().lower())
    if unit is None:
        raise ImageRefused(
            refuse_geometry(
                "the unit of length is not one that HexaFix knows",
                where,
                limit="mm, cm, m or um",
                hazard="H08",
            )
        )
    if not all(1 <= side <= _LARGEST_SIDE and side.is_integer() for side in size):
        raise _broken("DimSize")
    shape = (int(size[0]), int(size[1]), int(size[2]))
    if fields.get("binarydata", "false")[:1].lower() not in ("t", "1", "y"):
        raise _broken("voxels written as text")
    packed = fields.get("compresseddata", "false")[:1].lower() in ("t", "1", "y")
    if (local or packed) and fields.get("headersize", "0") != "0":
        raise _broken("voxels behind a header of their own")
    orders = [fields[key][:1].lower() for key in _BYTE_ORDERS if key in fields]
    if len(set(orders)) > 1:
        raise _broken("two byte orders")
    if packed:
        _verify_packed(path, data_file, shape, fields)
    affine = np.eye(4)
    # Each run of three numbers is the direction of one index axis.
    affine[:3, :3] = np.array(axes).reshape(3, 3).T * np.array(spacing) * unit
    affine[:3, 3] = np.array(origin) * unit
    return FileGeometry(shape, affine, unit)


def _verify_packed(
    path: Path, data_file: str, size_ijk: tuple[int, int, int], fields: dict[str, str]
) -> None:
    """Unpack in bounded memory, verify checksum and length: ITK takes data as they come."""
    local = data_file.upper() == "LOCAL"
    voxel_type = fields.get("elementtype", "")
    if voxel_type not in _VOXEL_BYTES:
        raise _broken("a type of voxel that HexaFix does not read")
    expected = math.prod(size_ijk) * _VOXEL_BYTES[voxel_type]
    # 47: the widest window, zlib or gzip by their headers.
    inflater, counted, taken = zlib.decompressobj(47), 0, 0
    with (path if local else path.parent / data_file).open("rb") as file:
        if local:
            head = file.read(_MAX_HEADER)
            end = re.search(rb"ElementDataFile *= *LOCAL *\r?\n", head, re.IGNORECASE)
            file.seek(end.end() if end else 0)
        try:
            while not inflater.eof and counted <= expected:
                data = inflater.unconsumed_tail
                if not data:
                    data = file.read(_BLOCK)
                    taken += len(data)
                if not data:
                    break
                counted += len(inflater.decompress(data, _BLOCK))
        except zlib.error:
            raise _broken("compressed data are damaged") from None
    taken -= len(inflater.unused_data)
    # ITK takes as many bytes as CompressedDataSize says, and without it any.
    said = fields.get("compresseddatasize", "")
    if not inflater.eof or counted != expected or said != str(taken):
        raise _broken("compressed data are damaged or of another length")


def _numbers(fields: dict[str, str], names: tuple[str, ...], where: str) -> list[float]:
    given = [fields[name] for name in names if name in fields]
    if not given:
        raise ImageRefused(refuse_geometry(f"the field {names[0]} is missing", where))
    if len(set(given)) > 1:
        raise ImageRefused(refuse_geometry(f"the field {names[0]} contradicts itself", where))
    try:
        return [float(part) for part in given[0].split()]
    except ValueError:
        raise _broken(names[0]) from None


def _fields(path: Path) -> dict[str, str]:
    with path.open("rb") as file:
        head = file.read(_MAX_HEADER).decode("latin-1")
    fields: dict[str, str] = {}
    for line in head.splitlines():
        name, found, value = line.partition("=")
        if not found:
            break
        name = name.strip()
        if _SPELLINGS.get(name.lower(), name) != name:
            raise _broken("a field with capital letters in other places")
        name = name.lower()
        if name in fields:
            raise _broken("a field given twice")
        fields[name] = value.strip()
        if name == "elementdatafile":
            return fields
    raise _broken("no ElementDataFile")


def _broken(what: str) -> InputError:
    return InputError.of(
        "bad-metaimage",
        "the MetaImage header cannot be read",
        value=what,
        where="MetaImage header",
        next_step="store the image again",
    )
