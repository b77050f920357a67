"""The straight line from a CT to a prescription; each step takes and returns a frozen value.

read_volume → find_balls → number_balls → ring_pose, mechanism_pose → check_layouts →
forward_kinematics → correction target, compensation → make_schedule → report → export

A program that plans a finished case calls `plan_and_export`. A workstation takes the same steps one
by one: read_image → find_case_balls → judge_numbering → recognise → weigh_document →
preview_target → plan_recognised → prescribe → write_prescription.
"""

from hexafix.pipeline.ball_edits import with_ball_added, with_ball_removed
from hexafix.pipeline.document import recognition as recognition_document
from hexafix.pipeline.judge import judge_case_numbering, judge_numbering
from hexafix.pipeline.layout import check_case_layout
from hexafix.pipeline.look import (
    balls_document,
    find_case_balls,
    image_document,
    image_series,
    read_image,
)
from hexafix.pipeline.plan import Plan, plan_correction, plan_recognised, recognise_checked
from hexafix.pipeline.plan_document import plan as plan_document_of
from hexafix.pipeline.playback import Playback, PlaybackRow, playback, scene_at
from hexafix.pipeline.prescribe import (
    Prescription,
    plan_and_export,
    prescribe,
    write_prescription,
)
from hexafix.pipeline.preview import motion_matrix, motion_numbers, preview_target
from hexafix.pipeline.recognise import (
    case_balls,
    find_markers,
    judge_by_struts,
    recognise,
    recognise_case,
)
from hexafix.pipeline.recognised import Recognised
from hexafix.pipeline.scenery import (
    bone_fragments,
    layout_pictures,
    pictures,
    prescription_pages,
    scene_of,
    split_point,
    strut_curves_at,
)
from hexafix.pipeline.text import (
    format_change,
    format_deg,
    format_margin,
    format_measure,
    format_mm,
    format_number,
    format_reading,
    format_row,
    format_setting,
)
from hexafix.pipeline.weigh import weigh_document

layout_document = check_case_layout
"""The layout check as a document, before any CT."""

__all__ = [
    "Plan",
    "Playback",
    "PlaybackRow",
    "Prescription",
    "Recognised",
    "balls_document",
    "bone_fragments",
    "case_balls",
    "check_case_layout",
    "find_case_balls",
    "find_markers",
    "format_change",
    "format_deg",
    "format_margin",
    "format_measure",
    "format_mm",
    "format_number",
    "format_reading",
    "format_row",
    "format_setting",
    "image_document",
    "image_series",
    "judge_by_struts",
    "judge_case_numbering",
    "judge_numbering",
    "layout_document",
    "layout_pictures",
    "motion_matrix",
    "motion_numbers",
    "pictures",
    "plan_and_export",
    "plan_correction",
    "plan_document_of",
    "plan_recognised",
    "playback",
    "prescribe",
    "prescription_pages",
    "preview_target",
    "read_image",
    "recognise",
    "recognise_case",
    "recognise_checked",
    "recognition_document",
    "scene_at",
    "scene_of",
    "split_point",
    "strut_curves_at",
    "weigh_document",
    "with_ball_added",
    "with_ball_removed",
    "write_prescription",
]
