"""What a DICOM folder shows by its own headers: an independent, full reading by pydicom.

Nothing of HexaFix takes part. Places are those of PS3.3 C.7.6.2.1-1, slice by slice; values are
the stored bits, times slope, plus intercept.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pydicom
from pydicom.pixels.utils import pixel_array

EXACT_MM = 1e-3
# Headers that are uneven by less than the documented tolerances are read as an even grid.
TOLERATED_MM = 0.05
AIR_HU = -1024


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame by its own header; `hu` shape (J, I), `corners` of first row and column first."""

    origin: np.ndarray
    row: np.ndarray
    column: np.ndarray
    hu: np.ndarray
    loose: np.ndarray

    def place(self, i: float, j: float) -> np.ndarray:
        """Centre of the voxel in column i and row j, LPS mm; row and column hold the pitch."""
        return self.origin + self.row * i + self.column * j

    def corners(self) -> np.ndarray:
        rows, columns = self.hu.shape
        return np.array([self.place(i, j) for i in (0, columns - 1) for j in (0, rows - 1)])


def own_reading(folder: Path) -> list[Frame]:
    """Every frame of a folder that has geometry and pixels."""
    frames = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for path in sorted(folder.iterdir()):
            try:
                frames += _frames(path)
            except Exception:  # pydicom raises many kinds; such a file has no frame
                continue
    return frames


def _frames(path: Path) -> list[Frame]:
    item = pydicom.dcmread(path)
    count = int(item.get("NumberOfFrames") or 1)
    found = []
    for index in range(count):
        groups = [item]
        if "PerFrameFunctionalGroupsSequence" in item:
            groups = [item.PerFrameFunctionalGroupsSequence[index]]
            groups += list(item.get("SharedFunctionalGroupsSequence") or [])
        origin = _find(groups, "PlanePositionSequence", "ImagePositionPatient")
        axes = _find(groups, "PlaneOrientationSequence", "ImageOrientationPatient")
        pitch = _find(groups, "PixelMeasuresSequence", "PixelSpacing")
        slope = _find(groups, "PixelValueTransformationSequence", "RescaleSlope")
        intercept = _find(groups, "PixelValueTransformationSequence", "RescaleIntercept")
        stored, loose = _stored(item, path, index)
        hu = (1.0 if slope is None else float(slope)) * stored.astype(float)
        hu += 0.0 if intercept is None else float(intercept)
        row, column = np.array(axes, float).reshape(2, 3)
        row, column = row * float(pitch[1]), column * float(pitch[0])
        found.append(Frame(np.array(origin, float), row, column, hu, loose))
    return found


def _find(groups: list[pydicom.Dataset], macro: str, keyword: str) -> object:
    for group in groups:
        if keyword in group:
            return group[keyword].value
        items = group.get(macro)
        if items and keyword in items[0]:
            return items[0][keyword].value
    return None


def _stored(item: pydicom.Dataset, path: Path, index: int) -> tuple[np.ndarray, np.ndarray]:
    """Stored values of a frame, and where padding lets the reader put air instead."""
    syntax = item.file_meta.TransferSyntaxUID
    rows, columns, bits = item.Rows, item.Columns, item.BitsAllocated
    if syntax.is_encapsulated:
        raw = pixel_array(path, index=index, raw=True)
        raw = raw.astype(np.int64) & ((1 << bits) - 1)
    else:
        order = "<" if syntax.is_little_endian else ">"
        size = rows * columns * (bits // 8)
        data = item.PixelData[index * size : (index + 1) * size]
        raw = np.frombuffer(data, f"{order}u{bits // 8}").reshape(rows, columns).astype(np.int64)
    stored, high = item.BitsStored, item.HighBit
    values = (raw >> (high + 1 - stored)) & ((1 << stored) - 1)
    if item.PixelRepresentation == 1:
        values = np.where(values >= 1 << (stored - 1), values - (1 << stored), values)
    loose = np.zeros(values.shape, bool)
    if "PixelPaddingValue" in item:
        loose = raw == int(item.PixelPaddingValue) % (1 << bits)
    return values, loose


def why_wrong(volume, frames: list[Frame]) -> str | None:
    """Why a volume that was read is not what its files say, None if it is."""
    if not np.isfinite(volume.ijk_to_lps).all() or not np.isfinite(volume.voxels).all():
        return "numbers that are not finite"
    if not frames:
        return "a volume of no readable frame"
    if volume.source.acquisition is not None:
        return _why_moved_wrong(volume, frames)
    columns, rows, slices = volume.size_ijk
    ends = np.array([(i, j) for i in (0, columns - 1) for j in (0, rows - 1)], float)
    limit = EXACT_MM + (TOLERATED_MM if _unevenness(frames) > EXACT_MM / 5 else 0.0)
    used = set()
    for k in range(slices):
        grid = volume.lps_from_ijk(np.c_[ends, np.full(4, k)])
        near = [
            (np.abs(frame.corners() - grid).max(), number)
            for number, frame in enumerate(frames)
            if frame.hu.shape == (rows, columns)
        ]
        near = [(apart, number) for apart, number in near if apart <= limit]
        if not near:
            return f"slice {k} lies where no header puts one"
        right = [number for _, number in near if _same(volume.voxels[k], frames[number])]
        if not right:
            return f"slice {k} shows other values than its file"
        used.update(right)
    return _unused(volume, len(frames) - len(used))


def _same(values: np.ndarray, frame: Frame) -> bool:
    close = np.isclose(values, frame.hu, rtol=1e-6, atol=1e-4)
    return bool((close | (frame.loose & (np.abs(values - AIR_HU) <= 1))).all())


def _unused(volume, count: int) -> str | None:
    if count and not volume.source.warnings:
        return f"{count} readable frames were left out without a word"
    return None


def _unevenness(frames: list[Frame]) -> float:
    """How far the headers are from an exact grid, mm."""
    first = frames[0]
    normal = np.cross(first.row, first.column)
    frames = sorted(frames, key=lambda frame: float(frame.origin @ normal))
    origins = np.array([frame.origin for frame in frames])
    share = np.linspace(0.0, 1.0, len(frames))[:, None]
    worst = np.abs(origins - (origins[0] + share * (origins[-1] - origins[0]))).max()
    rows, columns = first.hu.shape
    lengths = np.linalg.norm(first.row), np.linalg.norm(first.column)
    cosine = abs(first.row @ first.column) / (lengths[0] * lengths[1])
    unit = max(cosine, *(abs(np.linalg.norm(a / b) - 1) for a, b in zip(
        (first.row, first.column), lengths, strict=True)))  # fmt: skip
    worst = max(worst, unit * max(rows, columns) * max(lengths))
    for frame in frames[1:]:
        if frame.hu.shape == first.hu.shape:
            own = frame.corners() - frame.origin
            worst = max(worst, np.abs(own - (first.corners() - first.origin)).max())
    return float(worst)


def _why_moved_wrong(volume, frames: list[Frame]) -> str | None:
    """A tilted series, each slice moved within its plane: places exact, values in between."""
    used = 0
    for k in range(volume.size_ijk[2]):
        three = (0, 0, k), (1, 0, k), (0, 1, k)
        origin, along_i, along_j = map(volume.lps_from_ijk, three)
        along_i, along_j = along_i - origin, along_j - origin
        normal = np.cross(along_i, along_j)
        normal /= np.linalg.norm(normal)
        frame = min(frames, key=lambda frame: abs((frame.origin - origin) @ normal))
        limit = EXACT_MM + TOLERATED_MM
        if np.abs((frame.corners() - origin) @ normal).max() > limit:
            return f"slice {k} was moved out of its plane"
        if max(np.abs(frame.row - along_i).max(), np.abs(frame.column - along_j).max()) > 1e-3:
            return f"slice {k} was turned or stretched"
        wrong = _values_between(volume.voxels[k], origin, along_i, along_j, frame)
        if wrong:
            return f"slice {k} {wrong}"
        used += 1
    return _unused(volume, len(frames) - used)


def _values_between(values, origin, along_i, along_j, frame: Frame) -> str | None:
    shift = origin - frame.origin
    start_i = shift @ along_i / (along_i @ along_i)
    start_j = shift @ along_j / (along_j @ along_j)
    rows, columns = frame.hu.shape
    for j in range(values.shape[0]):
        for i in range(values.shape[1]):
            at_i, at_j = i + start_i, j + start_j
            # Places within a hundredth of a voxel may count to either side.
            low_i, high_i = int(np.floor(at_i + 0.01)), int(np.ceil(at_i - 0.01))
            low_j, high_j = int(np.floor(at_j + 0.01)), int(np.ceil(at_j - 0.01))
            inside = min(low_i, low_j) >= 0 and high_i < columns and high_j < rows
            near = frame.hu[max(low_j, 0) : high_j + 1, max(low_i, 0) : high_i + 1]
            if not inside:
                if abs(values[j, i] - AIR_HU) > 1:
                    return "shows something where nothing was acquired"
                continue
            low, high = near.min(), near.max()
            if frame.loose.any():
                low, high = min(low, AIR_HU), max(high, AIR_HU)
            # The neighbours' own difference bounds what a hundredth of a voxel can do.
            slack = 1.0 + 0.02 * (frame.hu.max() - frame.hu.min()) / max(rows, columns)
            if not low - slack <= values[j, i] <= high + slack:
                return f"shows {values[j, i]} between {low} and {high}"
    return None
