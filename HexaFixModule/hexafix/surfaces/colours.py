"""Colours of the shapes, red, green and blue from 0 to 1: those of the printed prescription."""

from __future__ import annotations

from hexafix.report import vtk_child
from hexafix.report.words import RING_COLOURS, STRUT_COLOURS

BONE_COLOUR, STEEL_COLOUR, BALL_COLOUR = vtk_child.IVORY, vtk_child.STEEL, vtk_child.BALL

STALE_COLOUR = (0.55, 0.55, 0.55)
"""What was computed from older inputs is shown in this grey (H40)."""

AXIS_COLOURS = ((0.85, 0.15, 0.15), (0.15, 0.6, 0.2), (0.15, 0.35, 0.85))
"""x, y and z of a ring frame."""


def ring_colour(ring: str) -> tuple[float, float, float]:
    """The colour of ring ``proximal`` or ``distal``."""
    return _rgb(RING_COLOURS[ring])


def strut_colour(strut: int) -> tuple[float, float, float]:
    """The colour of strut 1 to 6."""
    if not 1 <= strut <= len(STRUT_COLOURS):
        raise IndexError("struts are numbered 1 to 6")
    return _rgb(STRUT_COLOURS[strut - 1].fill)


def _rgb(colour: str) -> tuple[float, float, float]:
    red, green, blue = (int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5))
    return red, green, blue
