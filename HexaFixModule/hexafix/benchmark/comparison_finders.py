"""Finding and fitting balls as a user would otherwise write it, each with a common toolkit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.benchmark.balls import isosurface_center, least_squares_sphere
from hexafix.imaging import Volume
from hexafix.markers import find_balls

Array = NDArray[np.float64]
Finder = Callable[[Any, float], Array]

METAL_HU = 1000
HALF_HEIGHT_HU = 650.0
"""Threshold, and the isosurface half-way between air and aluminium, both known to every rival."""

VOLUME_SHARE, BOX_SHARE = (0.6, 1.6), (0.7, 1.4)
"""A component is taken for a ball if its volume and its box's sides are within these of one."""


def by_hexafix(volume: Volume, diameter_mm: float) -> Array:
    """Centres of `find_balls`, shape (n, 3), LPS mm."""
    return find_balls(volume, ball_diameter_mm=diameter_mm).centers_mm.reshape(-1, 3)


def by_careless_hexafix(volume: Volume, diameter_mm: float) -> Array:
    """A control: the work done twice beside a copy in double precision, rounded to the voxel."""
    wide = volume.voxels.astype(np.float64)
    by_hexafix(volume, diameter_mm)
    centers = by_hexafix(volume, diameter_mm)
    index = np.rint(volume.ijk_from_lps(centers)) if len(centers) else centers
    return volume.lps_from_ijk(index) if wide.size and len(centers) else centers


def simpleitk_image(volume: Volume) -> tuple[Any, Volume]:
    """The volume as SimpleITK's image with its place in the patient, and itself."""
    import SimpleITK as sitk  # noqa: N813 - the library's own abbreviation

    image = sitk.GetImageFromArray(volume.voxels)
    spacing = np.asarray(volume.spacing_mm, float)
    image.SetSpacing(spacing.tolist())
    image.SetOrigin(volume.ijk_to_lps[:3, 3].tolist())
    image.SetDirection((volume.ijk_to_lps[:3, :3] / spacing).ravel().tolist())
    return image, volume


def _simpleitk_shapes(image: Any, diameter_mm: float) -> tuple[Any, list[int]]:
    """Shape statistics of the metal's components, and the labels of those like a ball."""
    import SimpleITK as sitk  # noqa: N813

    metal = sitk.BinaryThreshold(image, METAL_HU, 32767, 1, 0)
    labels = sitk.RelabelComponent(sitk.ConnectedComponent(metal, True), minimumObjectSize=20)
    shapes = sitk.LabelShapeStatisticsImageFilter()
    shapes.Execute(labels)
    spacing = np.array(image.GetSpacing())
    kept = [
        label
        for label in shapes.GetLabels()
        if _like_a_ball(
            shapes.GetPhysicalSize(label),
            np.array(shapes.GetBoundingBox(label)[3:]) * spacing,
            diameter_mm,
        )
    ]
    return shapes, kept


def by_simpleitk_centroid(held: tuple[Any, Volume], diameter_mm: float) -> Array:
    """Threshold, components, shape statistics: the components' centroids."""
    shapes, kept = _simpleitk_shapes(held[0], diameter_mm)
    return _stacked([np.array(shapes.GetCentroid(label)) for label in kept])


def by_simpleitk_isosurface(held: tuple[Any, Volume], diameter_mm: float) -> Array:
    """The same components, each fitted by marching cubes and least squares."""
    image, volume = held
    shapes, kept = _simpleitk_shapes(image, diameter_mm)
    return _stacked(
        [_isosurface_center(volume, np.array(shapes.GetCentroid(k)), diameter_mm) for k in kept]
    )


def by_skimage_centroid(volume: Volume, diameter_mm: float) -> Array:
    """scikit-image: label, regionprops, centroids weighted by the grey values."""
    kept = _skimage_regions(volume, diameter_mm)
    index = [np.array(region.centroid_weighted)[::-1] for region in kept]
    return _stacked([volume.lps_from_ijk(one) for one in index])


def by_skimage_isosurface(volume: Volume, diameter_mm: float) -> Array:
    """scikit-image: label, regionprops, then marching cubes and least squares."""
    kept = _skimage_regions(volume, diameter_mm)
    middles = [volume.lps_from_ijk(np.array(region.centroid)[::-1]) for region in kept]
    return _stacked([_isosurface_center(volume, one, diameter_mm) for one in middles])


def _skimage_regions(volume: Volume, diameter_mm: float) -> list[Any]:
    from skimage.measure import label, regionprops

    labels = label(volume.voxels >= METAL_HU, connectivity=3)
    spacing = np.asarray(volume.spacing_mm, float)
    kept = []
    for region in regionprops(labels, intensity_image=volume.voxels):
        low, high = np.array(region.bbox[:3]), np.array(region.bbox[3:])
        if _like_a_ball(region.area * spacing.prod(), (high - low)[::-1] * spacing, diameter_mm):
            kept.append(region)
    return kept


def by_cc3d_centroid(volume: Volume, diameter_mm: float) -> Array:
    """cc3d: components and their statistics' centroids."""
    import cc3d  # type: ignore[import-not-found]

    labels = cc3d.connected_components(volume.voxels >= METAL_HU, connectivity=26)
    found = cc3d.statistics(labels)
    spacing = np.asarray(volume.spacing_mm, float)
    centers = []
    for number in range(1, len(found["voxel_counts"])):
        box = np.array([s.stop - s.start for s in found["bounding_boxes"][number]])[::-1]
        size = float(found["voxel_counts"][number]) * spacing.prod()
        if _like_a_ball(size, box * spacing, diameter_mm):
            centers.append(volume.lps_from_ijk(np.array(found["centroids"][number])[::-1]))
    return _stacked(centers)


def vtk_image(volume: Volume) -> tuple[Any, Volume]:
    """The volume as VTK's image in voxel indices, its memory shared, and itself."""
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(*volume.voxels.shape[::-1])
    scalars = numpy_to_vtk(np.ascontiguousarray(volume.voxels).reshape(-1))
    scalars.SetName("HU")
    image.GetPointData().SetScalars(scalars)
    return image, volume


def by_vtk(held: tuple[Any, Volume], diameter_mm: float) -> Array:
    """VTK: flying edges over the whole volume, connectivity, a least squares sphere a piece."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkFiltersCore import vtkConnectivityFilter, vtkFlyingEdges3D

    image, volume = held
    surface = vtkFlyingEdges3D()
    surface.SetInputData(image)
    surface.SetValue(0, HALF_HEIGHT_HU)
    surface.ComputeNormalsOff()
    surface.ComputeGradientsOff()
    surface.ComputeScalarsOff()
    pieces = vtkConnectivityFilter()
    pieces.SetInputConnection(surface.GetOutputPort())
    pieces.SetExtractionModeToAllRegions()
    pieces.ColorRegionsOn()
    pieces.Update()
    output = pieces.GetOutput()
    if not output.GetNumberOfPoints():
        return np.zeros((0, 3))
    index = vtk_to_numpy(output.GetPoints().GetData()).astype(float)
    regions = vtk_to_numpy(output.GetPointData().GetArray("RegionId"))
    order = np.argsort(regions, kind="stable")
    spacing = np.asarray(volume.spacing_mm, float)
    centers = []
    for points in np.split(index[order], np.flatnonzero(np.diff(regions[order])) + 1):
        box = np.ptp(points, axis=0) * spacing
        if len(points) >= 20 and np.all((box > 0.7 * diameter_mm) & (box < 1.4 * diameter_mm)):
            centers.append(least_squares_sphere(volume.lps_from_ijk(points)))
    return _stacked(centers)


def _isosurface_center(volume: Volume, near_mm: Array, diameter_mm: float) -> Array:
    """Centre by the paper's recipe in the crop near a place, shape (3,), LPS mm."""
    spacing = np.asarray(volume.spacing_mm, float)
    middle, reach = volume.ijk_from_lps(near_mm), diameter_mm / spacing
    low = np.maximum(np.floor(middle - reach), 0).astype(int)
    high = np.ceil(middle + reach).astype(int) + 1
    crop = volume.voxels[low[2] : high[2], low[1] : high[1], low[0] : high[0]]
    affine = volume.ijk_to_lps.copy()
    affine[:3, 3] = volume.lps_from_ijk(low)
    return isosurface_center(
        Volume(crop, affine), near_mm=near_mm, diameter_mm=diameter_mm, level_hu=HALF_HEIGHT_HU
    )


def _like_a_ball(volume_mm3: float, box_mm: Array, diameter_mm: float) -> bool:
    share = volume_mm3 / (np.pi / 6.0 * diameter_mm**3)
    sides = box_mm / diameter_mm
    fits = sides.min() > BOX_SHARE[0] and sides.max() < BOX_SHARE[1]
    return bool(VOLUME_SHARE[0] < share < VOLUME_SHARE[1] and fits)


def _stacked(centers: list[Array]) -> Array:
    return np.array(centers, float).reshape(-1, 3)
