"""The plan as ``plan.json`` holds it."""

from __future__ import annotations

from typing import Any

import numpy as np

from hexafix import __version__
from hexafix.correction import FragmentMotion, StrutSchedule
from hexafix.correction.landmarks import Landmarks, fit_landmarks
from hexafix.geometry import Pose
from hexafix.libraries import versions
from hexafix.pipeline import document
from hexafix.pipeline.numbers import pose_document, rounded
from hexafix.pipeline.plan import Plan

NOTICE = (
    "Research software. Not a medical device. Not to be followed unless a surgeon has checked and "
    "approved it."
)
LEFT = {
    "fused": "image and readings were weighed by their uncertainties and both ring poses corrected",
    "additive": "the difference of the pose vectors was subtracted from the target (Eq. 32)",
    "none": "the recognised ring poses were used as they are",
}


def plan(plan: Plan) -> dict[str, Any]:
    """The plan document; gate G9 is added by the caller once it is decided."""
    case, recognised = plan.case, plan.recognised
    seen = document.recognition(case, recognised)
    sha = seen["image"].pop("sha256")
    mechanism = seen.pop("mechanism")
    seen.pop("gates")
    seen.pop("schema_version")
    return {
        "schema_version": 1,
        "kind": "hexafix-plan",
        "hexafix_version": __version__,
        "notice": NOTICE,
        "approval": "not approved",
        **seen,
        "case": dict(case.document),
        "inputs": {
            "case_sha256": case.case_sha256,
            "image_sha256": sha,
            "fixator_sha256": case.fixator_sha256,
        },
        "versions": versions(),
        "mechanism": {**mechanism, **_struts(plan)},
        "layout": plan.layout.as_json(),
        "correction": _correction(plan),
        "schedule": _schedule(plan.schedule),
        "gates": [gate.as_json() for gate in plan.gates],
    }


def _struts(plan: Plan) -> dict[str, Any]:
    """What the readings say of the mechanism, and how far the CT agrees."""
    recognised, forward = plan.recognised.mechanism.pose, plan.struts.forward
    distance, angle = recognised.difference(forward.pose)
    vector = plan.struts.compensation.pose_vector_difference
    return {
        "from_struts": {
            **pose_document(forward.pose),
            "condition_number": rounded(forward.condition_number, 6),
            "iterations": forward.iterations,
            "reading_resolution_mm": plan.struts.reading_resolution_mm,
        },
        "difference": {
            "position_mm": rounded(vector[:3]),
            "angles_deg": rounded(np.degrees(vector[3:])),
            "distance_mm": rounded(distance),
            "rotation_deg": rounded(float(np.degrees(angle))),
            "struts_mm": rounded(plan.struts.witness.differences_mm),
        },
    }


def _correction(plan: Plan) -> dict[str, Any]:
    correction, compensation = plan.case.correction, plan.struts.compensation
    kind = plan.case.document["correction"]["kind"]
    result = {
        "kind": kind,
        "moving": plan.motion.moving,
        "compensation": compensation.mode,
        "start": pose_document(compensation.start),
        "target": pose_document(plan.target),
        "corrected_rings": {
            "proximal": {"matrix_lps": rounded(compensation.proximal.matrix, 12)},
            "distal": {"matrix_lps": rounded(compensation.distal.matrix, 12)},
        },
        "fragment_motion_lps": _motion(plan.motion),
        "recognition_error_left": LEFT[compensation.mode]
        if kind != "target-pose"
        else "the target is a pose of the mechanism itself: no recognition error enters it",
    }
    if isinstance(correction, Landmarks):
        fit = fit_landmarks(correction)
        result["landmark_residuals_mm"] = rounded(fit.residuals_mm)
    return result


def _motion(motion: FragmentMotion) -> dict[str, Any]:
    pose: Pose = motion.motion
    return {
        "matrix": rounded(pose.matrix, 12),
        "rotation_deg": rounded(float(np.degrees(pose.rotation_angle_rad))),
        "translation_at_origin_mm": rounded(pose.position_mm),
    }


def _schedule(schedule: StrutSchedule) -> dict[str, Any]:
    values = np.array([row.strut_mm for row in schedule.rows])
    return {
        "start_date": schedule.start_date.isoformat(),
        "adjustments_per_day": schedule.adjustments_per_day,
        "days": schedule.days,
        "strut_step_mm": schedule.strut_step_mm,
        "rows": [
            {
                "day": row.day,
                "date": row.date.isoformat(),
                "adjustment": row.adjustment,
                "strut_mm": list(row.strut_mm),
            }
            for row in schedule.rows
        ],
        "ruling_point": schedule.pace.ruling,
        "rate_mm_per_day": rounded(schedule.pace.rate_mm_per_day),
        "rate_deg_per_day": rounded(float(np.degrees(schedule.pace.rate_rad_per_day))),
        "sideways_mm": rounded(schedule.pace.sideways_mm),
        "realised_max_mm_per_day": rounded(schedule.realised_max_mm_per_day),
        "realised_max_deg_per_day": rounded(float(np.degrees(schedule.realised_max_rad_per_day))),
        "rounding_max_mm": rounded(schedule.rounding_max_mm),
        "rounding_max_deg": rounded(float(np.degrees(schedule.rounding_max_rad))),
        "end_error_mm": rounded(schedule.end_error_mm),
        "end_error_deg": rounded(float(np.degrees(schedule.end_error_rad))),
        "end": pose_document(schedule.end),
        "strut_min_mm": rounded(values.min(axis=0)),
        "strut_max_mm": rounded(values.max(axis=0)),
        "condition_number_max": rounded(schedule.stroke.condition_number, 6),
    }
