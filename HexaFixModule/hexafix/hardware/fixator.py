"""A hexapod fixator: two rings and six struts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.hardware.holes import Places


@dataclass(frozen=True, eq=False)
class Ring:
    """One fixation ring.

    Attributes
    ----------
    joints_mm : ndarray, shape (6, 3)
        Joint centres of struts 1 to 6 in the ring frame ({A}: a_l, {B}: b_l), mm, read-only.
    thickness_mm : float
        Thickness of the plate; the ring frame's origin lies in the upper plane.
    outer_radius_mm : float
        Outer radius of the plate.
    holes : HoleCircle or SiteList, optional
        Where marker rods can be put, where the definition says so.
    """

    joints_mm: NDArray[np.float64]
    thickness_mm: float
    outer_radius_mm: float
    holes: Places | None = None

    def __post_init__(self) -> None:
        joints = np.array(self.joints_mm, float)
        joints.setflags(write=False)
        object.__setattr__(self, "joints_mm", joints)


@dataclass(frozen=True, slots=True)
class StrutType:
    """The stroke of the struts, joint centre to joint centre.

    Attributes
    ----------
    min_mm, max_mm : float
        Shortest and longest length.
    scale_offset_mm : float
        Length minus scale reading.
    """

    min_mm: float
    max_mm: float
    scale_offset_mm: float = 0.0


@dataclass(frozen=True, eq=False)
class Fixator:
    """A hardware definition.

    Attributes
    ----------
    id, name, source : str
        Identity, a name for people, and where the numbers come from.
    proximal, distal : Ring
        The moving ring {A} and the base ring {B}.
    strut : StrutType
    """

    id: str
    name: str
    source: str
    proximal: Ring
    distal: Ring
    strut: StrutType
