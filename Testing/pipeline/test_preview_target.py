"""The preview leads where the plan leads, never raises, and motions are numbers and back."""

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.pipeline import motion_matrix, motion_numbers, preview_target
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

MM = st.floats(-500.0, 500.0)
POINT = st.tuples(MM, MM, MM)
TURN = st.tuples(st.floats(-179.0, 179.0), st.floats(-89.0, 89.0), st.floats(-179.0, 179.0))


def far(mm):
    """A fragment motion towards the head that no strut can follow."""
    matrix = np.eye(4)
    matrix[2, 3] = mm
    return {"kind": "fragment-motion", "moving": "proximal", "matrix_lps": matrix.tolist()}


def test_the_preview_is_the_plan_before_rounding(a_plan):
    shown = preview_target(a_plan.case, a_plan.recognised)
    assert shown["faults"] == []
    assert shown["moving"] == a_plan.motion.moving
    np.testing.assert_allclose(shown["fragment_lps"], a_plan.motion.motion.matrix, atol=1e-9)
    np.testing.assert_allclose(shown["target"]["matrix"], a_plan.target.matrix, atol=1e-9)
    assert shown["within_stroke"] == [True] * 6
    last = a_plan.schedule.rows[-1].strut_mm
    assert np.abs(np.subtract(shown["struts_mm"], last)).max() <= a_plan.schedule.strut_step_mm


def test_the_struts_of_the_preview_are_the_distances_of_the_joints(a_plan):
    shown = preview_target(a_plan.case, a_plan.recognised)
    fixator, target = a_plan.case.fixator, np.array(shown["target"]["matrix"])
    upper = fixator.proximal.joints_mm @ target[:3, :3].T + target[:3, 3]
    lengths = np.linalg.norm(upper - fixator.distal.joints_mm, axis=1)
    np.testing.assert_allclose(
        shown["struts_mm"], lengths - fixator.strut.scale_offset_mm, rtol=0, atol=1e-6
    )


def test_what_no_strut_reaches_is_shown_and_each_strut_named(a_draft_case, a_recognised):
    shown = preview_target(a_draft_case(correction=far(300.0)), a_recognised)
    assert shown["within_stroke"] == [False] * 6
    assert {fault["code"] for fault in shown["faults"]} == {"strut-out-of-range"}
    assert [fault["where"] for fault in shown["faults"]] == [f"strut {k}" for k in range(1, 7)]
    assert all("too long" in fault["message"] for fault in shown["faults"])
    np.testing.assert_allclose(shown["asked_lps"], far(300.0)["matrix_lps"], atol=1e-12)
    apart = np.array(shown["fragment_lps"])[:3, 3] - [0, 0, 300]
    assert np.linalg.norm(apart) < 0.6


def test_the_motion_asked_for_is_told_apart_from_where_the_frame_leads(a_plan, a_draft_case):
    """Else a bone that is being dragged would creep by the recognition error at each look."""
    asked = a_plan.case.correction.motion.matrix
    for _ in range(3):
        correction = {
            **far(0.0),
            "matrix_lps": asked if isinstance(asked, list) else asked.tolist(),
        }
        asked = preview_target(a_draft_case(correction=correction), a_plan.recognised)["asked_lps"]
    np.testing.assert_allclose(asked, a_plan.case.correction.motion.matrix, atol=1e-11)


def test_of_a_target_pose_the_motion_follows_from_the_frame(a_draft_case, a_recognised):
    correction = {"kind": "target-pose", "position_mm": [0, 0, 178], "angles_deg": [0, 0, 0]}
    shown = preview_target(a_draft_case(correction=correction), a_recognised)
    assert shown["asked_lps"] == shown["fragment_lps"]
    np.testing.assert_allclose(shown["target"]["position_mm"], [0, 0, 178], atol=1e-9)


def test_the_preview_needs_no_readings_and_no_schedule(a_draft_case, a_recognised):
    case = a_draft_case("schedule", "strut_readings_mm", correction=far(5.0))
    shown = preview_target(case, a_recognised)
    assert shown["faults"] == []
    np.testing.assert_allclose(shown["fragment_lps"], far(5.0)["matrix_lps"], atol=1e-9)


def test_landmarks_that_settle_no_motion_are_a_fault_and_no_exception(a_draft_case, a_recognised):
    line = [[0.0, 0.0, float(k)] for k in range(3)]
    correction = {
        "kind": "landmarks",
        "moving": "proximal",
        "moving_points_lps_mm": line,
        "fixed_points_lps_mm": line,
    }
    shown = preview_target(a_draft_case(correction=correction), a_recognised)
    assert shown["fragment_lps"] is None
    assert shown["struts_mm"] is None
    assert shown["faults"]


def test_a_case_without_a_correction_says_what_is_missing(a_draft_case, a_recognised):
    (fault,) = preview_target(a_draft_case("correction"), a_recognised)["faults"]
    assert (fault["code"], fault["where"]) == ("needed-for-a-plan", "correction")


@settings(deadline=None, max_examples=150)
@given(shift=POINT, turn=TURN, center=POINT)
def test_a_motion_becomes_its_numbers_again(shift, turn, center):
    matrix = motion_matrix(translation_mm=shift, angles_deg=turn, center_lps_mm=center)
    numbers = motion_numbers(matrix, center_lps_mm=center)
    np.testing.assert_allclose(numbers["translation_mm"], shift, rtol=0, atol=1e-8)
    np.testing.assert_allclose(numbers["angles_deg"], turn, rtol=0, atol=1e-7)


@settings(deadline=None, max_examples=150)
@given(quaternion=st.tuples(*[st.floats(-1.0, 1.0)] * 4), shift=POINT, center=POINT)
def test_any_rigid_motion_survives_being_written_in_numbers(quaternion, shift, center):
    norm = np.linalg.norm(quaternion)
    if norm < 1e-3:
        return
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_quat(np.array(quaternion) / norm).as_matrix()
    matrix[:3, 3] = shift
    if abs(matrix[2, 0]) > 1.0 - 1e-6:
        return
    numbers = motion_numbers(matrix, center_lps_mm=center)
    back = np.array(motion_matrix(**numbers, center_lps_mm=center))
    corners = np.array([[0, 0, 0], [400, 0, 0], [0, 400, 0], [0, 0, 400.0]])
    there, here = (m[:3, :3] @ corners.T + m[:3, 3:] for m in (matrix, back))
    np.testing.assert_allclose(here, there, rtol=0, atol=1e-5)


@settings(deadline=None, max_examples=60)
@given(shift=POINT, turn=TURN, center=POINT)
def test_the_centre_moves_by_the_translation_and_turns_are_those_about_fixed_axes(
    shift, turn, center
):
    matrix = np.array(motion_matrix(translation_mm=shift, angles_deg=turn, center_lps_mm=center))
    moved = matrix[:3, :3] @ center + matrix[:3, 3]
    np.testing.assert_allclose(moved - center, shift, rtol=0, atol=1e-8)
    fixed_axes = Rotation.from_euler("xyz", turn, degrees=True).as_matrix()
    np.testing.assert_allclose(matrix[:3, :3], fixed_axes, rtol=0, atol=1e-12)


@pytest.mark.parametrize("bad", [[1.0, 2.0], [1.0, 2.0, np.nan], "abc"])
def test_a_motion_is_three_numbers_each(bad):
    good = {"translation_mm": [0, 0, 0], "angles_deg": [0, 0, 0], "center_lps_mm": [0, 0, 0]}
    for key in good:
        with pytest.raises((InputError, ValueError)):
            motion_matrix(**{**good, key: bad})


def test_a_turn_whose_angles_are_not_unique_is_refused_and_never_guessed():
    upright = motion_matrix(
        translation_mm=[0, 0, 0], angles_deg=[0, 90, 0], center_lps_mm=[0, 0, 0]
    )
    with pytest.raises(InputError) as error:
        motion_numbers(upright, center_lps_mm=[1.0, 2.0, 3.0])
    assert error.value.faults[0].code == "gimbal-lock"


def test_a_target_whose_angles_are_not_unique_is_a_fault_of_the_preview(a_draft_case, a_recognised):
    correction = {"kind": "target-pose", "position_mm": [0, 0, 178], "angles_deg": [0, 90, 0]}
    shown = preview_target(a_draft_case(correction=correction), a_recognised)
    assert [fault["code"] for fault in shown["faults"]] == ["gimbal-lock"]
    assert shown["target"] is None


def test_a_mirrored_matrix_has_no_numbers():
    with pytest.raises(InputError) as error:
        motion_numbers(np.diag([1.0, 1.0, -1.0, 1.0]), center_lps_mm=[0, 0, 0])
    assert error.value.faults[0].hazard == "H01"
