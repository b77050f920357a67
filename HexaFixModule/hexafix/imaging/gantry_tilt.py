"""Slices sheared against each other by a tilted gantry, and the orthogonal grid they are moved to.

Each slice stays in the plane it was acquired in and is moved within it by a part of a voxel:
nothing is interpolated from slice to slice. What the header says about the tilt is never asked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import NDArray

TILT_TOLERANCE_DEG = 0.05
"""Up to here the shear stays in the affine: a slice is at most 0.001 of its distance aside."""
MAX_TILT_DEG = 35.0
"""No gantry tilts further than 30 deg; a stack that leans more was put together wrongly."""

_SNAP_VOXELS = 1e-4
_EDGE = 12
"""Voxels by which a row is continued: the spline's memory of its end fades by 0.27 a voxel."""


@dataclass(frozen=True, slots=True)
class GantryTilt:
    """How the line of slice origins leans against the slice normal.

    Attributes
    ----------
    deg : float
        Angle between line and normal (row direction x column direction). Positive when the
        origins, going along the normal, advance along the direction in which they lean most: to
        higher row numbers (along the column direction) for the usual tilt about the row direction.
    axis_deg : float
        Axis of the tilt in the slice plane, counted from the row direction towards the column
        direction, -90 to 90: 0 for a tilt about the row direction, ±90 about the column direction.
    """

    deg: float
    axis_deg: float

    @classmethod
    def of(cls, step_mm: NDArray[np.float64], axes: NDArray[np.float64]) -> GantryTilt:
        """The tilt of a step from slice to slice.

        Parameters
        ----------
        step_mm : ndarray, shape (3,)
            LPS mm, along the normal in sense.
        axes : ndarray, shape (3, 3)
            Rows: unit directions of i, of j, and the slice normal, in LPS.
        """
        along_i, along_j, rise = (float(value) for value in axes @ step_mm)
        sign = -1.0 if (along_j if abs(along_j) >= abs(along_i) else along_i) < 0.0 else 1.0
        lean = float(np.degrees(np.arctan2(np.hypot(along_i, along_j), rise)))
        axis = float(np.degrees(np.arctan2(-sign * along_i, sign * along_j)))
        return cls(sign * lean, 0.0 if lean <= TILT_TOLERANCE_DEG else axis)

    @property
    def words(self) -> str:
        """Angle and axis for people."""
        if abs(self.axis_deg) < 0.5:
            axis = "the row direction"
        elif abs(self.axis_deg) > 89.5:
            axis = "the column direction"
        else:
            axis = f"an axis {self.axis_deg:.0f} deg from the row direction"
        return f"{self.deg:+.2f} deg about {axis}"


@dataclass(frozen=True, eq=False)
class OrthogonalGrid:
    """The grid in the planes of sheared slices that holds all of them.

    Attributes
    ----------
    size_ijk : tuple of int
        As many slices as acquired, each widened to the union of the moved slices.
    ijk_to_lps : ndarray, shape (4, 4)
        Perpendicular axes: the acquired row and column directions and pitch, and the normal.
    offsets : ndarray, shape (K, 2)
        Where the first voxel (i, j) of each acquired slice lies in this grid, voxels, not negative.
    """

    size_ijk: tuple[int, int, int]
    ijk_to_lps: NDArray[np.float64]
    offsets: NDArray[np.float64]

    @classmethod
    def around(
        cls,
        origins_mm: NDArray[np.float64],
        axes: NDArray[np.float64],
        pitch_mm: NDArray[np.float64],
        size_ij: tuple[int, int],
    ) -> OrthogonalGrid:
        """The grid of slices at even distances along their normal.

        Parameters
        ----------
        origins_mm : ndarray, shape (K, 3)
            Centre of the first voxel of each slice, LPS mm, ascending along the normal.
        axes : ndarray, shape (3, 3)
            Rows: unit directions of i, of j, and the slice normal, in LPS.
        pitch_mm : ndarray, shape (2,)
            Between columns (along i), between rows (along j).
        size_ij : tuple of int
            Columns and rows of a slice.
        """
        moved = (origins_mm - origins_mm[0]) @ axes[:2].T / pitch_mm
        first = np.floor(moved.min(axis=0) + _SNAP_VOXELS)
        offsets = moved - first
        whole = np.rint(offsets)
        offsets = np.where(np.abs(offsets - whole) <= _SNAP_VOXELS, whole, offsets)
        added = np.ceil(offsets.max(axis=0)).astype(int)
        affine = np.eye(4)
        affine[:3, :2] = axes[:2].T * pitch_mm
        rise = float((origins_mm[-1] - origins_mm[0]) @ axes[2]) / (len(origins_mm) - 1)
        affine[:3, 2] = rise * axes[2]
        affine[:3, 3] = origins_mm[0] + affine[:3, :2] @ first
        size = (size_ij[0] + int(added[0]), size_ij[1] + int(added[1]), len(origins_mm))
        return cls(size, affine, offsets)

    def place(self, acquired: NDArray, k: int, out: NDArray, *, outside: int) -> None:
        """Move one slice to its place.

        Parameters
        ----------
        acquired : ndarray, shape (J, I), int16 or float32
            HU of slice `k` as it was acquired.
        k : int
        out : ndarray, shape (J', I'), of the same type
            Slice `k` of this grid; voxels that were not acquired become `outside`.
        outside : int
            HU.
        """
        rows, columns = acquired.shape
        values = acquired
        starts = []
        for axis, offset in ((1, self.offsets[k, 0]), (0, self.offsets[k, 1])):
            start = int(np.ceil(offset))
            starts.append(start)
            if start > offset:
                values = _between(values, start - offset, axis)
        rows, columns = values.shape
        if np.issubdtype(out.dtype, np.integer):
            values = np.rint(values)
        out[...] = outside
        out[starts[1] : starts[1] + rows, starts[0] : starts[0] + columns] = values


def _between(values: NDArray, fraction: float, axis: int) -> NDArray:
    """Values between neighbours along one axis by the cubic spline, one fewer than there are.

    No value leaves the range of the two voxels that it lies between: air stays air, and what the
    scanner clipped stays flat at the clipping value, which gates ask for.
    """
    rows = np.moveaxis(values, axis, 0)
    # Continued oddly about its ends, so that a slope goes on there and is not bent.
    edges = [(_EDGE, _EDGE), (0, 0)]
    # Single precision keeps a thousandth of a HU, and half the memory traffic.
    longer = np.pad(rows.astype(np.float32), edges, mode="reflect", reflect_type="odd")
    terms = scipy.ndimage.spline_filter1d(longer, order=3, axis=0, output=np.float32, mode="mirror")
    count = len(rows) - 1
    before, after = 1.0 - fraction, fraction
    # The cubic B-spline at the distances of the four nearest voxels.
    weights = (
        before**3 / 6.0,
        2.0 / 3.0 - after**2 + after**3 / 2.0,
        2.0 / 3.0 - before**2 + before**3 / 2.0,
        after**3 / 6.0,
    )
    moved = np.zeros((count, rows.shape[1]), np.float32)
    for tap, weight in zip(range(-1, 3), weights, strict=True):
        moved += np.float32(weight) * terms[_EDGE + tap : _EDGE + tap + count]
    np.maximum(moved, np.minimum(rows[:-1], rows[1:]), out=moved)
    np.minimum(moved, np.maximum(rows[:-1], rows[1:]), out=moved)
    return np.moveaxis(moved, 0, axis)
