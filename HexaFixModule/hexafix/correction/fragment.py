"""Which bone fragment moves, and how."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from hexafix.geometry import Pose

Moving = Literal["proximal", "distal"]
"""The fragment, with its ring, that the correction moves; the other one is the reference."""


@dataclass(frozen=True)
class FragmentMotion:
    """A rigid motion of one bone fragment in image space.

    Attributes
    ----------
    moving : {'proximal', 'distal'}
    motion : Pose
        M in LPS, mm: the fragment's point p goes to M p while the other fragment rests.
    """

    moving: Moving
    motion: Pose


@dataclass(frozen=True)
class TargetPose:
    """Where the proximal ring shall truly stand on the distal ring at the end.

    Attributes
    ----------
    pose : Pose
        {A} in {B}, mm.
    """

    pose: Pose

    @property
    def moving(self) -> Moving:
        """The proximal ring {A} is the moving one. Source: Section 2.2."""
        return "proximal"
