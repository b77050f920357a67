"""What every reader tells the user about slices and grey values."""

from __future__ import annotations

from collections.abc import Iterator

THICK_SLICES_MM = 2.0
_AIR_SEEN_HU = -900


def thick_slices(spacing_mm: float, *, thickest_mm: float | None = None) -> Iterator[str]:
    """Told where slices are too thick for exact balls.

    Parameters
    ----------
    spacing_mm : float
        Between slices.
    thickest_mm : float, optional
        The thickest slice by its header, where that is known.
    """
    if max(spacing_mm, thickest_mm or 0.0) > THICK_SLICES_MM:
        yield f"thick slices (spacing {spacing_mm:.2f} mm): ball centres are less accurate"


def no_air(lowest_hu: float) -> Iterator[str]:
    """Told where no voxel is air, so that the values may be no Hounsfield units (H10)."""
    if lowest_hu > _AIR_SEEN_HU:
        yield f"no air (H10): the lowest value is {lowest_hu:.0f} HU"
