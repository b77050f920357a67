"""What the four kinds of correction ask of the bones."""

from __future__ import annotations

from hexafix.correction.deformity import Deformity, Side
from hexafix.correction.fragment import FragmentMotion, TargetPose
from hexafix.correction.landmarks import Landmarks, fit_landmarks

Correction = TargetPose | FragmentMotion | Landmarks | Deformity
"""One of the four kinds of the case file's `correction`."""

__all__ = [
    "Correction",
    "Deformity",
    "FragmentMotion",
    "Landmarks",
    "TargetPose",
    "planned_motion",
]


def planned_motion(correction: Correction, *, side: Side) -> TargetPose | FragmentMotion:
    """Motion of the moving fragment in image space; a target pose stays what it is.

    Parameters
    ----------
    correction : TargetPose, FragmentMotion, Landmarks or Deformity
    side : {'left', 'right'}
        The patient's limb; only a deformity's words depend on it.

    Raises
    ------
    InputError, Refused
        If the landmarks do not settle a rigid motion.
    """
    match correction:
        case TargetPose() | FragmentMotion():
            return correction
        case Landmarks():
            return fit_landmarks(correction).motion
        case Deformity():
            return correction.correction(side=side)
