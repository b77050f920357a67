"""The golden grid as NRRD, NIfTI and MetaImage: what SimpleITK must place right first (H01, H54).

A child process that reads a user's file reads one of these before it. The bytes are written by
`struct` and by hand, big-endian where the format allows it; the grid is left-handed, which
SimpleITK 2.4.0 to 2.5.6 mirrored in one of their readers.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from itertools import product
from math import inf, sqrt
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import ImageRefused, SelfTestFailed
from hexafix.imaging.golden_grid import (
    AGAINST,
    BETWEEN_COLUMNS,
    BETWEEN_ROWS,
    BETWEEN_SLICES,
    COLUMN,
    NORMAL,
    ORIGIN,
    PLACE_MM,
    ROW,
    SIZE,
    codes_of_slice,
    worst_misplacement_mm,
)
from hexafix.libraries import untrusted

_DOWN = tuple(-value for value in NORMAL)
_STEPS = (
    tuple(BETWEEN_COLUMNS * value for value in ROW),
    tuple(BETWEEN_ROWS * value for value in COLUMN),
    AGAINST,
)
"""From voxel to voxel along i, j and k, LPS mm."""


def _words(order: str) -> bytes:
    codes = [value for k in range(SIZE[2]) for value in codes_of_slice(k)]
    return struct.pack(f"{order}{len(codes)}h", *codes)


def _nrrd() -> bytes:
    vectors = " ".join("(" + ",".join(f"{v:.10g}" for v in step) + ")" for step in _STEPS)
    lines = [
        "NRRD0004",
        "type: short",
        "dimension: 3",
        "space: left-posterior-superior",
        "sizes: " + " ".join(map(str, SIZE)),
        "space directions: " + vectors,
        "kinds: domain domain domain",
        "endian: big",
        "encoding: raw",
        "space origin: (" + ",".join(map(str, ORIGIN)) + ")",
        "\n",
    ]
    return "\n".join(lines).encode() + _words(">")


def _metaimage() -> bytes:
    lines = [
        "ObjectType = Image",
        "NDims = 3",
        "BinaryData = True",
        "BinaryDataByteOrderMSB = True",
        "CompressedData = False",
        "TransformMatrix = " + " ".join(f"{v:.10g}" for v in (*ROW, *COLUMN, *_DOWN)),
        "Offset = " + " ".join(map(str, ORIGIN)),
        "CenterOfRotation = 0 0 0",
        f"ElementSpacing = {BETWEEN_COLUMNS} {BETWEEN_ROWS} {BETWEEN_SLICES}",
        "DimSize = " + " ".join(map(str, SIZE)),
        "ElementType = MET_SHORT",
        "ElementDataFile = LOCAL",
        "",
    ]
    return "\n".join(lines).encode() + _words(">")


def _nifti() -> bytes:
    """Little-endian NIfTI-1: a header of 348 bytes, four of extension, the voxels; RAS."""
    # RAS turns the signs of x and y; the quaternion is of (i, j, -k), which is right-handed.
    columns = [(-x, -y, z) for x, y, z in (ROW, COLUMN, NORMAL)]
    a = sqrt(1.0 + columns[0][0] + columns[1][1] + columns[2][2]) / 2.0
    quaternion = (
        (columns[1][2] - columns[2][1]) / (4.0 * a),
        (columns[2][0] - columns[0][2]) / (4.0 * a),
        (columns[0][1] - columns[1][0]) / (4.0 * a),
    )
    origin = (-ORIGIN[0], -ORIGIN[1], ORIGIN[2])
    steps = [(-x, -y, z) for x, y, z in _STEPS]
    form = [v for r in range(3) for v in (*(step[r] for step in steps), origin[r])]
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 3, *SIZE, 1, 1, 1, 1)
    struct.pack_into("<2h", header, 70, 4, 16)
    pitch = (BETWEEN_COLUMNS, BETWEEN_ROWS, BETWEEN_SLICES)
    struct.pack_into("<8f", header, 76, -1.0, *pitch, 1.0, 1.0, 1.0, 1.0)
    struct.pack_into("<3f", header, 108, 352.0, 1.0, 0.0)
    header[123] = 2
    struct.pack_into("<2h", header, 252, 1, 1)
    struct.pack_into("<18f", header, 256, *quaternion, *origin, *form)
    header[344:348] = b"n+1\0"
    return bytes(header) + _words("<")


_FORMATS: dict[str, tuple[str, Callable[[], bytes]]] = {
    "NrrdImageIO": ("nrrd", _nrrd),
    "NiftiImageIO": ("nii", _nifti),
    "MetaImageIO": ("mha", _metaimage),
}
READERS = tuple(_FORMATS)
"""Names of ITK's readers that a golden file exists for."""


def golden_image_file(reader: str) -> tuple[str, bytes]:
    """Suffix and bytes of the golden file for one of ITK's readers."""
    suffix, write = _FORMATS[reader]
    return suffix, write()


class ItkProof:
    """A golden file on disk for one of ITK's readers.

    Use it as a context manager, which removes the file.

    Parameters
    ----------
    reader : str
        Name of ITK's ImageIO.
    """

    def __init__(self, reader: str) -> None:
        self._reader = reader
        self._folder = TemporaryDirectory(prefix="hexafix-golden-")

    def __enter__(self) -> ItkProof:
        suffix, content = golden_image_file(self._reader)
        self._path = Path(self._folder.name, f"golden.{suffix}")
        self._path.write_bytes(content)
        return self

    def __exit__(self, *_: object) -> None:
        self._folder.cleanup()

    @property
    def request(self) -> list[str]:
        """What to ask the child for first: path and reader."""
        return [str(self._path), self._reader]

    def check(self, results: Iterator[tuple[dict[str, Any], NDArray]]) -> None:
        """Take the golden image off the child's results and compare it.

        Raises
        ------
        SelfTestFailed
            If it is not what it must be.
        """
        try:
            about, voxels = next(results, ({}, np.empty(0)))
            worst = _worst_mm(about, voxels)
            found = f"{worst:.4g} mm" if worst < inf else "other voxels"
        except ImageRefused as refused:
            worst, found = inf, str(refused.faults[0].value or refused.faults[0].code)
        if not worst <= PLACE_MM:
            raise SelfTestFailed(
                untrusted(
                    f"image files ({self._reader})",
                    "SimpleITK",
                    expected=f"every voxel within {PLACE_MM:g} mm of its place",
                    found=found,
                )
            )


def _worst_mm(about: dict[str, Any], voxels: NDArray) -> float:
    """How far SimpleITK misplaces the worst voxel, mm; its affine is applied in plain numbers."""
    if voxels.shape != SIZE[::-1] or about.get("warnings"):
        return inf
    values, affine = voxels.tolist(), about["affine"]
    return worst_misplacement_mm(
        (
            [row[0] * i + row[1] * j + row[2] * k + row[3] for row in affine[:3]],
            values[k][j][i],
        )
        for k, j, i in product(*map(range, reversed(SIZE)))
    )
