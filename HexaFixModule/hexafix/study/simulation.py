"""The full simulation: balls displaced, measured with error, and recognised by HexaFix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import angles_xyz_fixed_from_matrix
from hexafix.recognition.groups import ring_poses_by_groups
from hexafix.study.error_model import ErrorModel
from hexafix.study.jacobians import least_squares_road
from hexafix.study.layouts import RingLayouts

Array = NDArray[np.float64]

METHODS = ("groups", "least-squares")
"""Both recognitions, in the order of the arrays."""


@dataclass(frozen=True, eq=False)
class FullKernel:
    """|ΔX| of both recognitions, and how much it differs from the linear models'.

    Each sample builds a ring with installation errors, displaces the ball centres by image errors
    and recognises the ring, which stands at the identity pose. The same standard normal numbers
    go through the linear models, so that their known expectation takes most of the chance out of
    the difference (control variate).

    Attributes
    ----------
    layouts : RingLayouts
        Recognisable ones (H16).
    errors : ErrorModel
    maps : ndarray, shape (G, 2, 6, 6N)
        Of `error_model.error_maps` for `METHODS`.
    index : ndarray of int, shape (G,)
    """

    layouts: RingLayouts
    errors: ErrorModel
    maps: Array
    index: NDArray[np.intp]

    @property
    def columns(self) -> int:
        """6N."""
        return 6 * self.layouts.markers

    @property
    def shape(self) -> tuple[int, int]:
        """Two methods, then their two differences."""
        return 4, 6

    def take(self, part: slice) -> FullKernel:
        """The same for some of the layouts."""
        return FullKernel(self.layouts.take(part), self.errors, self.maps[part], self.index[part])

    def sample(self, layout: int, normals: Array, out: Array) -> None:
        """Errors of one layout: standard normals (K, 6N) to `out`, shape (K, 24), mm, radians."""
        one = self.layouts.layout(layout)
        by_marker = normals.reshape(len(normals), len(one), 6)
        # Eq. (20) takes Δη as believed minus true, so the true place lies at r - ε.
        true = one.points_mm - by_marker[..., 3:] * self.errors.installation_sigma_mm
        seen = true + by_marker[..., :3] * self.errors.image_sigma_mm
        roads = (ring_poses_by_groups, least_squares_road(self.errors))
        for m, road in enumerate(roads):
            rotation, position = road(seen, one)
            full = np.abs(
                np.concatenate([position, angles_xyz_fixed_from_matrix(rotation)], axis=1)
            )
            out[:, 6 * m : 6 * m + 6] = full
            out[:, 12 + 6 * m : 18 + 6 * m] = full - np.abs(normals @ self.maps[layout, m].T)
