"""Ranges, means and deviations as the paper's Tables 1 and 2 give them, and what it printed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

COLUMNS = ("x_mm", "y_mm", "z_mm", "alpha_deg", "beta_deg", "gamma_deg")


@dataclass(frozen=True, eq=False)
class Summary:
    """Statistics of K pose vectors, millimetres and degrees.

    Attributes
    ----------
    poses : int
    low, high, mean, deviation : ndarray, shape (6,)
        Of x y z α β γ; deviations with K - 1.
    volume_mean, volume_deviation : ndarray, shape (2,)
        Of the lengths of position and orientation. Source: Eq. (28).
    pooled_mean, pooled_deviation : ndarray, shape (2,)
        Over x y z together and over α β γ together, as under Table 2.
    """

    poses: int
    low: Array
    high: Array
    mean: Array
    deviation: Array
    volume_mean: Array
    volume_deviation: Array
    pooled_mean: Array
    pooled_deviation: Array

    @classmethod
    def of(cls, vectors: ArrayLike) -> Summary:
        """Statistics of pose vectors, shape (K, 6), mm and radians."""
        values = np.array(vectors, float)
        values[:, 3:] = np.degrees(values[:, 3:])
        halves = np.stack([values[:, :3], values[:, 3:]], axis=1)
        volume = np.linalg.norm(halves, axis=-1)
        pooled = np.moveaxis(halves, 1, 0).reshape(2, -1)
        return cls(
            poses=len(values),
            low=values.min(axis=0),
            high=values.max(axis=0),
            mean=values.mean(axis=0),
            deviation=values.std(axis=0, ddof=1),
            volume_mean=volume.mean(axis=0),
            volume_deviation=volume.std(axis=0, ddof=1),
            pooled_mean=pooled.mean(axis=1),
            pooled_deviation=pooled.std(axis=1, ddof=1),
        )

    @property
    def volume_error(self) -> Array:
        """Standard error of the mean volume errors, shape (2,), mm and degrees."""
        return self.volume_deviation / np.sqrt(self.poses)

    def as_json(self) -> dict[str, Any]:
        """By name, units in the keys."""
        rows = {
            name: dict(zip(COLUMNS, getattr(self, name).tolist(), strict=True))
            for name in ("low", "high", "mean", "deviation")
        }
        pairs = {
            f"{name}_{unit}": float(getattr(self, name)[k])
            for name in ("volume_mean", "volume_deviation", "volume_error",
                         "pooled_mean", "pooled_deviation")
            for k, unit in enumerate(("mm", "deg"))
        }  # fmt: skip
        return {"poses": self.poses, **rows, **pairs}


@dataclass(frozen=True)
class Printed:
    """Rows of a printed table, mm and degrees.

    Attributes
    ----------
    source : str
    low, high : tuple of float
    mean, deviation : tuple of float or None
    volume : tuple of float or None
        Mean and deviation in mm, mean and deviation in degrees.
    pooled : tuple of float or None
        The same over all components.
    """

    source: str
    low: tuple[float, ...]
    high: tuple[float, ...]
    mean: tuple[float, ...] | None = None
    deviation: tuple[float, ...] | None = None
    volume: tuple[float, ...] | None = None
    pooled: tuple[float, ...] | None = None


TABLE_1 = Printed(
    "Table 1",
    low=(-0.32, -0.39, -0.23, -0.10, -0.15, -0.12),
    high=(0.36, 0.40, 0.33, 0.22, 0.21, 0.09),
    mean=(0.062, -0.036, 0.028, 0.019, 0.024, -0.015),
    deviation=(0.227, 0.274, 0.185, 0.102, 0.107, 0.064),
    volume=(0.368, 0.130, 0.151, 0.045),
)
TABLE_2_BEFORE = Printed(
    "Table 2, before",
    low=(-12.87, -13.19, 6.18, -7.41, -8.32, -2.43),
    high=(9.78, 16.80, 20.75, 6.76, 4.54, 3.55),
)
TABLE_2 = Printed(
    "Table 2, after",
    low=(-1.04, -0.79, 0.0, -0.23, -0.26, -0.21),
    high=(0.65, 1.05, 1.24, 0.18, 0.24, 0.21),
    mean=(-0.148, 0.263, 0.529, -0.073, -0.057, 0.037),
    deviation=(0.618, 0.496, 0.412, 0.178, 0.158, 0.139),
    pooled=(0.214, 0.573, -0.031, 0.161),
)
"""As printed in Section 5.2, from ten physical experiments."""
