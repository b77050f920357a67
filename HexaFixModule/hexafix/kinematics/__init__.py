"""Inverse and forward kinematics of the 6-SPS mechanism, batched."""

from hexafix.kinematics.basin import BasinCheck, second_starts
from hexafix.kinematics.forward import (
    MAX_CONDITION,
    ForwardSolution,
    forward_kinematics,
    forward_kinematics_batch,
)
from hexafix.kinematics.inverse import (
    condition_number,
    joint_radius_mm,
    strut_jacobian,
    strut_jacobian_batch,
    strut_lengths,
    strut_lengths_batch,
)
from hexafix.kinematics.newton import ForwardBatch

__all__ = [
    "MAX_CONDITION",
    "BasinCheck",
    "ForwardBatch",
    "ForwardSolution",
    "condition_number",
    "forward_kinematics",
    "forward_kinematics_batch",
    "joint_radius_mm",
    "second_starts",
    "strut_jacobian",
    "strut_jacobian_batch",
    "strut_lengths",
    "strut_lengths_batch",
]
