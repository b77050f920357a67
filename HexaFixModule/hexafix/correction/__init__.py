"""From a recognised pose to a strut schedule (Eq. 31, 32 and beyond)."""

from hexafix.correction.compensation import (
    Compensation,
    CompensationMode,
    RecognisedRings,
    compensate,
    motion_between,
    reading_covariance,
    reading_resolution_mm,
    subtraction_departure_mm,
    target_of,
)
from hexafix.correction.landmarks import LandmarkFit, fit_landmarks
from hexafix.correction.path import Pace, RigidPath, WatchedPoints, watched_points
from hexafix.correction.schedule import ScheduleRow, StrutSchedule, make_schedule
from hexafix.correction.stroke import StrokeCheck
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
    "Pace",
    "RecognisedRings",
    "RigidPath",
    "ScheduleRow",
    "StrokeCheck",
    "StrutSchedule",
    "TargetPose",
    "WatchedPoints",
    "compensate",
    "fit_landmarks",
    "make_schedule",
    "motion_between",
    "planned_motion",
    "reading_covariance",
    "reading_resolution_mm",
    "subtraction_departure_mm",
    "target_of",
    "watched_points",
]
