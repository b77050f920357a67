"""From a recognised pose to a strut schedule (Eq. 31, 32 and beyond)."""

from hexafix.correction.compensation import (
    Compensation,
    CompensationMode,
    RecognisedRings,
    compensate,
    motion_between,
    target_of,
)
from hexafix.correction.landmarks import LandmarkFit, fit_landmarks
from hexafix.correction.targets import (
    Correction,
    Deformity,
    FragmentMotion,
    Landmarks,
    TargetPose,
    planned_motion,
)

__all__ = [
    "Compensation",
    "CompensationMode",
    "Correction",
    "Deformity",
    "FragmentMotion",
    "LandmarkFit",
    "Landmarks",
    "RecognisedRings",
    "TargetPose",
    "compensate",
    "fit_landmarks",
    "motion_between",
    "planned_motion",
    "target_of",
]
