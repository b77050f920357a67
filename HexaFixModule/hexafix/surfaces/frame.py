"""Rings, struts, joints, balls and axes of a scene as meshes, LPS mm.

At a scene whose ring poses are the identity the same functions give the shapes in ring frames.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.report.scene import SceneGeometry, transform
from hexafix.report.vtk_child import plate, sphere, tube
from hexafix.surfaces.meshes import joined, vtk_classes

ROUNDNESS = 24
"""Sides of a ball."""

JOINT_RADIUS_MM, BOSS_RADIUS_MM = 6.0, 8.0
"""A joint's sphere, and the boss that carries it on the plate."""

BARREL_RADIUS_MM, ROD_RADIUS_MM, BARREL_SHARE = 5.5, 3.4, 0.38
"""A strut's barrel at its distal end, its rod, and where along it the barrel ends."""

MARK_LENGTH_MM, MARK_RADIUS_MM = 14.0, 7.0
"""The cone on the rim that points along the ring's x axis, its front."""

AXIS_RADIUS_MM, TIP_LENGTH_MM, TIP_RADIUS_MM = 1.1, 9.0, 3.2


def ring_plate(scene: SceneGeometry, ring: str) -> Any:
    """A ring's plate with its hole, a boss to each joint and a cone on the rim at its front.

    Parameters
    ----------
    scene : SceneGeometry
    ring : str
        ``proximal`` or ``distal``.

    Returns
    -------
    vtkPolyData
        Triangles in LPS mm, normals outwards.
    """
    v = vtk_classes()
    hardware, pose = scene.ring(ring), scene.ring_pose(ring)
    joints = hardware.joints_mm
    feet = joints.copy()
    feet[:, 2] = np.clip(joints[:, 2], -hardware.thickness_mm, 0.0)
    parts = [plate(v, scene.plate_mm(ring))]
    for foot, joint in zip(feet, joints, strict=True):
        if np.linalg.norm(joint - foot) > 0.0:
            start, end = transform(pose, [foot, joint])
            parts.append(tube(v, start, end, BOSS_RADIUS_MM))
    rim = [hardware.outer_radius_mm, 0.0, -hardware.thickness_mm / 2]
    parts.append(_cone(v, transform(pose, rim), pose[:3, 0], MARK_LENGTH_MM, MARK_RADIUS_MM))
    return joined(parts)


def strut_tubes(scene: SceneGeometry) -> tuple[Any, ...]:
    """Struts 1 to 6, each a vtkPolyData of barrel and rod between its two joint centres."""
    v = vtk_classes()
    struts = []
    for top, bottom in zip(scene.joints_mm("proximal"), scene.joints_mm("distal"), strict=True):
        end = bottom + BARREL_SHARE * (top - bottom)
        barrel = tube(v, bottom, end, BARREL_RADIUS_MM)
        struts.append(joined([barrel, tube(v, bottom, top, ROD_RADIUS_MM)]))
    return tuple(struts)


def strut_middles_mm(scene: SceneGeometry) -> tuple[tuple[float, float, float], ...]:
    """The middles of struts 1 to 6 in LPS, mm: where their numbers are written."""
    middles = 0.5 * (scene.joints_mm("proximal") + scene.joints_mm("distal"))
    return tuple((float(x), float(y), float(z)) for x, y, z in middles)


def joint_spheres(scene: SceneGeometry, ring: str) -> Any:
    """The six joints of ring ``proximal`` or ``distal`` as one vtkPolyData."""
    return spheres(scene.joints_mm(ring), diameters_mm=2 * JOINT_RADIUS_MM)


def ball_spheres(scene: SceneGeometry, ring: str | None = None) -> dict[int, Any]:
    """The numbered marker balls of a ring, or of both: a vtkPolyData by number."""
    return {
        ball.number: spheres([ball.center_mm], diameters_mm=ball.diameter_mm)
        for ball in scene.balls
        if ring in (None, ball.ring)
    }


def spheres(centers_mm: ArrayLike | Iterable[ArrayLike], *, diameters_mm: ArrayLike) -> Any:
    """One vtkPolyData of spheres.

    Parameters
    ----------
    centers_mm : array_like, shape (N, 3)
        LPS mm; may be empty.
    diameters_mm : float or array_like, shape (N,)
    """
    v = vtk_classes()
    centers = np.asarray(centers_mm, float).reshape(-1, 3)
    diameters = np.broadcast_to(np.asarray(diameters_mm, float), (len(centers),))
    return joined(
        sphere(v, c, d / 2, resolution=ROUNDNESS) for c, d in zip(centers, diameters, strict=True)
    )


def axes(pose_lps: ArrayLike, *, length_mm: float) -> tuple[Any, Any, Any]:
    """The x, y and z arrows of a frame.

    Parameters
    ----------
    pose_lps : array_like, shape (4, 4)
        Frame coordinates to LPS mm.
    length_mm : float
        From the origin to each tip.

    Returns
    -------
    tuple of three vtkPolyData
    """
    v = vtk_classes()
    pose = np.asarray(pose_lps, float)
    origin, arrows = pose[:3, 3], []
    for along in pose[:3, :3].T:
        neck = origin + (length_mm - TIP_LENGTH_MM) * along
        tip = _cone(v, neck, along, TIP_LENGTH_MM, TIP_RADIUS_MM)
        arrows.append(joined([tube(v, origin, neck, AXIS_RADIUS_MM), tip]))
    x, y, z = arrows
    return x, y, z


def _cone(
    v: Any,
    base_mm: NDArray[np.float64],
    along: NDArray[np.float64],
    length_mm: float,
    radius_mm: float,
) -> Any:
    """A cone from its base's centre along a unit vector."""
    cone = v.vtkConeSource()
    cone.SetResolution(24)
    cone.SetHeight(length_mm)
    cone.SetRadius(radius_mm)
    cone.SetDirection(*(float(x) for x in along))
    cone.SetCenter(*(float(x) for x in base_mm + 0.5 * length_mm * along))
    return cone
