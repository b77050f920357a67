"""Whole cases against the phantom's truth: bones, sides, metals, kinds of correction."""

import json
from pathlib import Path

import numpy as np
import pytest
from hexafix.case import case_from_document
from hexafix.geometry import Pose
from hexafix.kinematics import forward_kinematics
from hexafix.phantom import PhantomSpec, make_phantom
from hexafix.pipeline import plan_correction

SMALL = {"size_ijk": (250, 260, 200), "spacing_mm": (1.15, 1.1, 1.45), "noise_hu": 25.0}

SCENARIOS = {
    "fragment motion, moving distal": {"correction": "fragment-motion", "moving": "distal"},
    "landmarks on a right tibia": {"correction": "landmarks", "side": "right"},
    "deformity in words, moving distal": {"correction": "deformity", "moving": "distal"},
    "steel balls clipped by the scanner": {"ball_hu": 8000.0, "correction": "fragment-motion"},
    "carbon rings and streaks": {
        "ring_material": "carbon",
        "streak_hu": 150.0,
        "correction": "fragment-motion",
    },
}


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_schedule_ends_where_the_fracture_is_reduced(name):
    seed = sorted(SCENARIOS).index(name) + 21
    phantom = make_phantom(PhantomSpec(seed=seed, **SMALL, **SCENARIOS[name]))
    document = {**phantom.case, "schedule": {**phantom.case["schedule"], "strut_step_mm": 0.25}}
    raw = json.dumps(document).encode()
    case = case_from_document(raw, folder=Path(), needs_image=False)
    plan = plan_correction(case, volume=phantom.volume)
    truth = {ball["number"]: ball["center_mm"] for ball in phantom.truth["balls"]}
    for number, index in plan.recognised.numbering.ball_of_number.items():
        away = np.subtract(plan.recognised.balls.balls[index].center_mm, truth[number])
        assert np.linalg.norm(away) < 0.08
    goal = Pose.from_matrix(phantom.truth["target"]["mechanism"]["matrix"])
    end = forward_kinematics(plan.schedule.rows[-1].strut_mm, case.fixator, start=goal).pose
    distance, angle = end.difference(goal)
    assert distance < 0.6
    assert np.degrees(angle) < 0.3
