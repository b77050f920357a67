"""The safety gates G2 to G9: a value, its limit, and a red gate refuses.

Each function compares numbers that the steps computed and returns one `Gate`; none of them
computes geometry. The limits stand beside the gates with the reason for each.
"""

from hexafix.gates.gate import Gate, decide, red
from hexafix.gates.of_plan import (
    STRUT_LIMIT_MM,
    STRUT_WARNING_MM,
    SUBTRACTION_WARNING_MM,
    forward_basin,
    layout_rule,
    realised_rate,
    recognition_error,
    recomputed,
    struts_agree,
    subtraction_near_composition,
    well_conditioned,
)
from hexafix.gates.of_recognition import (
    angles_rebuild,
    ball_diameters,
    limbs_agree,
    moving_ring_above,
    numbering_unique,
    ring_rms,
    rings_face_each_other,
    sides_agree,
    towards_the_head,
)

__all__ = [
    "STRUT_LIMIT_MM",
    "STRUT_WARNING_MM",
    "SUBTRACTION_WARNING_MM",
    "Gate",
    "angles_rebuild",
    "ball_diameters",
    "decide",
    "forward_basin",
    "layout_rule",
    "limbs_agree",
    "moving_ring_above",
    "numbering_unique",
    "realised_rate",
    "recognition_error",
    "recomputed",
    "red",
    "ring_rms",
    "rings_face_each_other",
    "sides_agree",
    "struts_agree",
    "subtraction_near_composition",
    "towards_the_head",
    "well_conditioned",
]
