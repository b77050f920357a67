"""Numbering the balls and recognising the poses of rings and mechanism (Eq. 4-19)."""

from hexafix.recognition.alternatives import Alternative
from hexafix.recognition.group_pose import ring_pose_by_groups
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM, RingPose, ring_pose, ring_poses
from hexafix.recognition.mechanism import MechanismPose, mechanism_pose
from hexafix.recognition.numbering import Numbering, RingNumbering, number_balls
from hexafix.recognition.user_numbering import check_user_numbering

__all__ = [
    "RING_RMS_LIMIT_MM",
    "Alternative",
    "MechanismPose",
    "Numbering",
    "RingNumbering",
    "RingPose",
    "check_user_numbering",
    "mechanism_pose",
    "number_balls",
    "ring_pose",
    "ring_pose_by_groups",
    "ring_poses",
]
