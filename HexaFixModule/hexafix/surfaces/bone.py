"""Bone and metal as surfaces of the coarse CT sample; for the picture, never for measuring."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexafix.report.scene import BoneSample
from hexafix.report.vtk_child import BONE_HU, METAL_HU, blurred, surface
from hexafix.surfaces.meshes import joined, result, vtk_classes

AIR_HU = -1024
"""What stands around the sample, so that its surface is closed where the bone is cut."""

MOST_TRIANGLES = 60_000
"""A picture of a limb needs no more; a software renderer draws this many without a jerk."""


def bone_surface(sample: BoneSample, *, level_hu: float = BONE_HU) -> Any:
    """The surface of what is denser than `level_hu`.

    Parameters
    ----------
    sample : BoneSample
        Coarse HU, shape (K, J, I), with its affine to LPS mm, of either hand.
    level_hu : float
        Iso-value after a light blur; bone by default.

    Returns
    -------
    vtkPolyData
        Triangles in LPS mm, closed, smoothed, without specks, normals outwards; empty if nothing
        is that dense.
    """
    v = vtk_classes()
    hu = np.pad(sample.hu, 1, constant_values=AIR_HU)
    affine = np.array(sample.ijk_to_lps, float)
    affine[:3, 3] -= affine[:3, :3].sum(axis=1)
    shape = surface(v, blurred(v, hu), affine, level_hu)
    return joined([]) if shape is None else _thinned(v, shape)


def metal_surface(sample: BoneSample) -> Any:
    """Pins and wires of the sample as `bone_surface` gives the bone."""
    return bone_surface(sample, level_hu=METAL_HU)


def _thinned(v: Any, shape: Any) -> Any:
    """The mesh with at most about `MOST_TRIANGLES` triangles, its normals made anew."""
    count = shape.GetOutput().GetNumberOfCells()
    if count <= MOST_TRIANGLES:
        return result(shape)
    thin = v.vtkDecimatePro()
    thin.SetInputConnection(shape.GetOutputPort())
    thin.SetTargetReduction(1.0 - MOST_TRIANGLES / count)
    thin.PreserveTopologyOn()
    normals = v.vtkPolyDataNormals()
    normals.SetInputConnection(thin.GetOutputPort())
    normals.SplittingOff()
    normals.ConsistencyOff()
    return result(normals)
