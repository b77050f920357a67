"""A grid of a few voxels whose places are known without any library.

Its direction cosines are a product of 3-4-5 and 7-24-25 triangles, so that every place is a short
decimal; its values tell which voxel is which. Plain Python numbers only: NumPy is on trial too.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import product
from math import dist, inf

Point = tuple[float, float, float]

ROW: Point = (0.48, 0.64, -0.6)
"""Direction of growing i, LPS."""

COLUMN: Point = (0.1216, 0.6288, 0.768)
"""Direction of growing j, LPS."""

NORMAL: Point = (0.8688, -0.4416, 0.224)
"""ROW × COLUMN."""

ORIGIN: Point = (-71.5, 38.25, 1204.125)
"""Centre of voxel (0, 0, 0), LPS mm."""

BETWEEN_COLUMNS, BETWEEN_ROWS, BETWEEN_SLICES = 0.5, 0.75, 1.25
"""Pitch along i, j and k, mm."""

SIZE = (5, 4, 3)
"""Voxels along i, j and k: no two alike."""

PLACE_MM = 1e-3
"""A voxel farther from its place than this is misplaced."""

AGAINST: Point = (-1.086, 0.552, -0.28)
"""From slice to slice, -1.25 mm × NORMAL: the grid is left-handed."""


def place(i: float, j: float, k: float, step: Point = AGAINST) -> Point:
    """Centre of a voxel, LPS mm, by the formula of DICOM PS3.3 C.7.6.2.1.1.

    Parameters
    ----------
    i, j, k : float
    step : tuple of 3 floats
        From one slice to the next, mm.
    """
    x, y, z = (
        origin + BETWEEN_COLUMNS * i * row + BETWEEN_ROWS * j * column + k * along
        for origin, row, column, along in zip(ORIGIN, ROW, COLUMN, step, strict=True)
    )
    return x, y, z


def code(i: int, j: int, k: int) -> int:
    """The value of a voxel."""
    return 1000 * k + 10 * j + i


def codes_of_slice(k: int, size: tuple[int, int, int] = SIZE) -> list[int]:
    """Values of one slice, row after row."""
    return [code(i, j, k) for j in range(size[1]) for i in range(size[0])]


def worst_misplacement_mm(voxels: Iterable[tuple[Sequence[float], float]]) -> float:
    """How far the worst voxel lies from where its value belongs, mm.

    Parameters
    ----------
    voxels : iterable of (place, value)
        Every voxel of the grid: where a reader puts it in LPS, mm, and its value.

    Returns
    -------
    float
        Infinite if a voxel is missing, occurs twice or has a value that is none of the grid's.
    """
    expected = {code(i, j, k): place(i, j, k) for k, j, i in product(*map(range, reversed(SIZE)))}
    worst = 0.0
    for where, value in voxels:
        belongs = expected.pop(int(value), None)
        worst = inf if belongs is None else max(worst, dist(where, belongs))
    return inf if expected else worst
