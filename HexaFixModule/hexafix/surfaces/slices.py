"""Slices of a CT square to the patient's axes: where they lie, how they are looked at."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.errors import MissingLibrary

if TYPE_CHECKING:
    from hexafix.imaging import Volume

MOST_PLACES = 2000
"""Slices of one view at most, however fine the image is."""

FINEST_MM = 0.2
"""The finest step from slice to slice."""

MARGIN = 1.02
"""How much more than the image a view shows at first."""

CAMERA_MM = 2000.0
"""How far the camera stands away: outside of any image."""


@dataclass(frozen=True, slots=True)
class SliceView:
    """How one kind of slice is looked at, as in radiology: the patient's left on the right side.

    Attributes
    ----------
    name, title : str
    axis : int
        The LPS axis that the slices are square to: 0 L, 1 P, 2 S.
    along, up : tuple of float
        Unit vectors in LPS: where the viewer looks to, and what is upwards on the screen.
    right, left, top, bottom : str
        The patient's directions at the screen's edges.
    letter : str
        The direction in which the slice's place is counted.
    """

    name: str
    title: str
    axis: int
    along: tuple[float, float, float]
    up: tuple[float, float, float]
    right: str
    left: str
    top: str
    bottom: str
    letter: str


AXIAL = SliceView(
    "axial", "Axial", 2, (0.0, 0.0, 1.0), (0.0, -1.0, 0.0), *("L", "R", "A", "P", "S")
)
CORONAL = SliceView(
    "coronal", "Coronal", 1, (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), *("L", "R", "H", "F", "P")
)
SAGITTAL = SliceView(
    "sagittal", "Sagittal", 0, (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0), *("P", "A", "H", "F", "L")
)
SLICE_VIEWS = (AXIAL, CORONAL, SAGITTAL)


@cache
def _vtk() -> Any:
    """VTK's data model with the arrays' bridge."""
    try:
        common = import_module("vtkmodules.vtkCommonDataModel")
        math = import_module("vtkmodules.vtkCommonMath")
        filters = import_module("vtkmodules.vtkFiltersCore")
        bridge = import_module("vtkmodules.util.numpy_support")
    except ImportError as error:
        raise MissingLibrary.of(
            "library-missing",
            "slices need VTK, which is not installed",
            next_step="install hexafix[workstation] or hexafix[qt]",
        ) from error
    return common, math, filters, bridge


def slice_image(volume: Volume) -> tuple[Any, Any]:
    """A volume as VTK takes it: the voxels by their indices, and where the indices lie.

    Returns
    -------
    vtkImageData
        Origin 0, spacing 1, HU; a copy, so that the volume stays as it is.
    vtkMatrix4x4
        Voxel indices i, j, k to LPS mm, whatever the hand of the grid.
    """
    common, math, _, bridge = _vtk()
    image = common.vtkImageData()
    image.SetDimensions(*volume.size_ijk)
    voxels = np.ascontiguousarray(volume.voxels).ravel()
    kind = bridge.get_vtk_array_type(voxels.dtype)
    scalars = bridge.numpy_to_vtk(voxels.copy(), deep=True, array_type=kind)
    scalars.SetName("HU")
    image.GetPointData().SetScalars(scalars)
    matrix = math.vtkMatrix4x4()
    matrix.DeepCopy([float(value) for value in np.asarray(volume.ijk_to_lps).ravel()])
    return image, matrix


def slice_places_mm(volume: Volume, view: SliceView) -> tuple[float, ...]:
    """Where the slices of a view lie along its axis, LPS mm, ascending; voxel by voxel."""
    corners = volume.corners_mm()[:, view.axis]
    steps = np.abs(volume.direction[view.axis]) * volume.spacing_mm
    step = max(FINEST_MM, float(steps.max()))
    count = int(np.floor((corners.max() - corners.min()) / step + 1e-6)) + 1
    count = min(max(count, 2), MOST_PLACES)
    return tuple(np.linspace(corners.min(), corners.max(), count).tolist())


def nearest_place(places_mm: Sequence[float], value_mm: float) -> int:
    """Index of the place that is nearest."""
    return int(np.argmin(np.abs(np.asarray(places_mm) - value_mm)))


def middle_mm(volume: Volume) -> tuple[float, float, float]:
    """The image's middle, LPS mm."""
    low, high = volume.corners_mm().min(0), volume.corners_mm().max(0)
    x, y, z = ((low + high) / 2).tolist()
    return x, y, z


def balls_middle_mm(centers_mm: ArrayLike) -> tuple[float, float, float] | None:
    """The middle of the balls' box, LPS mm: the first place worth looking at; None for none."""
    points = np.asarray(centers_mm, float).reshape(-1, 3)
    if not len(points):
        return None
    x, y, z = ((points.min(0) + points.max(0)) / 2).tolist()
    return x, y, z


def half_height_mm(volume: Volume, view: SliceView, *, aspect: float) -> float:
    """Half of what a view shows from top to bottom so that the whole slice fits.

    Parameters
    ----------
    volume : Volume
    view : SliceView
    aspect : float
        Width of the view over its height.
    """
    size = np.ptp(volume.corners_mm(), axis=0)
    up = int(np.argmax(np.abs(view.up)))
    (across,) = {0, 1, 2} - {up, view.axis}
    return MARGIN * 0.5 * float(max(size[up], size[across] / max(aspect, 0.1), 1.0))


def at_place(
    view: SliceView, point_mm: Sequence[float], place_mm: float
) -> tuple[float, float, float]:
    """The point, LPS mm, moved along the view's axis into the slice at `place_mm`."""
    x, y, z = (place_mm if axis == view.axis else float(point_mm[axis]) for axis in range(3))
    return x, y, z


def look_at_slice(camera: Any, view: SliceView, point_mm: Sequence[float]) -> None:
    """Put a parallel camera square before the slice through a point in LPS mm."""
    point, along = np.asarray(point_mm, float), np.asarray(view.along)
    camera.ParallelProjectionOn()
    camera.SetFocalPoint(*point.tolist())
    camera.SetPosition(*(point - CAMERA_MM * along).tolist())
    camera.SetViewUp(*view.up)
    camera.SetClippingRange(1.0, 2 * CAMERA_MM)


def cut(mesh: Any, view: SliceView, place_mm: float) -> Any:
    """The outline of a vtkPolyData in a slice, as a vtkPolyData of lines in LPS mm."""
    common, _, filters, _ = _vtk()
    plane = common.vtkPlane()
    plane.SetOrigin(*at_place(view, (0.0, 0.0, 0.0), place_mm))
    plane.SetNormal(*view.along)
    cutter = filters.vtkCutter()
    cutter.SetCutFunction(plane)
    cutter.SetInputData(mesh)
    cutter.Update()
    lines = common.vtkPolyData()
    lines.ShallowCopy(cutter.GetOutput())
    return lines


def in_slice(
    centers_mm: ArrayLike, *, view: SliceView, place_mm: float, reach_mm: float
) -> list[int]:
    """Indices of the points, shape (N, 3), LPS mm, within `reach_mm` of a slice."""
    points = np.asarray(centers_mm, float).reshape(-1, 3)
    return np.flatnonzero(np.abs(points[:, view.axis] - place_mm) <= reach_mm).tolist()


def ball_at(centers_mm: ArrayLike, *, point_mm: ArrayLike, reach_mm: float) -> int | None:
    """Index of the ball nearest to a clicked point, if it lies within reach.

    Parameters
    ----------
    centers_mm : array_like, shape (N, 3)
        LPS mm.
    point_mm : array_like, shape (3,)
        LPS mm.
    reach_mm : float
        How far from a centre a click may be.
    """
    points = np.asarray(centers_mm, float).reshape(-1, 3)
    if not len(points):
        return None
    far = np.linalg.norm(points - np.asarray(point_mm, float), axis=1)
    nearest = int(np.argmin(far))
    return nearest if far[nearest] <= reach_mm else None
