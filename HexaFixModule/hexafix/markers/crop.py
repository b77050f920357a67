"""The voxels around one candidate, sampled by cubic splines at LPS points."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from hexafix.imaging.volume import Volume

MOVED_MM = 1e-4
"""A slice that lies farther aside of the one before it was moved between its voxels."""


LONE_VOXELS = 3
"""So few voxels at the greatest value of a crop are noise, not the scanner's ceiling."""


@dataclass(frozen=True, eq=False)
class Crop:
    """A small box of a volume.

    Attributes
    ----------
    voxels : ndarray, shape (K, J, I)
        HU as floats.
    first_ijk : ndarray, shape (3,)
        Volume index of the crop's first voxel.
    volume : Volume
        Where it was taken from.
    """

    voxels: NDArray[np.float64]
    first_ijk: NDArray[np.int64]
    volume: Volume

    @classmethod
    def around(cls, volume: Volume, center_mm: NDArray[np.float64], reach_mm: float) -> Crop:
        """The box that holds every voxel within `reach_mm` of a point, LPS mm."""
        middle = volume.ijk_from_lps(center_mm)
        reach = reach_mm * np.linalg.norm(np.linalg.inv(volume.ijk_to_lps[:3, :3]), axis=1)
        first = np.maximum(np.floor(middle - reach).astype(int), 0)
        last = np.minimum(np.ceil(middle + reach).astype(int) + 1, volume.size_ijk)
        box = volume.voxels[first[2] : last[2], first[1] : last[1], first[0] : last[0]]
        return cls(np.array(box, float), first, volume)

    @cached_property
    def _spline(self) -> NDArray[np.float64]:
        return scipy.ndimage.spline_filter(self.voxels, order=3, mode="mirror")

    def sample(
        self, points_mm: NDArray[np.float64], order: Literal[1, 3] = 3
    ) -> NDArray[np.float64]:
        """HU at LPS points, shape (..., 3) to (...), by the spline of order 3 or 1."""
        index = (self.volume.ijk_from_lps(points_mm) - self.first_ijk)[..., ::-1].reshape(-1, 3)
        source = self._spline if order == 3 else self.voxels
        values = scipy.ndimage.map_coordinates(
            source, index.T, order=order, mode="mirror", prefilter=False
        )
        return values.reshape(points_mm.shape[:-1])

    @cached_property
    def points_mm(self) -> NDArray[np.float64]:
        """LPS of every voxel, shape (K, J, I, 3), mm."""
        a = self.volume.ijk_to_lps
        k, j, i = (np.arange(n)[:, None] for n in self.voxels.shape)
        first = a[:3, :3] @ self.first_ijk + a[:3, 3]
        plane = (j * a[:3, 1])[:, None] + (i * a[:3, 0])[None]
        return (first + k * a[:3, 2])[:, None, None] + plane

    def core(
        self, center_mm: NDArray[np.float64], reach_mm: float
    ) -> tuple[float, float, float, float]:
        """HU within a distance of a point, LPS mm.

        Returns
        -------
        tuple of float
            Median, robust standard deviation, share clipped at the crop's greatest value, 5th
            percentile.
        """
        index = self.volume.ijk_from_lps(center_mm + reach_mm * _BALL) - self.first_ijk
        index = np.rint(index).astype(int)
        np.clip(index, 0, np.array(self.voxels.shape)[::-1] - 1, out=index)
        values = self.voxels[index[:, 2], index[:, 1], index[:, 0]]
        middle = float(np.median(values))
        noise = 1.4826 * float(np.median(np.abs(values - middle)))
        # A scanner's ceiling is met by many voxels; of a noisy core's voxels one is the brightest.
        ceiling = np.count_nonzero(self.voxels == self.brightest) > LONE_VOXELS
        clipped = float(np.mean(values >= self.brightest)) if ceiling else 0.0
        return middle, noise, clipped, float(np.quantile(values, 0.05))

    def clipped(self, clip_hu: float) -> NDArray[np.bool_]:
        """Voxels that the clipping spoils, shape (K, J, I).

        Where slices of a tilted gantry were moved, a neighbour of a clipped voxel on the way they
        were moved is a mixture with a clipped one.
        """
        clipped = self.voxels >= clip_hu
        acquired = self.volume.source.acquisition
        if acquired is None:
            return clipped
        i, j, _ = np.abs(self.volume.direction.T @ acquired.ijk_to_lps[:3, 2]) > MOVED_MM
        return scipy.ndimage.binary_dilation(
            clipped, np.ones((1, 3 if j else 1, 3 if i else 1), bool)
        )

    @cached_property
    def is_mask(self) -> bool:
        """Whether nearly all voxels have one of two values: a segmented image, not a CT."""
        ends = (self.voxels == self.voxels.min()) | (self.voxels == self.brightest)
        return bool(np.mean(ends) > 0.99)

    @cached_property
    def brightest(self) -> float:
        """The greatest value of the crop."""
        return float(self.voxels.max())


def _ball_lattice(count: int) -> NDArray[np.float64]:
    """Points of a cubic lattice in the unit ball, `count` across."""
    line = np.linspace(-1.0, 1.0, count)
    points = np.stack(np.meshgrid(line, line, line), -1).reshape(-1, 3)
    return points[np.einsum("ni,ni->n", points, points) <= 1.0]


_BALL = _ball_lattice(9)
