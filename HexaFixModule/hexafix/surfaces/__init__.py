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
    strut_middles_mm,
    strut_tubes,
)
from hexafix.surfaces.slices import (
    AXIAL,
    CORONAL,
    SAGITTAL,
    SLICE_VIEWS,
    SliceView,
    at_place,
    ball_at,
    balls_middle_mm,
    cut,
    half_height_mm,
    in_slice,
    look_at_slice,
    middle_mm,
    nearest_place,
    slice_image,
    slice_places_mm,
)

__all__ = [
    "AXIAL",
    "AXIS_COLOURS",
    "BALL_COLOUR",
    "BONE_COLOUR",
    "CORONAL",
    "SAGITTAL",
    "SLICE_VIEWS",
    "STALE_COLOUR",
    "STEEL_COLOUR",
    "SliceView",
    "at_place",
    "axes",
    "ball_at",
    "ball_spheres",
    "balls_middle_mm",
    "bone_surface",
    "cut",
    "half_height_mm",
    "in_slice",
    "joint_spheres",
    "look_at_slice",
    "metal_surface",
    "middle_mm",
    "nearest_place",
    "ring_colour",
    "ring_plate",
    "slice_image",
    "slice_places_mm",
    "spheres",
    "strut_colour",
    "strut_middles_mm",
    "strut_tubes",
]
