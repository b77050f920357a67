"""Balls added, removed, dragged and numbered by hand, each seen at once."""

import pytest
from hexafix.pipeline import with_ball_added, with_ball_removed
from hexafix.presenter import Step

BALL = {"center_mm": [10.0, 20.0, 30.0], "diameter_mm": 9.8}


def numbers(presenter):
    return presenter.snapshot.document["numbering"]


def test_an_added_ball_needs_no_new_search(a_planned, an_engine, states):
    an_engine.calls.clear()
    assert a_planned.add_marker([50, 0, 0])
    assert "search" not in an_engine.calls
    assert states(a_planned)["markers"] == "done"
    assert a_planned.snapshot.document["marker_edits"]["added_lps_mm"] == [[50.0, 0.0, 0.0]]
    assert a_planned.snapshot.document["schema_version"] == 2
    assert a_planned.snapshot.undo_label == "add a ball"


def test_an_edit_that_the_image_refuses_is_told_and_undone(a_planned, an_engine, states):
    from hexafix.errors import MarkersNotFound

    an_engine.fail["find_case_balls"] = MarkersNotFound.of("no-ball-to-add", "nothing there")
    a_planned.add_marker([50.0, 0.0, 0.0])
    assert states(a_planned)["markers"] == "refused"
    assert [b.code for b in a_planned.snapshot.banners] == ["no-ball-to-add"]
    a_planned.undo()
    assert set(states(a_planned).values()) == {"done"}


def test_balls_of_older_inputs_cannot_be_edited(a_planned, codes):
    a_planned.set_ball_diameter(9.5)
    before = a_planned.version.raw
    for edit in (
        lambda: a_planned.remove_marker(0),
        lambda: a_planned.move_marker(0, [1.0, 2.0, 3.0]),
        lambda: a_planned.assign_number(1, 0),
    ):
        assert not edit()
        assert codes(a_planned)[0] == "balls-out-of-date"
    assert a_planned.version.raw == before


@pytest.mark.parametrize("index", [-1, 8])
def test_a_ball_that_is_not_there_is_refused(index, a_planned, codes):
    assert not a_planned.remove_marker(index)
    assert codes(a_planned)[0] == "no-such-ball"


def test_numbers_swapped_from_the_automatic_ones_are_the_users(a_planned):
    assert a_planned.swap_numbers(1, 2)
    found = numbers(a_planned)
    assert (found["1"], found["2"], found["3"]) == ([1, 2, 3], [0, 0, 0], [2, 4, 6])
    assert list(found) == [str(number) for number in range(1, 9)]
    assert a_planned.snapshot.undo_label == "swap numbers 1 and 2"
    assert a_planned.number_automatically()
    assert numbers(a_planned) is None


def test_a_number_given_to_a_ball_leaves_no_ball_with_two(a_planned, states):
    a_planned.assign_number(1, 7)
    found = numbers(a_planned)
    assert found["1"] == [7.0, 14.0, 21.0]
    assert "8" not in found
    assert len({tuple(at) for at in found.values()}) == len(found)
    view = a_planned.snapshot.view(Step.NUMBERING)
    assert view.state == "waiting"
    assert states(a_planned)["poses"] == "stale"
    assert not a_planned.snapshot.can_export
    a_planned.assign_number(8, 0)
    assert states(a_planned)["numbering"] == "done"


def test_a_cleared_number_is_missing_until_it_is_given(a_planned, codes):
    a_planned.clear_number(3)
    assert "3" not in numbers(a_planned)
    assert not a_planned.run(Step.POSES) or a_planned.snapshot.view(Step.POSES).state == "stale"
    assert "number-missing" in codes(a_planned)
    a_planned.assign_number(3, 2)
    a_planned.run_all()
    assert a_planned.snapshot.can_export


def test_a_number_on_no_ball_goes_to_the_others_ball(a_planned):
    a_planned.clear_number(3)
    a_planned.swap_numbers(3, 4)
    assert numbers(a_planned)["3"] == [3.0, 6.0, 9.0]
    assert "4" not in numbers(a_planned)
    a_planned.clear_number(3)
    before = a_planned.version.raw
    assert not a_planned.swap_numbers(3, 4)
    assert a_planned.version.raw == before


def test_a_removed_ball_takes_its_number_along_and_a_moved_one_keeps_it(a_planned):
    a_planned.swap_numbers(1, 2)
    a_planned.move_marker(0, [0.5, 0.0, 0.0])
    assert numbers(a_planned)["2"] == [0.5, 0.0, 0.0]
    a_planned.undo()
    a_planned.remove_marker(0)
    assert "2" not in numbers(a_planned)
    assert a_planned.snapshot.document["marker_edits"]["removed_lps_mm"] == [[0.0, 0.0, 0.0]]


def test_a_movement_of_the_mouse_is_one_undo_step(a_planned):
    before = a_planned.version.raw

    def drag(z, **more):
        target = {"kind": "target-pose", "position_mm": [0, 0, z], "angles_deg": [0, 0, 0]}
        assert a_planned.set_correction(target, **more)

    for z in (161, 162, 163):
        drag(z, dragging=True)
    drag(163)
    first = a_planned.version.raw
    drag(170, dragging=True)
    drag(171)
    drag(172)
    a_planned.undo()
    a_planned.undo()
    assert a_planned.version.raw == first
    assert a_planned.snapshot.undo_label == "drag the fragment"
    a_planned.undo()
    assert a_planned.version.raw == before
    assert not a_planned.snapshot.can_undo


def test_a_ball_of_the_search_is_removed_and_one_of_the_user_is_not_added_any_more():
    edits = with_ball_added({}, lps_mm=[10.0, 21.0, 30.0])
    edits = with_ball_added(edits, lps_mm=[50.0, 0.0, 0.0])
    assert edits == {
        "added_lps_mm": [[10.0, 21.0, 30.0], [50.0, 0.0, 0.0]],
        "removed_lps_mm": [],
    }
    searched = with_ball_removed(edits, ball=BALL)
    assert searched["removed_lps_mm"] == [[10.0, 20.0, 30.0]]
    assert searched["added_lps_mm"] == edits["added_lps_mm"]
    added = with_ball_removed(edits, ball={**BALL, "added": True})
    assert added == {"added_lps_mm": [[50.0, 0.0, 0.0]], "removed_lps_mm": []}
    far = with_ball_removed(edits, ball={**BALL, "center_mm": [90.0, 0.0, 0.0], "added": True})
    assert far["removed_lps_mm"] == [[90.0, 0.0, 0.0]]
    assert edits["removed_lps_mm"] == []
