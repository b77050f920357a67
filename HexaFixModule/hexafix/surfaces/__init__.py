"""Shapes of fixator and bone as VTK meshes, LPS mm: what every door shows in its 3D view.

VTK is loaded at the first call. Nothing here renders.
"""

from hexafix.surfaces.bone import bone_surface, metal_surface
from hexafix.surfaces.colours import (
    AXIS_COLOURS,
    BALL_COLOUR,
    BONE_COLOUR,
    STALE_COLOUR,
    STEEL_COLOUR,
    ring_colour,
    strut_colour,
)
from hexafix.surfaces.frame import (
    axes,
    ball_spheres,
    joint_spheres,
    ring_plate,
    spheres,
    strut_tubes,
)

__all__ = [
    "AXIS_COLOURS",
    "BALL_COLOUR",
    "BONE_COLOUR",
    "STALE_COLOUR",
    "STEEL_COLOUR",
    "axes",
    "ball_spheres",
    "bone_surface",
    "joint_spheres",
    "metal_surface",
    "ring_colour",
    "ring_plate",
    "spheres",
    "strut_colour",
    "strut_tubes",
]
