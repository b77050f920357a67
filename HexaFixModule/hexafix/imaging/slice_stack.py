"""From slice headers to one grid: order by geometry, and everything that forbids a grid.

Only ImagePositionPatient, ImageOrientationPatient and PixelSpacing count. File names, instance
numbers, SliceLocation, SpacingBetweenSlices and GantryDetectorTilt are never asked: each of them
is known to lie.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault
from hexafix.imaging.dicom_header import SliceHeader
from hexafix.imaging.gantry_tilt import (
    MAX_TILT_DEG,
    TILT_TOLERANCE_DEG,
    GantryTilt,
    OrthogonalGrid,
)
from hexafix.imaging.slice_agreement import (
    ORIENTATION_TOLERANCE,
    differs,
    faults_of_missing_geometry,
    faults_of_mixture,
    listed,
)

GAP_TOLERANCE_MM = 0.01
# Headers with four decimals stay within this of unit length and of a right angle.
AXES_TOLERANCE = 2e-4
# What the tolerances above may add up to at a slice corner.
CORNER_TOLERANCE_MM = 0.05
# Two gaps are the least that can show whether the spacing is even.
MIN_SLICES = 3
# The frames of one file are counted in its header: none can be lost unseen.
MIN_FRAMES = 2


@dataclass(frozen=True, eq=False)
class SliceStack:
    """Slices in the order of their normal, and what their headers say about the grid.

    Attributes
    ----------
    slices : tuple of SliceHeader
        One for each position, ascending along row direction × column direction.
    doubled : tuple of (int, SliceHeader)
        Further slices at the position of ``slices[index]``; their pixels are still to be compared.
    origins_mm : ndarray, shape (K, 3)
        Centre of the first voxel of each slice, LPS mm: the truth also for a tilted stack.
    axes : ndarray, shape (3, 3)
        Rows: unit directions of i, of j, and the slice normal, in LPS.
    ijk_to_lps : ndarray, shape (4, 4)
        The grid through first and last slice.
    """

    slices: tuple[SliceHeader, ...]
    doubled: tuple[tuple[int, SliceHeader], ...]
    origins_mm: NDArray[np.float64]
    axes: NDArray[np.float64]
    ijk_to_lps: NDArray[np.float64]

    @property
    def gaps_mm(self) -> NDArray[np.float64]:
        """Distance between neighbours along the normal, shape (K - 1,), mm."""
        return np.diff(self.origins_mm @ self.axes[2])

    @property
    def tilt(self) -> GantryTilt:
        """How the line of slice origins leans against the slice normal."""
        return GantryTilt.of(self.origins_mm[-1] - self.origins_mm[0], self.axes)

    @property
    def tilt_deg(self) -> float:
        """Signed angle of the tilt; its convention stands at `GantryTilt`."""
        return self.tilt.deg

    @property
    def size_ijk(self) -> tuple[int, int, int]:
        """Columns, rows and slices as acquired."""
        return self.slices[0].columns, self.slices[0].rows, len(self.slices)

    def orthogonal_grid(self) -> OrthogonalGrid | None:
        """The grid to which tilted slices are moved; None when they are not tilted."""
        if abs(self.tilt_deg) <= TILT_TOLERANCE_DEG:
            return None
        pitch = np.linalg.norm(self.ijk_to_lps[:3, :2], axis=0)
        return OrthogonalGrid.around(self.origins_mm, self.axes, pitch, self.size_ijk[:2])


def arrange(slices: Sequence[SliceHeader]) -> tuple[SliceStack | None, list[Fault]]:
    """Order slices of one series and check that they form a grid.

    Parameters
    ----------
    slices : sequence of SliceHeader
        At least one; in any order.

    Returns
    -------
    stack : SliceStack or None
        None where the headers do not allow even an order.
    faults : list of Fault
        Everything that forbids the grid, empty when it may be used. Doubled positions are left to
        whoever can compare the pixels.
    """
    placed = [item for item in slices if _has_geometry(item)]
    faults = faults_of_missing_geometry(len(slices) - len(placed), len(slices))
    if not placed:
        return None, faults
    faults += faults_of_mixture(placed)
    axes, bad_axes = _axes(placed)
    faults += bad_axes
    stack = _stack(placed, axes)
    faults += _too_few(stack)
    if len(stack.slices) > 1 and not any(fault.code == "mixed-orientation" for fault in faults):
        faults += _uneven(stack) + _shifted(stack)
        if not faults:
            faults += _corners(stack)
        faults += _tilted(stack, alone=not faults)
    return stack, faults


def _has_geometry(item: SliceHeader) -> bool:
    spacing = item.pixel_spacing_mm
    return (
        item.position_mm is not None
        and item.orientation is not None
        and spacing is not None
        and min(spacing) > 0
    )


def _axes(slices: Sequence[SliceHeader]) -> tuple[NDArray[np.float64], list[Fault]]:
    """Orthonormal i, j and normal directions, mean over the slices like the first one."""
    first = slices[0]
    alike = [
        item.orientation
        for item in slices
        if differs(item.orientation, first.orientation) <= ORIENTATION_TOLERANCE
    ]
    row, column = np.mean(np.array(alike, float), axis=0).reshape(2, 3)
    lengths = np.linalg.norm(row), np.linalg.norm(column)
    off = max(abs(lengths[0] - 1), abs(lengths[1] - 1), abs(row @ column))
    faults = []
    if off > AXES_TOLERANCE:
        faults.append(
            Fault(
                "bad-orientation",
                "ImageOrientationPatient is not two perpendicular unit vectors",
                value=f"{off:.2g}",
                limit=f"{AXES_TOLERANCE:g}",
                next_step="export the original CT series",
                hazard="H07",
            )
        )
    # The rounding of the header is shared evenly between the two directions.
    left, _, right = np.linalg.svd(np.stack([row, column]), full_matrices=False)
    i, j = left @ right
    return np.stack([i, j, np.cross(i, j)]), faults


def _stack(slices: Sequence[SliceHeader], axes: NDArray[np.float64]) -> SliceStack:
    along = np.array([item.position_mm for item in slices], float) @ axes[2]
    kept: list[SliceHeader] = []
    doubled: list[tuple[int, SliceHeader]] = []
    last = -np.inf
    for index in np.argsort(along, kind="stable"):
        if along[index] - last < GAP_TOLERANCE_MM:
            doubled.append((len(kept) - 1, slices[index]))
        else:
            kept.append(slices[index])
            last = along[index]
    origins = np.array([item.position_mm for item in kept], float)
    between_rows, between_columns = kept[0].pixel_spacing_mm or (1.0, 1.0)
    affine = np.eye(4)
    affine[:3, 0] = axes[0] * between_columns
    affine[:3, 1] = axes[1] * between_rows
    steps = max(len(kept) - 1, 1)
    affine[:3, 2] = (origins[-1] - origins[0]) / steps if len(kept) > 1 else axes[2]
    affine[:3, 3] = origins[0]
    return SliceStack(tuple(kept), tuple(doubled), origins, axes, affine)


def _too_few(stack: SliceStack) -> list[Fault]:
    count = len(stack.slices)
    one_file = count > 1 and len({item.path for item in stack.slices}) == 1
    limit = MIN_FRAMES if one_file else MIN_SLICES
    if count >= limit:
        return []
    return [
        Fault(
            "too-few-slices",
            "too few slice positions for a volume",
            value=str(count),
            limit=f"at least {limit}",
            next_step="give the folder with the whole series",
            hazard="H03",
        )
    ]


def _uneven(stack: SliceStack) -> list[Fault]:
    """Lost slices (a gap that is a multiple of the usual one) and other uneven spacing."""
    gaps = stack.gaps_mm
    usual = float(np.sort(gaps)[(len(gaps) - 1) // 2])
    along = stack.origins_mm @ stack.axes[2]
    multiple = np.rint(gaps / usual)
    lost = (multiple >= 2) & (np.abs(gaps - multiple * usual) <= GAP_TOLERANCE_MM * multiple)
    uneven = ~lost & (np.abs(gaps - usual) > GAP_TOLERANCE_MM)
    faults = []
    for code, what, where, step in (
        ("missing-slice", "slices are missing", lost, "export the series again, complete"),
        (
            "uneven-spacing",
            "the distance between slices varies",
            uneven,
            "reconstruct the CT with one constant slice spacing",
        ),
    ):
        if where.any():
            faults.append(
                Fault(
                    code,
                    what,
                    value="gaps of "
                    + listed(
                        f"{gaps[k]:.3f} mm at {along[k]:.3f}..{along[k + 1]:.3f}"
                        for k in np.flatnonzero(where)
                    )
                    + " mm along the slice normal",
                    limit=f"{usual:.3f} ± {GAP_TOLERANCE_MM:g} mm",
                    next_step=step,
                    hazard="H03",
                )
            )
    # Gaps within tolerance can still drift away from the grid when they err to one side.
    even = np.linspace(along[0], along[-1], len(along))
    drift = float(np.max(np.abs(along - even)))
    if not faults and drift > GAP_TOLERANCE_MM:
        faults.append(
            Fault(
                "uneven-spacing",
                "the slice positions drift away from an even grid",
                value=f"{drift:.3f} mm at {along[np.argmax(np.abs(along - even))]:.3f} mm",
                limit=f"{GAP_TOLERANCE_MM:g} mm",
                next_step="reconstruct the CT with one constant slice spacing",
                hazard="H03",
            )
        )
    return faults


def _tilted(stack: SliceStack, *, alone: bool) -> list[Fault]:
    """A tilt that cannot be resampled: beside any other fault, or steeper than a gantry leans."""
    lean = abs(stack.tilt_deg)
    if lean <= (MAX_TILT_DEG if alone else TILT_TOLERANCE_DEG):
        return []
    return [
        Fault(
            "gantry-tilt",
            "the slices are sheared against each other by more than a gantry tilts"
            if alone
            else "the slices are sheared against each other, and that is not all: "
            "only an even, complete stack with one tilt can be resampled",
            value=stack.tilt.words,
            limit=f"{MAX_TILT_DEG if alone else TILT_TOLERANCE_DEG:g} deg",
            next_step="reconstruct or acquire the CT without gantry tilt",
            hazard="H02",
        )
    ]


def _shifted(stack: SliceStack) -> list[Fault]:
    """Slices beside the straight line through the origins of first and last slice."""
    along = stack.gaps_mm.cumsum() / stack.gaps_mm.sum()
    line = stack.origins_mm[0] + np.outer(along, stack.origins_mm[-1] - stack.origins_mm[0])
    beside = np.linalg.norm(stack.origins_mm[1:] - line, axis=1)
    # Along the normal the residual is zero by construction: this is the shift in the plane.
    if beside.max() <= GAP_TOLERANCE_MM:
        return []
    where = np.flatnonzero(beside > GAP_TOLERANCE_MM) + 1
    return [
        Fault(
            "shifted-slice",
            "slices are shifted within their plane",
            value=listed(
                f"{beside[k - 1]:.3f} mm at {stack.origins_mm[k] @ stack.axes[2]:.3f}"
                for k in where
            )
            + " mm along the slice normal",
            limit=f"{GAP_TOLERANCE_MM:g} mm",
            next_step="reconstruct the CT with one field of view for all slices",
            hazard="H03",
        )
    ]


def _corners(stack: SliceStack) -> list[Fault]:
    """Gate G1: every slice's corners by its own header against the corners by the grid."""
    first = stack.slices[0]
    ends = np.array([(i, j) for i in (0, first.columns - 1) for j in (0, first.rows - 1)], float)
    worst = 0.0
    for k, item in enumerate(stack.slices):
        cosines = np.reshape(item.orientation or (), (2, 3))
        between_rows, between_columns = item.pixel_spacing_mm or (1.0, 1.0)
        own = np.array(item.position_mm) + ends @ (
            cosines * np.array([[between_columns], [between_rows]])
        )
        grid = np.c_[ends, np.full(4, k)] @ stack.ijk_to_lps[:3, :3].T + stack.ijk_to_lps[:3, 3]
        worst = max(worst, float(np.max(np.linalg.norm(own - grid, axis=1))))
    if worst <= CORNER_TOLERANCE_MM:
        return []
    return [
        Fault(
            "slice-corner",
            "slice corners do not lie on the grid of the volume",
            value=f"{worst:.3f} mm",
            limit=f"{CORNER_TOLERANCE_MM:g} mm",
            next_step="export the original CT series",
            hazard="H03",
        )
    ]
