"""Whole cases against the phantom's truth: bones, sides, metals, kinds of correction."""

import json
from pathlib import Path

import numpy as np
import pytest
from hexafix.case import case_from_document
from hexafix.errors import NumberingAmbiguous
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.kinematics import forward_kinematics
from hexafix.phantom import PhantomSpec, make_phantom
from hexafix.pipeline import plan_correction, plan_document, recognise
from hexafix.verify import recompute

SMALL = {"size_ijk": (250, 260, 200), "spacing_mm": (1.15, 1.1, 1.45), "noise_hu": 25.0}

COMPENSATION = {"landmarks on a right tibia": "none", "fragment motion, moving distal": "additive"}

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
    changes = {"strut_step_mm": 0.25, "compensation": COMPENSATION.get(name, "fused")}
    document = {**phantom.case, "schedule": {**phantom.case["schedule"], **changes}}
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
    again = recompute(plan_document.plan(plan))
    assert again.agrees, [check for check in again.checks if not check.passed]


def test_strut_readings_settle_a_layout_that_looks_the_same_when_turned():
    even = MarkerLayout.of(
        radius_mm=[100.0] * 3, sweep_deg=[0.0, 120.0, 240.0], height_mm=[20.0] * 3
    )
    distal = MarkerLayout.of(
        radius_mm=[100.0] * 3,
        sweep_deg=[20.0, 112.0, 235.0],
        height_mm=[20.0] * 3,
        first_number=4,
    )
    phantom = make_phantom(PhantomSpec(seed=31, **SMALL, proximal=even, distal=distal))
    raw = json.dumps(phantom.case).encode()
    case = case_from_document(raw, folder=Path(), needs_image=False)
    plan = plan_correction(case, volume=phantom.volume)
    assert plan.recognised.numbering.settled_by == "strut-readings"
    assert plan_document.plan(plan)["numbering_settled_by"] == "strut-readings"
    truth = {ball["number"]: ball["center_mm"] for ball in phantom.truth["balls"]}
    for number, index in plan.recognised.numbering.ball_of_number.items():
        away = np.subtract(plan.recognised.balls.balls[index].center_mm, truth[number])
        assert np.linalg.norm(away) < 0.08
    without = {**phantom.case, "strut_readings_mm": None}
    case = case_from_document(
        json.dumps(without).encode(), folder=Path(), needs_image=False, plannable=False
    )
    with pytest.raises(NumberingAmbiguous, match="turned"):
        recognise(case, phantom.volume)
