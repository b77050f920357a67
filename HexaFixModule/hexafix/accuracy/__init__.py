"""Layout rules, uniqueness and predicted pose error (Section 4)."""

from hexafix.accuracy.advice import Suggestion, better_layout, check_layouts
from hexafix.accuracy.advised import Advice, AdviceRules, RingPlaces, RingTask
from hexafix.accuracy.advisor import advise
from hexafix.accuracy.joint_error import ErrorTarget
from hexafix.accuracy.layout_check import LayoutCheck, LayoutVerdict, angle_rule, check_layout
from hexafix.accuracy.layout_gate import layout_faults

__all__ = [
    "Advice",
    "AdviceRules",
    "ErrorTarget",
    "LayoutCheck",
    "LayoutVerdict",
    "RingPlaces",
    "RingTask",
    "Suggestion",
    "advise",
    "angle_rule",
    "better_layout",
    "check_layout",
    "check_layouts",
    "layout_faults",
]
