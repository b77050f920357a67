"""Every row of the playback by another road: distances of joints, and the plan's own motion."""

import json
from pathlib import Path

import numpy as np
import pytest
from hexafix.case import case_from_document
from hexafix.pipeline import plan_recognised, playback, scene_at, scene_of

TURN_DEG = 4.0


def small_motion():
    """A turn about a slanted axis and a shift, LPS mm, about the phantom's middle."""
    axis = np.array([0.3, 0.5, 0.81])
    axis /= np.linalg.norm(axis)
    cross = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    angle = np.radians(TURN_DEG)
    matrix = np.eye(4)
    matrix[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return matrix


@pytest.fixture(scope="module", params=["proximal", "distal"])
def played(request, a_phantom, a_recognised):
    """A plan that moves one ring's fragment, and its playback."""
    middle = a_recognised.distal.pose.position_mm + np.array([3.0, -4.0, 60.0])
    matrix = small_motion()
    matrix[:3, 3] = middle - matrix[:3, :3] @ middle + [2.0, -3.0, 4.0]
    correction = {
        "kind": "fragment-motion",
        "moving": request.param,
        "matrix_lps": matrix.tolist(),
    }
    raw = json.dumps({**a_phantom.case, "correction": correction}).encode()
    case = case_from_document(raw, folder=Path(), needs_image=False)
    plan = plan_recognised(case, a_recognised)
    return plan, playback(plan)


def joints(fixator, row):
    """Joint centres of both rings at a row, LPS mm."""
    return [
        np.asarray(ring.joints_mm) @ np.array(pose)[:3, :3].T + np.array(pose)[:3, 3]
        for ring, pose in ((fixator.proximal, row.proximal_lps), (fixator.distal, row.distal_lps))
    ]


def moving_and_resting(play, row):
    poses = np.array(row.proximal_lps), np.array(row.distal_lps)
    return poses if play.moving == "proximal" else poses[::-1]


def test_the_rows_are_those_of_the_schedule(played):
    plan, play = played
    assert play.moving == plan.case.correction.moving
    assert len(play.rows) == len(plan.schedule.rows)
    for index, (row, wanted) in enumerate(zip(play.rows, plan.schedule.rows, strict=True)):
        assert row.index == index
        assert (row.day, row.date, row.adjustment) == (wanted.day, wanted.date, wanted.adjustment)
        assert row.strut_mm == wanted.strut_mm


def test_the_joints_stand_as_far_apart_as_the_struts_are_long(played):
    plan, play = played
    fixator = plan.case.fixator
    for row in play.rows:
        upper, lower = joints(fixator, row)
        lengths = np.linalg.norm(upper - lower, axis=1)
        np.testing.assert_allclose(
            lengths - fixator.strut.scale_offset_mm, row.strut_mm, rtol=0, atol=1e-8
        )


def test_the_turns_add_up_to_the_whole_change(played):
    _, play = played
    turned = np.array([row.turned_mm for row in play.rows])
    values = np.array([row.strut_mm for row in play.rows])
    assert np.all(turned[0] == 0.0)
    np.testing.assert_allclose(values[0] + np.cumsum(turned, axis=0), values, rtol=0, atol=1e-6)
    assert np.abs(turned).max() < 3.0


def test_the_resting_ring_stays_where_the_plan_has_it_in_the_ct(played):
    plan, play = played
    resting = "distal" if play.moving == "proximal" else "proximal"
    planned = getattr(plan.struts.compensation, resting)
    for row in play.rows:
        np.testing.assert_array_equal(moving_and_resting(play, row)[1], planned.matrix)
    seen = getattr(plan.recognised, resting).pose
    # image and readings together move it by less than the recognition error
    assert planned.difference(seen)[0] < 0.1


def test_the_first_row_leaves_the_fragment_where_the_ct_shows_it(played):
    plan, play = played
    np.testing.assert_allclose(play.rows[0].fragment_lps, np.eye(4), rtol=0, atol=1e-9)
    seen = getattr(plan.recognised, play.moving).pose.matrix
    apart = np.linalg.norm(moving_and_resting(play, play.rows[0])[0][:3, 3] - seen[:3, 3])
    assert apart < 0.6


def test_the_fragment_goes_with_its_ring(played):
    _, play = played
    start = moving_and_resting(play, play.rows[0])[0]
    for row in play.rows:
        moved = np.array(row.fragment_lps) @ start
        np.testing.assert_allclose(moved, moving_and_resting(play, row)[0], rtol=0, atol=1e-8)
        rotation = np.array(row.fragment_lps)[:3, :3]
        np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) > 0.0


def test_the_last_row_is_the_schedules_end_and_the_plans_motion_but_for_the_rounding(played):
    plan, play = played
    last = play.rows[-1]
    end = np.linalg.inv(np.array(last.distal_lps)) @ np.array(last.proximal_lps)
    np.testing.assert_allclose(end, plan.schedule.end.matrix, rtol=0, atol=1e-8)
    reached, asked = np.array(last.fragment_lps), np.array(plan.case.correction.motion.matrix)
    fixator, ends = plan.case.fixator, (plan.schedule.end.matrix, plan.target.matrix)
    ring, k = fixator.proximal, 0
    if play.moving == "distal":
        ring, k, ends = fixator.distal, 1, tuple(map(np.linalg.inv, ends))
    for joint, point in zip(ring.joints_mm, joints(fixator, play.rows[0])[k], strict=True):
        places = [m[:3] @ [*point, 1.0] for m in (reached, plan.motion.motion.matrix, asked)]
        rounding = np.linalg.norm((ends[0] - ends[1])[:3] @ [*joint, 1.0])
        assert np.linalg.norm(places[0] - places[1]) == pytest.approx(rounding, abs=1e-7)
        # whole steps of the struts, at the end and in today's readings
        assert np.linalg.norm(places[0] - places[2]) < 2.0 * plan.case.schedule.strut_step_mm
    turn = np.degrees(np.arccos((np.trace(reached[:3, :3]) - 1.0) / 2.0))
    assert turn == pytest.approx(TURN_DEG, abs=0.3)


def test_the_moving_rings_balls_go_with_it_and_the_others_rest(played):
    plan, play = played
    scene = scene_of(plan.case, plan.recognised, bone=False)
    shown = scene_at(scene, play.rows[-1], play.moving)
    assert shown.bone is None
    for before, after in zip(scene.balls, shown.balls, strict=True):
        if before.ring != play.moving:
            np.testing.assert_array_equal(after.center_mm, before.center_mm)
            continue
        pose = [moving_and_resting(play, row)[0] for row in (play.rows[0], play.rows[-1])]
        in_ring = [
            np.linalg.solve(matrix, [*ball.center_mm, 1.0])
            for matrix, ball in zip(pose, (before, after), strict=True)
        ]
        np.testing.assert_allclose(in_ring[0], in_ring[1], atol=1e-8)
    np.testing.assert_array_equal(shown.proximal_lps, play.rows[-1].proximal_lps)
