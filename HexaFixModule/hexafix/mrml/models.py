"""Shapes as model nodes: their points in RAS, their colours those of the prescription."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from hexafix.mrml.geometry import FLIP, vtk4
from hexafix.mrml.nodes import PREFIX, ensure_displayed, nodes_of
from hexafix.surfaces import STALE_COLOUR

CLASS = "vtkMRMLModelNode"

COLOUR = f"{PREFIX}colour"
"""The colour of a fresh result, kept while a stale one is shown grey."""

Colour = tuple[float, float, float]


def put_model(
    scene: Any,
    role: str,
    name: str,
    shape_lps: Any,
    *,
    colour: Colour,
    opacity: float = 1.0,
    in_slices: bool = True,
    shine: float = 0.2,
) -> Any:
    """The model node of a role with this shape.

    Parameters
    ----------
    scene : vtkMRMLScene
    role, name : str
    shape_lps : vtkPolyData
        Points in LPS mm (or in a ring's frame, where the node stands below that ring's transform).
    colour : tuple of float
        Red, green, blue from 0 to 1.
    opacity, shine : float
        From 0 to 1.
    in_slices : bool
        Whether slice views show where they cut it.
    """
    node, display = ensure_displayed(scene, CLASS, role, name)
    node.SetAndObserveMesh(in_ras(shape_lps))
    state = display.StartModify()
    keep_colour(node, colour)
    display.SetColor(*colour)
    display.SetSelectedColor(*colour)
    display.SetOpacity(opacity)
    display.SetScalarVisibility(False)
    display.SetVisibility2D(in_slices)
    display.SetSliceIntersectionThickness(2)
    display.SetAmbient(0.18)
    display.SetDiffuse(0.85)
    display.SetSpecular(shine)
    display.SetPower(20.0)
    display.SetBackfaceCulling(False)
    display.EndModify(state)
    return node


def keep_colour(node: Any, colour: Colour) -> None:
    """Remember the colour of a fresh result, for `set_stale`."""
    node.SetAttribute(COLOUR, " ".join(f"{c:.6f}" for c in colour))


def in_ras(shape_lps: Any) -> Any:
    """A vtkPolyData in LPS turned into RAS, normals too; the argument stays as it is."""
    from vtkmodules.vtkCommonTransforms import vtkTransform
    from vtkmodules.vtkFiltersGeneral import vtkTransformPolyDataFilter

    turn = vtkTransform()
    turn.SetMatrix(vtk4(FLIP))
    turned = vtkTransformPolyDataFilter()
    turned.SetTransform(turn)
    turned.SetInputData(shape_lps)
    turned.Update()
    return turned.GetOutput()


def ring_disc(radius_mm: float) -> Any:
    """A ring's x-y plane as a vtkPolyData disc in the ring frame."""
    from vtkmodules.vtkFiltersSources import vtkRegularPolygonSource

    disc = vtkRegularPolygonSource()
    disc.SetNumberOfSides(96)
    disc.SetRadius(radius_mm)
    disc.SetCenter(0.0, 0.0, 0.0)
    disc.SetNormal(0.0, 0.0, 1.0)
    disc.Update()
    return disc.GetOutput()


def set_stale(scene: Any, prefixes: Iterable[str], stale: bool) -> None:
    """Show what was computed from older inputs grey, and in its colour again (H40)."""
    for prefix in prefixes:
        for node in nodes_of(scene, prefix):
            kept = node.GetAttribute(COLOUR)
            display = node.GetDisplayNode() if node.IsA("vtkMRMLDisplayableNode") else None
            if display is None or kept is None:
                continue
            wanted = STALE_COLOUR if stale else tuple(float(c) for c in kept.split())
            shown = display.GetSelectedColor()
            if any(abs(a - b) > 1e-5 for a, b in zip(shown, wanted, strict=True)):
                display.SetSelectedColor(*wanted)
                if not node.IsA("vtkMRMLMarkupsNode"):
                    display.SetColor(*wanted)


def set_shown(scene: Any, prefixes: Iterable[str], shown: bool) -> None:
    """Show or hide all nodes of some roles."""
    for prefix in prefixes:
        for node in nodes_of(scene, prefix):
            display = node.GetDisplayNode() if node.IsA("vtkMRMLDisplayableNode") else None
            if display is not None:
                display.SetVisibility(shown)
