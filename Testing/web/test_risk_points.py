"""Structures at risk in the browser: what stands in the case, and nothing that was only typed."""

import pytest
from hexafix.errors import InputError
from hexafix.presenter import Presenter
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.controls import NoViews
from hexafix.web.panel.risk import KEY, RiskPoints
from hexafix.web.state import PanelState

SCHEDULE = {"start_date": "2026-12-01", KEY: [[1.25, -2.0, 3.0], [10.0, 20.0, 30.0]]}


class Views(NoViews):
    """Views that keep who waits for a point."""

    picked = None

    def pick_point(self, picked):
        self.picked = picked


@pytest.fixture
def views():
    return Views()


@pytest.fixture
def presenter():
    presenter = Presenter(threaded=False)
    presenter.new_case()
    assert presenter.set_schedule(SCHEDULE)
    yield presenter
    presenter.close()


@pytest.fixture
def risk(presenter, views, request):
    from trame.app import get_server

    server = get_server(f"risk-{request.node.name}", client_type="vue3")
    data, name = typed_state(server, PanelState)
    made = RiskPoints(PanelContext(server, presenter, views, data=data, name=name))
    presenter.changed.connect(lambda snapshot: made.update(snapshot.document))
    made.update(presenter.snapshot.document)
    return made


def held(presenter):
    return presenter.snapshot.document["schedule"].get(KEY)


def test_the_points_of_the_case_are_shown_digit_by_digit(risk):
    assert risk._data.points == [["1.25", "-2", "3"], ["10", "20", "30"]]


def test_a_coordinate_is_edited_in_the_case_and_undone(risk, presenter):
    risk._commit(1, 2, "31.5")
    assert held(presenter) == [[1.25, -2.0, 3.0], [10.0, 20.0, 31.5]]
    assert presenter.snapshot.document["schedule"]["start_date"] == "2026-12-01"
    presenter.undo()
    assert held(presenter) == SCHEDULE[KEY]
    assert risk._data.points[1] == ["10", "20", "30"]


def test_a_coordinate_that_is_no_number_changes_nothing_and_is_marked(risk, presenter):
    risk._commit(0, 1, "2,5")
    assert held(presenter) == SCHEDULE[KEY]
    assert "not taken" in risk._context.data.field_errors["risk-0-P"]
    with pytest.raises(InputError, match="structures at risk, point 1, P"):
        risk._context.require_taken()


def test_points_are_removed_and_the_last_one_leaves_no_empty_list(risk, presenter):
    risk._remove(0)
    assert held(presenter) == [[10.0, 20.0, 30.0]]
    risk._remove(0)
    assert KEY not in presenter.snapshot.document["schedule"]
    assert risk._data.points == []


def test_a_typed_point_is_in_the_case_only_once_it_is_added_and_whole(risk, presenter):
    risk._data.new = ["4", "", "6.5"]
    with pytest.raises(InputError) as refused:
        risk.require_added()
    assert (refused.value.faults[0].code, refused.value.faults[0].hazard) == (
        "point-not-added",
        "H40",
    )
    risk._add()
    assert held(presenter) == SCHEDULE[KEY]
    assert risk._context.data.notice["code"] == "not-a-number"
    assert risk._data.new == ["4", "", "6.5"]
    risk._data.new = ["4", "−5.25", "6.5"]
    risk._add()
    assert held(presenter) == [*SCHEDULE[KEY], [4.0, -5.25, 6.5]]
    assert risk._data.new == ["", "", ""]
    risk.require_added()


def test_nothing_is_planned_while_a_typed_point_is_not_added(risk):
    planned = []
    risk._data.new = ["4", "", ""]
    assert not risk._context.plan(lambda: planned.append(1))
    assert planned == []
    assert risk._context.data.notice["code"] == "point-not-added"
    risk._data.new = ["", " ", ""]
    assert risk._context.plan(lambda: planned.append(1))


def test_a_clicked_point_becomes_one_of_the_case(risk, presenter, views):
    risk._pick()
    assert risk._data.picking
    views.picked((12.34567, -0.04, 900.0))
    assert held(presenter)[2] == [12.3, 0.0, 900.0]
    assert not risk._data.picking
    assert views.picked is None
    risk._pick()
    risk.stop()
    assert not risk._data.picking
    assert views.picked is None


def test_a_case_without_a_schedule_gets_one_by_its_first_point(risk, presenter):
    presenter.new_case()
    assert risk._data.points == []
    risk._data.new = ["1", "2", "3"]
    risk._add()
    assert presenter.snapshot.document["schedule"] == {KEY: [[1.0, 2.0, 3.0]]}
