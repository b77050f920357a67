"""Numbering the balls and recognising the poses of rings and mechanism (Eq. 4-19)."""

from hexafix.recognition.group_pose import ring_pose_by_groups
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM, RingPose, ring_pose, ring_poses
from hexafix.recognition.mechanism import MechanismPose, mechanism_pose

__all__ = [
    "RING_RMS_LIMIT_MM",
    "MechanismPose",
    "RingPose",
    "mechanism_pose",
    "ring_pose",
    "ring_pose_by_groups",
    "ring_poses",
]
