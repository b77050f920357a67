"""What the image alone tells, as one value."""

from __future__ import annotations

from dataclasses import dataclass

from hexafix.gates import Gate
from hexafix.hardware import Fixator
from hexafix.imaging import Volume
from hexafix.markers import BallSet
from hexafix.recognition import MechanismPose, Numbering, RingPose


@dataclass(frozen=True, eq=False)
class Recognised:
    """What the image alone tells.

    Attributes
    ----------
    volume : Volume
    balls : BallSet
    numbering : Numbering
    proximal, distal : RingPose
        By covariance-weighted least squares.
    proximal_by_groups, distal_by_groups : RingPose
        By the paper's group method, for comparison.
    mechanism : MechanismPose
        X_r, {A} in {B}.
    gates : tuple of Gate
        G2 to G5, G7 and the side, decided or not.
    fixator : Fixator
    """

    volume: Volume
    balls: BallSet
    numbering: Numbering
    proximal: RingPose
    distal: RingPose
    proximal_by_groups: RingPose
    distal_by_groups: RingPose
    mechanism: MechanismPose
    gates: tuple[Gate, ...]
    fixator: Fixator
