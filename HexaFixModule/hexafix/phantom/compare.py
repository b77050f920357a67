"""A plan against the truth of the phantom it was made for."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from hexafix.geometry import Pose
from hexafix.hardware import fixator_from_document
from hexafix.kinematics import forward_kinematics


def errors_against_truth(document: Mapping[str, Any], truth: Mapping[str, Any]) -> dict[str, Any]:
    """Errors of a plan document against ``truth.json``, mm and degrees.

    Parameters
    ----------
    document : mapping
        ``plan.json``.
    truth : mapping
        ``truth.json``.

    Returns
    -------
    dict
        Ball centres under their numbers, mechanism pose by CT and by struts, and where the last
        row puts the proximal ring against the phantom's reduced pose.
    """
    centers = {ball["number"]: ball["center_mm"] for ball in truth["balls"]}
    away = [
        float(np.linalg.norm(np.subtract(ball["center_mm"], centers[ball["number"]])))
        for ball in document["balls"]
    ]
    mechanism = Pose.from_matrix(truth["mechanism"]["matrix"])
    goal = Pose.from_matrix(truth["target"]["mechanism"]["matrix"])
    fixator = fixator_from_document(document["case"]["fixator"])
    last = np.array(document["schedule"]["rows"][-1]["strut_mm"]) + fixator.strut.scale_offset_mm
    end = forward_kinematics(last, fixator, start=goal).pose
    return {
        "balls": len(centers),
        "balls_found": len(away),
        "ball_rms_mm": float(np.sqrt(np.mean(np.square(away)))),
        "ball_worst_mm": max(away),
        **_difference("recognised", Pose.from_matrix(document["mechanism"]["matrix"]), mechanism),
        **_difference(
            "struts", Pose.from_matrix(document["mechanism"]["from_struts"]["matrix"]), mechanism
        ),
        **_difference("end", end, goal),
    }


def _difference(name: str, pose: Pose, true: Pose) -> dict[str, float]:
    distance, angle = pose.difference(true)
    return {f"{name}_mm": distance, f"{name}_deg": float(np.degrees(angle))}
