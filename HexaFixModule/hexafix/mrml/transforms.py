"""Where rings and fragments stand: linear transforms that move points, their matrices in RAS.

A transform's file holds the inverse, in LPS: what reads it as the motion itself would move the bone
the wrong way (H36). `motion_lps` is the only way a matrix leaves a node.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.mrml.geometry import motion_of_vtk, ras_points, vtk_of_motion
from hexafix.mrml.nodes import ensure, find

CLASS = "vtkMRMLLinearTransformNode"

RING = {"proximal": "transform/ring/proximal", "distal": "transform/ring/distal"}
"""Ring coordinates to the patient, as shown now."""

FRAGMENT = "transform/fragment"
"""What moves the moving fragment and its ring's balls from where the CT shows them."""

TARGET = "transform/target/fragment"
"""The wished motion of the moving fragment; the user drags it."""

TARGET_RING = "transform/target/ring"
"""The moving ring as the CT shows it, below `TARGET`: together where it shall end."""


def put_transform(scene: Any, role: str, name: str, moving_lps: ArrayLike) -> Any:
    """The transform node of a role with this matrix.

    Parameters
    ----------
    scene : vtkMRMLScene
    role, name : str
    moving_lps : array_like, shape (4, 4)
        Moves points, LPS mm.
    """
    node = ensure(scene, CLASS, role, name)
    wanted = np.asarray(moving_lps, float)
    if not np.array_equal(motion_lps(node), wanted):
        node.SetMatrixTransformToParent(vtk_of_motion(wanted))
    return node


def motion_lps(node: Any) -> NDArray[np.float64]:
    """The 4×4 matrix by which a transform node moves points, LPS mm, without its parents."""
    matrix = vtk_of_motion(np.eye(4))
    node.GetMatrixTransformToParent(matrix)
    return motion_of_vtk(matrix)


def put_below(node: Any, transform: Any | None) -> None:
    """Let `node` move with `transform`, or with nothing."""
    wanted = transform.GetID() if transform is not None else None
    if node.GetTransformNodeID() != wanted:
        node.SetAndObserveTransformNodeID(wanted)


def set_handles(scene: Any, *, shown: bool, center_lps_mm: ArrayLike | None = None) -> None:
    """Show or hide the handles by which the user drags the wished motion; they never scale."""
    node = find(scene, TARGET)
    if node is None:
        return
    if node.GetDisplayNode() is None:
        node.CreateDefaultDisplayNodes()
    display = node.GetDisplayNode()
    for part in ("", "Slice"):
        getattr(display, f"SetEditorTranslation{part}Enabled")(True)
        getattr(display, f"SetEditorRotation{part}Enabled")(True)
        getattr(display, f"SetEditorScaling{part}Enabled")(False)
    if center_lps_mm is not None:
        x, y, z = (float(v) for v in ras_points(center_lps_mm))
        node.SetCenterOfTransformation(x, y, z)
    display.SetVisibility(shown)
    display.SetEditorVisibility(shown)
    display.SetEditorVisibility3D(shown)
    display.SetEditorSliceIntersectionVisibility(shown)
