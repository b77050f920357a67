"""Many layouts of one ring at once: what the studies vary."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.accuracy.layout_check import (
    ANGLE_TOLERANCE_DEG,
    PREFERRED_DEG,
    RELAXED_MIN_DEG,
    RELAXED_SPREAD_DEG,
)
from hexafix.errors import InputError
from hexafix.hardware import MarkerLayout, MarkerSite
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM, triangle_heights_mm

Array = NDArray[np.float64]

PAPER_RADIUS_MM, PAPER_HEIGHT_MM = 100.0, 20.0
"""Installation radius and height of Section 4.3."""


@dataclass(frozen=True, eq=False)
class RingLayouts:
    """G layouts of N markers each.

    Attributes
    ----------
    radius_mm, sweep_rad, height_mm : ndarray, shape (G, N)
        t_i, φ_i, h_i as in `MarkerSite`; read-only.
    """

    radius_mm: Array
    sweep_rad: Array
    height_mm: Array

    def __post_init__(self) -> None:
        for name in ("radius_mm", "sweep_rad", "height_mm"):
            column = np.array(getattr(self, name), float)
            column.setflags(write=False)
            object.__setattr__(self, name, column)
        if self.sweep_rad.ndim != 2 or self.sweep_rad.shape[1] < 3:
            raise InputError.of(
                "too-few-markers",
                "a ring's pose needs three markers",
                value=str(self.sweep_rad.shape[-1:]),
                limit="at least 3",
                hazard="H13",
            )

    @classmethod
    def of(
        cls,
        sweep_deg: ArrayLike,
        *,
        radius_mm: float = PAPER_RADIUS_MM,
        height_mm: float = PAPER_HEIGHT_MM,
    ) -> RingLayouts:
        """Layouts of one radius and height, sweep angles of shape (G, N)."""
        sweep = np.radians(np.asarray(sweep_deg, float))
        return cls(np.full(sweep.shape, radius_mm), sweep, np.full(sweep.shape, height_mm))

    def __len__(self) -> int:
        return len(self.sweep_rad)

    @property
    def markers(self) -> int:
        """N."""
        return self.sweep_rad.shape[1]

    @property
    def points_mm(self) -> Array:
        """Ball centres in the ring frames, shape (G, N, 3), mm. Source: Eq. (5)."""
        t, phi = self.radius_mm, self.sweep_rad
        return np.stack([t * np.cos(phi), t * np.sin(phi), self.height_mm], axis=-1)

    @property
    def included_angles_rad(self) -> Array:
        """Δφ between neighbours, from the first marker, shape (G, N). Source: Eq. (27)."""
        phi = np.sort(np.mod(self.sweep_rad, 2 * np.pi), axis=1)
        return np.diff(phi, axis=1, append=phi[:, :1] + 2 * np.pi)

    @property
    def groups(self) -> NDArray[np.intp]:
        """Markers j1, j2, j3 of each group, shape (G, N, 3). Source: Section 3.2."""
        around = np.argsort(np.mod(self.sweep_rad, 2 * np.pi), axis=1, kind="stable")
        count = self.markers
        steps = np.array([0, count // 3, 2 * count // 3])
        return around[:, (np.arange(count)[:, None] + steps) % count]

    @property
    def recognisable(self) -> NDArray[np.bool_]:
        """Whether no group is flatter than the limit of recognition, shape (G,) (H16)."""
        corners = self.points_mm[np.arange(len(self))[:, None, None], self.groups]
        return np.all(triangle_heights_mm(corners) >= MIN_TRIANGLE_HEIGHT_MM, axis=1)

    def layout(self, index: int) -> MarkerLayout:
        """One of the layouts, markers numbered from 1."""
        columns = zip(
            self.radius_mm[index].tolist(),
            self.sweep_rad[index].tolist(),
            self.height_mm[index].tolist(),
            strict=True,
        )
        return MarkerLayout(tuple(MarkerSite(i, *column) for i, column in enumerate(columns, 1)))

    def take(self, indices: NDArray[np.intp] | slice) -> RingLayouts:
        """Some of the layouts."""
        return RingLayouts(
            self.radius_mm[indices], self.sweep_rad[indices], self.height_mm[indices]
        )


def even_layout(markers: int) -> RingLayouts:
    """The one layout of N markers evenly around the ring. Source: Section 4.3.1."""
    return RingLayouts.of(np.arange(markers)[None] * (360.0 / markers))


def three_marker_layouts(step_deg: int = 5) -> RingLayouts:
    """Every ordered layout of three markers on a grid of sweep angles, the first at 0.

    Sorted by minimum, median and maximum included angle, as Fig. 7 sorts them.

    Notes
    -----
    Source: Section 4.3.2, Eq. (27): 2 485 layouts at 5°.
    """
    if step_deg < 1 or 360 % step_deg:
        raise InputError.of(
            "bad-step",
            "the step of the sweep angles must divide the circle",
            value=f"{step_deg}°",
            limit="a divisor of 360°",
        )
    first, second = np.triu_indices(360 // step_deg - 1, 1)
    sweep = np.stack([np.zeros_like(first), first + 1, second + 1], axis=1) * step_deg
    gaps = np.sort(np.diff(sweep, axis=1, append=360), axis=1)
    order = np.lexsort((sweep[:, 2], sweep[:, 1], gaps[:, 2], gaps[:, 1], gaps[:, 0]))
    return RingLayouts.of(sweep[order])


def angle_rules(layouts: RingLayouts) -> dict[str, NDArray[np.bool_]]:
    """Which three-marker layouts meet which rule, shape (G,) each.

    ``preferred`` and ``relaxed`` are the paper's; ``above-preferred`` takes its words "greater
    than 45°" literally; ``ninety`` is a stricter rule for comparison. Source: Section 4.3.2.
    """
    gaps = np.sort(np.degrees(layouts.included_angles_rad), axis=1)
    smallest, median, largest = gaps.T
    slack = ANGLE_TOLERANCE_DEG
    return {
        "preferred": smallest >= PREFERRED_DEG - slack,
        "above-preferred": smallest > PREFERRED_DEG + slack,
        "relaxed": (smallest >= RELAXED_MIN_DEG - slack)
        & (largest - median <= RELAXED_SPREAD_DEG + slack),
        "ninety": smallest >= 90.0 - slack,
    }
