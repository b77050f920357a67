"""The list of frames: the shipped ones by name, and the definition that came with the case."""

import json

import pytest
from hexafix.panel.load import shipped_titles
from hexafix.presenter import Presenter
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.controls import NoViews
from hexafix.web.panel.frame_choice import OWN, FrameChoice, frame_items
from hexafix.web.state import PanelState

SHIPPED = "generic-6sps-160"


@pytest.fixture
def presenter():
    made = Presenter(threaded=False)
    yield made
    made.close()


class AskedOnce:
    """A chooser whose user knows the path already."""

    def __init__(self):
        self.path = None

    def ask(self, title, action, take, **_):
        take(self.path)


@pytest.fixture
def chooser():
    return AskedOnce()


@pytest.fixture
def frames(presenter, chooser, request):
    from trame.app import get_server

    server = get_server(f"frames-{request.node.name}", client_type="vue3")
    data, name = typed_state(server, PanelState)
    context = PanelContext(server, presenter, NoViews(), data=data, name=name)
    made = FrameChoice(context, chooser)
    presenter.changed.connect(made.update)
    made.update(presenter.snapshot)
    yield made
    presenter.changed.disconnect(made.update)


@pytest.fixture
def a_definition(a_phantom):
    """The shipped definition under another name, as a hospital would write its own."""
    from hexafix.paths import resources

    text = (resources() / "Hardware" / "Frames" / f"{SHIPPED}.json").read_text()
    return {**json.loads(text), "id": "own-160", "name": "Own hexapod"}


def values(frames):
    return [item["value"] for item in frames._data.frames]


def fixator(presenter):
    return presenter.snapshot.document.get("fixator")


def test_every_shipped_frame_is_listed_by_its_name():
    items = frame_items(shipped_titles(), None)
    assert {item["value"] for item in items} == set(shipped_titles())
    assert {"title": f"Generic 6-SPS hexapod, 160 mm rings ({SHIPPED})", "value": SHIPPED} in items


def test_no_frame_is_chosen_for_the_user(frames, presenter):
    assert frames._data.chosen is None
    assert fixator(presenter) is None
    frames._choose(SHIPPED)
    assert fixator(presenter) == SHIPPED == frames._data.chosen


def test_a_definition_that_came_with_the_case_can_be_taken_again(
    frames, presenter, a_definition, tmp_path
):
    (tmp_path / "case.json").write_text(json.dumps({"schema_version": 2, "fixator": a_definition}))
    assert presenter.open_case(tmp_path / "case.json")
    assert frames._data.chosen == OWN
    assert "Own hexapod" in frames._data.frames[-1]["title"]
    frames._choose(SHIPPED)
    assert fixator(presenter) == SHIPPED
    assert values(frames)[-1] == OWN
    frames._choose(OWN)
    assert fixator(presenter) == a_definition
    presenter.new_case()
    assert OWN not in values(frames)


def test_a_definition_beside_the_case_stays_the_file_that_it_is(
    frames, presenter, a_definition, tmp_path, monkeypatch
):
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "own.json").write_text("{}")
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "own.json").write_text(json.dumps(a_definition))
    (tmp_path / "case.json").write_text(json.dumps({"schema_version": 2, "fixator": "own.json"}))
    assert presenter.open_case(tmp_path / "case.json")
    frames._choose(SHIPPED)
    frames._choose(OWN)
    assert fixator(presenter) == "own.json"


def test_a_definition_read_from_a_file_becomes_part_of_the_case(
    frames, presenter, chooser, a_definition, tmp_path
):
    chooser.path = tmp_path / "own.json"
    chooser.path.write_text(json.dumps(a_definition))
    frames._ask()
    assert fixator(presenter) == a_definition
    assert frames._data.chosen == OWN


def test_a_file_that_is_no_definition_changes_nothing_and_is_told(
    frames, presenter, chooser, tmp_path
):
    chooser.path = tmp_path / "notes.json"
    chooser.path.write_text("{not json")
    frames._choose(SHIPPED)
    frames._ask()
    assert fixator(presenter) == SHIPPED
    assert "not taken" in frames._context.data.field_errors["fixator"]
