"""VTK's classes, loaded when first asked for, and what all shapes do with them."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

from hexafix.errors import MissingLibrary
from hexafix.report.vtk_child import SHAPE_CLASSES, import_vtk

CLASSES = SHAPE_CLASSES | {
    "vtkFiltersCore": (
        *SHAPE_CLASSES["vtkFiltersCore"],
        *("vtkAppendPolyData", "vtkDecimatePro", "vtkTriangleFilter"),
    ),
    "vtkFiltersSources": (*SHAPE_CLASSES["vtkFiltersSources"], "vtkConeSource"),
}
"""What the shapes need of VTK."""

SHARP_DEG = 40.0
"""An edge sharper than this is drawn as an edge."""


@cache
def vtk_classes() -> Any:
    """The namespace of VTK classes.

    Raises
    ------
    MissingLibrary
        If VTK is not installed.
    """
    try:
        return import_vtk(CLASSES)
    except ImportError as error:
        raise MissingLibrary.of(
            "library-missing",
            "the 3D shapes need VTK, which is not installed",
            next_step="install hexafix[workstation], hexafix[qt] or hexafix[picture]",
        ) from error


def joined(parts: Iterable[Any]) -> Any:
    """One vtkPolyData of all `parts`, filters or meshes, as triangles with normals at corners."""
    v = vtk_classes()
    append = v.vtkAppendPolyData()
    # An input keeps the appended mesh defined when there is nothing to append.
    append.AddInputData(v.vtkPolyData())
    for part in parts:
        if hasattr(part, "GetOutputPort"):
            part.Update()
            part = part.GetOutput()
        append.AddInputData(part)
    triangles = v.vtkTriangleFilter()
    triangles.SetInputConnection(append.GetOutputPort())
    triangles.PassVertsOff()
    triangles.PassLinesOff()
    normals = v.vtkPolyDataNormals()
    normals.SetInputConnection(triangles.GetOutputPort())
    normals.SetFeatureAngle(SHARP_DEG)
    # The parts' corners run outwards already; a search for consistency would cost more than all.
    normals.ConsistencyOff()
    return result(normals)


def result(last: Any) -> Any:
    """What a filter gives, as a mesh that no longer holds the filters before it."""
    last.Update()
    mesh = vtk_classes().vtkPolyData()
    mesh.ShallowCopy(last.GetOutput())
    return mesh
