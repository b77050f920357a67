"""Where the marker balls sit on a ring."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, slots=True)
class MarkerSite:
    """One marker ball on a ring.

    Attributes
    ----------
    number : int
        The ball's number i.
    radius_mm : float
        t_i, distance of the centre from the ring's z axis.
    sweep_rad : float
        φ_i, angle from the ring's x axis about its z axis.
    height_mm : float
        h_i, signed distance of the centre from the ring's x-y plane.
    """

    number: int
    radius_mm: float
    sweep_rad: float
    height_mm: float


@dataclass(frozen=True)
class MarkerLayout:
    """The markers of one ring, in the order of their numbers.

    Attributes
    ----------
    sites : tuple of MarkerSite
    """

    sites: tuple[MarkerSite, ...]

    @classmethod
    def of(
        cls,
        *,
        radius_mm: Iterable[float],
        sweep_deg: Iterable[float],
        height_mm: Iterable[float],
        first_number: int = 1,
    ) -> MarkerLayout:
        """Layout from three columns, numbered from `first_number` up."""
        columns = zip(radius_mm, sweep_deg, height_mm, strict=True)
        return cls(
            tuple(
                MarkerSite(number, float(t), float(np.radians(phi)), float(h))
                for number, (t, phi, h) in enumerate(columns, start=first_number)
            )
        )

    def __len__(self) -> int:
        return len(self.sites)

    @property
    def numbers(self) -> tuple[int, ...]:
        """The balls' numbers."""
        return tuple(site.number for site in self.sites)

    @cached_property
    def points_mm(self) -> NDArray[np.float64]:
        """Ball centres r_i in the ring frame, shape (N, 3), mm, read-only. Source: Eq. (5)."""
        t = np.array([site.radius_mm for site in self.sites])
        phi = np.array([site.sweep_rad for site in self.sites])
        h = np.array([site.height_mm for site in self.sites])
        points = np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)
        points.setflags(write=False)
        return points

    @property
    def included_angles_rad(self) -> NDArray[np.float64]:
        """Δφ between neighbours around the ring, shape (N,), their sum 2π, from the first site.

        The sites are taken in the order of their sweep angles. Source: Section 2.3, Eq. (27).
        """
        phi = np.sort(np.mod([site.sweep_rad for site in self.sites], 2 * np.pi))
        return np.diff(np.append(phi, phi[0] + 2 * np.pi))
