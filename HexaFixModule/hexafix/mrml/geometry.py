"""LPS to RAS and back, in one place: every matrix and point on its way into or out of a node.

Both frames share their z axis; x and y change sign, which is a half turn about z, not a mirror.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import Refused

FLIP = np.diag([-1.0, -1.0, 1.0, 1.0])
"""LPS to RAS, its own inverse, shape (4, 4)."""

FLIP.setflags(write=False)

RIGID_TOLERANCE = 1e-6
"""How far a node's rotation matrix may be from one; a widget's float arithmetic stays below."""


def ras_points(points_lps_mm: ArrayLike) -> NDArray[np.float64]:
    """Points, shape (..., 3), LPS mm, in RAS mm."""
    return np.asarray(points_lps_mm, float) * np.diag(FLIP)[:3]


lps_points = ras_points
"""Points, shape (..., 3), RAS mm, in LPS mm."""


def vtk4(matrix: ArrayLike) -> Any:
    """A vtkMatrix4x4 of a matrix, shape (4, 4); no frame is changed."""
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    out = vtkMatrix4x4()
    out.DeepCopy([float(x) for x in np.asarray(matrix, float).ravel()])
    return out


def array4(matrix: Any) -> NDArray[np.float64]:
    """A vtkMatrix4x4 as an array, shape (4, 4); no frame is changed."""
    return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)])


def vtk_of_motion(moving_lps: ArrayLike) -> Any:
    """A vtkMatrix4x4 in RAS of the matrix that moves points in LPS mm, shape (4, 4)."""
    return vtk4(FLIP @ np.asarray(moving_lps, float) @ FLIP)


def motion_of_vtk(matrix: Any) -> NDArray[np.float64]:
    """The matrix, shape (4, 4), that moves points in LPS mm, of a vtkMatrix4x4 in RAS."""
    return FLIP @ array4(matrix) @ FLIP


def require_rigid(matrix_lps: NDArray[np.float64], *, what: str) -> NDArray[np.float64]:
    """The matrix, shape (4, 4), its rotation cleaned of rounding.

    Raises
    ------
    Refused
        If it scales, shears or mirrors (H36), or is not finite.
    """
    turn = matrix_lps[:3, :3]
    departure = np.inf
    if np.all(np.isfinite(matrix_lps)):
        departure = float(np.abs(turn.T @ turn - np.eye(3)).max())
    if departure > RIGID_TOLERANCE or np.linalg.det(turn) < 0:
        raise Refused.of(
            "transform-not-rigid",
            f"the {what} scales, shears or mirrors",
            value=f"{departure:.2g}",
            limit=f"{RIGID_TOLERANCE:g}",
            hazard="H36",
            next_step="use translation and rotation only; undo the last change of the transform",
        )
    left, _, right = np.linalg.svd(turn)
    clean = np.eye(4)
    clean[:3, :3] = left @ right
    clean[:3, 3] = matrix_lps[:3, 3]
    return clean
