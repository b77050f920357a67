"""Tiny DICOM series of known places and values, read as the chain reads any (H01, H02, H10).

Their bytes come from our own writer and their answers from the standard's formula in plain Python
numbers: a fault of pydicom or NumPy cannot cancel itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import product
from math import inf
from pathlib import Path
from tempfile import TemporaryDirectory

from hexafix.imaging import Volume, read_volume
from hexafix.imaging.golden_dicom import CT_STORAGE, UID_ROOT, Element, GoldenPixels, dicom_file
from hexafix.imaging.golden_grid import (
    BETWEEN_COLUMNS,
    BETWEEN_ROWS,
    BETWEEN_SLICES,
    COLUMN,
    NORMAL,
    ORIGIN,
    PLACE_MM,
    ROW,
    SIZE,
    Point,
    codes_of_slice,
    place,
    worst_misplacement_mm,
)
from hexafix.selftest.check import Check

EXPLICIT = "1.2.840.10008.1.2.1"
IMPLICIT = "1.2.840.10008.1.2"
BIG_ENDIAN = "1.2.840.10008.1.2.2"

LEAN: Point = tuple(  # type: ignore[assignment]
    BETWEEN_SLICES * n + 0.2 * i + 0.45 * j for n, i, j in zip(NORMAL, ROW, COLUMN, strict=True)
)
"""From slice to slice of a tilted gantry, 21.5 degrees aside of the normal, mm."""

TILTED_SIZE = (8, 9, 6)
HU_PER_MM = 40.0
SLOPE: Point = (0.36, 0.48, 0.8)
"""Direction in which the ramp of the tilted series rises, LPS."""

RAMP_HU = 2.0
"""Storing and resampling round by half a unit each; 2 HU are 0.05 mm."""


@dataclass(frozen=True)
class Grey:
    """One way to store grey values.

    Attributes
    ----------
    syntax : str
    signed : bool
    bits : int
        Stored of 16.
    slope, intercept : float
    stored : tuple of int
    hu : tuple of float
        The known answer, written out.
    """

    syntax: str
    signed: bool
    bits: int
    slope: float
    intercept: float
    stored: tuple[int, ...]
    hu: tuple[float, ...]


GREYS = (
    Grey(EXPLICIT, False, 12, 1, -1024, (0, 24, 1024, 4095), (-1024, -1000, 0, 3071)),
    Grey(EXPLICIT, True, 12, 1, 0, (-1024, -1000, 1, 2047), (-1024, -1000, 1, 2047)),
    Grey(IMPLICIT, True, 16, 2, -10, (-500, -1, 5, 1500), (-1010, -12, 0, 2990)),
    Grey(BIG_ENDIAN, False, 16, 1, -8192, (7168, 8191, 8192, 11263), (-1024, -1, 0, 3071)),
    Grey(
        EXPLICIT, False, 16, 0.5, -1000.25, (0, 1, 2001, 8000), (-1000.25, -999.75, 0.25, 2999.75)
    ),
)


def image_checks() -> list[Check]:
    """Places, tilt and grey values of uncompressed DICOM."""
    return [
        Check(
            "orientation", "pydicom", f"every voxel within {PLACE_MM:g} mm of its place", _places
        ),
        Check("gantry tilt", "scipy", f"a linear ramp right to {RAMP_HU:g} HU", _tilt),
        Check("Hounsfield units", "numpy", "grey values of five encodings", _greys),
    ]


def _places() -> str:
    """Descending slices, SpacingBetweenSlices negative: every voxel where the standard puts it."""
    slices = (
        [
            *plane_elements(k, place(0, 0, k)),
            (0x00180088, "DS", (-BETWEEN_SLICES,)),
            *rescale_elements(1, 0),
        ]
        for k in range(SIZE[2])
    )
    volume = _read(
        (item, GoldenPixels(codes_of_slice(k), SIZE[1], SIZE[0])) for k, item in enumerate(slices)
    )
    if volume.size_ijk != SIZE:
        return f"{' x '.join(map(str, volume.size_ijk))} voxels"
    worst = worst_misplacement_mm(_voxels(volume))
    back = volume.ijk_from_lps(ORIGIN).tolist()
    away = max(abs(v - w) for v, w in zip(back, (0, 0, SIZE[2] - 1), strict=True))
    if worst == inf:
        return "other voxels"
    worst = max(worst, away * BETWEEN_SLICES)
    return f"{worst:.4g} mm" if not worst <= PLACE_MM else ""


def _tilt() -> str:
    """Slices sheared to both sides: a ramp over the patient is still that ramp."""
    size = TILTED_SIZE

    def slices() -> Iterable[tuple[list[Element], GoldenPixels]]:
        for k in range(size[2]):
            values = [
                round(_ramp_hu(place(i, j, k, LEAN)))
                for j, i in product(range(size[1]), range(size[0]))
            ]
            pixels = GoldenPixels(values, size[1], size[0], signed=True)
            lie = (0x00181120, "DS", (-12.0,))
            yield [*plane_elements(k, place(0, 0, k, LEAN)), lie, *rescale_elements(1, 0)], pixels

    compared, worst = 0, 0.0
    for where, value in _voxels(_read(slices())):
        if _acquired(where, size):
            compared += 1
            worst = max(worst, abs(value - _ramp_hu(where)))
    least = (size[0] - 1) * (size[1] - 1) * size[2]
    if compared < least:
        return f"{compared} voxels in the field of view instead of {least} or more"
    return f"{worst:.4g} HU" if not worst <= RAMP_HU else ""


def _ramp_hu(where: Point) -> float:
    return 300.0 + HU_PER_MM * _dot(SLOPE, _from_origin(where))


def _acquired(where: Point, size: tuple[int, int, int]) -> bool:
    """Whether a place lies between the voxels of the tilted series."""
    offset = _from_origin(where)
    k = _dot(NORMAL, offset) / BETWEEN_SLICES
    i = (_dot(ROW, offset) - 0.2 * k) / BETWEEN_COLUMNS
    j = (_dot(COLUMN, offset) - 0.45 * k) / BETWEEN_ROWS
    return all(-1e-6 <= v <= n - 1 + 1e-6 for v, n in zip((i, j, k), size, strict=True))


def _from_origin(where: Point) -> Point:
    x, y, z = (value - origin for value, origin in zip(where, ORIGIN, strict=True))
    return x, y, z


def _dot(one: Point, other: Point) -> float:
    return sum(a * b for a, b in zip(one, other, strict=True))


def _greys() -> str:
    """Signs, stored bits, byte orders and rescales that scanners use."""
    for index, grey in enumerate(GREYS, start=1):
        pixels = GoldenPixels(grey.stored, 2, 2, signed=grey.signed, bits_stored=grey.bits)
        volume = _read(
            (
                (
                    [
                        *plane_elements(k, place(0, 0, k)),
                        *rescale_elements(grey.slope, grey.intercept),
                    ],
                    pixels,
                )
                for k in range(3)
            ),
            grey.syntax,
        )
        found = sorted(volume.voxels.ravel().tolist())
        if found != sorted(3 * grey.hu):
            return f"encoding {index}: {found[0]:g} to {found[-1]:g} HU, or values between, wrong"
    return ""


def plane_elements(number: int, position: Point) -> list[Element]:
    """Place and kind of one slice; the series is nobody's."""
    return [
        (0x00080008, "CS", "ORIGINAL\\PRIMARY\\AXIAL"),
        (0x00080016, "UI", CT_STORAGE),
        (0x00080018, "UI", f"{UID_ROOT}3.{number + 1}"),
        (0x00080060, "CS", "CT"),
        (0x00180050, "DS", (BETWEEN_SLICES,)),
        (0x0020000E, "UI", UID_ROOT + "4"),
        (0x00200032, "DS", position),
        (0x00200037, "DS", (*ROW, *COLUMN)),
        (0x00200052, "UI", UID_ROOT + "5"),
        (0x00280030, "DS", (BETWEEN_ROWS, BETWEEN_COLUMNS)),
    ]


def rescale_elements(slope: float, intercept: float) -> list[Element]:
    """From stored values to Hounsfield units."""
    return [
        (0x00281052, "DS", (intercept,)),
        (0x00281053, "DS", (slope,)),
        (0x00281054, "LO", "HU"),
    ]


def _read(slices: Iterable[tuple[list[Element], GoldenPixels]], syntax: str = EXPLICIT) -> Volume:
    """The slices written to a folder of their own and read by the chain's reader."""
    with TemporaryDirectory(prefix="hexafix-selftest-") as folder:
        for number, (elements, pixels) in enumerate(slices):
            content = dicom_file(elements, pixels, transfer_syntax=syntax)
            Path(folder, f"{number}.dcm").write_bytes(content)
        return read_volume(folder)


def _voxels(volume: Volume) -> Iterable[tuple[Point, float]]:
    """Place, LPS mm, and value of every voxel, as the chain asks for them."""
    i, j, k = volume.size_ijk
    indices = [(i, j, k) for k, j, i in product(range(k), range(j), range(i))]
    places = volume.lps_from_ijk(indices).tolist()
    values = volume.voxels.ravel().tolist()
    return (((x, y, z), value) for (x, y, z), value in zip(places, values, strict=True))
