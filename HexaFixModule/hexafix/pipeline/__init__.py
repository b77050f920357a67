"""The straight line from a CT to a prescription; each step takes and returns a frozen value.

read_volume → find_balls → number_balls → ring_pose, mechanism_pose → check_layouts →
forward_kinematics → correction target, compensation → make_schedule → report → export
"""

from hexafix.pipeline.layout import check_case_layout
from hexafix.pipeline.plan import Plan, plan_correction
from hexafix.pipeline.prescribe import plan_and_export
from hexafix.pipeline.recognise import find_markers, recognise, recognise_case
from hexafix.pipeline.recognised import Recognised

__all__ = [
    "Plan",
    "Recognised",
    "check_case_layout",
    "find_markers",
    "plan_and_export",
    "plan_correction",
    "recognise",
    "recognise_case",
]
