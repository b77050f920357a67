"""What the panel reads from fields and shows in them: nothing guessed, nothing rounded."""

import json
from types import SimpleNamespace

import pytest
from hexafix.errors import Fault, HexaFixError, InputError, Refused
from hexafix.presenter import Table
from hexafix.web.files import CASE_SUFFIXES, IMAGE_SUFFIXES, MOST_ENTRIES, listing, start_folder
from hexafix.web.panel import draft as drafts
from hexafix.web.panel.context import PanelContext, number, whole_number
from hexafix.web.panel.controls import NoViews
from hexafix.web.panel.numbering import ring_words
from hexafix.web.panel.playback import turn_words, when_words
from hexafix.web.panel.widgets import marked
from hexafix.web.state import (
    BANNERS,
    CHIPS,
    PanelState,
    form_words,
    gate_words,
    number_words,
    table_words,
)
from hypothesis import given
from hypothesis import strategies as st


@given(st.floats(-9e5, 9e5, allow_nan=False).map(lambda value: round(value, 6)))
def test_a_shown_number_reads_back_as_itself(value):
    assert number(number_words(value), where="here") == value


@pytest.mark.parametrize(
    "text",
    ["175,5", "175.5 mm", "1e3", "", None, "inf", "nan", "٣", "1_0", "--1", "1.2.3", "1234567"],
)
def test_what_is_no_plain_number_is_refused_by_name(text):
    with pytest.raises(InputError) as refused:
        number(text, where="strut_readings_mm[0]")
    fault = refused.value.faults[0]
    assert (fault.hazard, fault.where) == ("H26", "strut_readings_mm[0]")
    assert fault.next_step


def test_the_printed_minus_is_read_as_a_minus():
    assert number(" −2.5 ", where="here") == -2.5


@pytest.mark.parametrize("text", ["4.0", "-1", "four", "", "²"])
def test_a_whole_number_is_digits_alone(text):
    with pytest.raises(InputError):
        whole_number(text, where="schedule.adjustments_per_day")
    assert whole_number(" 4 ", where="schedule.adjustments_per_day") == 4


def test_an_empty_case_shows_empty_fields():
    words = form_words({"schema_version": 2})
    assert words["readings"] == [""] * 6
    assert words["schedule"]["strut_step_mm"] == ""
    assert (words["case_id"], words["side"], words["image"]) == ("", None, "")


def test_the_form_shows_the_values_of_the_case(a_phantom):
    words = form_words(a_phantom.case)
    assert [float(text) for text in words["readings"]] == a_phantom.case["strut_readings_mm"]
    assert words["side"] == a_phantom.case["limb"]["side"]
    assert float(words["ball_diameter"]) == a_phantom.case["markers"]["ball_diameter_mm"]


def test_a_table_keeps_cells_alerts_and_staleness():
    table = Table(("Ball", "L mm"), (("1", "2.0"), ("2", "3.0")), ("", "clipped"), stale=True)
    words = table_words(table)
    assert words["rows"] == [["1", "2.0"], ["2", "3.0"]]
    assert words["alerts"] == ["", "clipped"]
    assert words["stale"]
    assert json.loads(json.dumps(words)) == words


def test_one_red_gate_among_many_is_told_and_counted():
    table = Table(("Gate",), (("G2",), ("G4",)), ("", "the ring is upside down"))
    assert gate_words(table) == {"gates_words": "Safety gates: 1 of 2 RED", "gates_red": True}
    table = Table(("Gate",), (("G2",), ("G4",)), ("", ""))
    assert gate_words(table)["gates_red"] is False


def test_every_state_and_kind_has_its_own_word_and_sign():
    from hexafix.presenter import StepState

    assert set(CHIPS) == {state.value for state in StepState}
    for looks in (CHIPS, BANNERS):
        assert len({look[2] for look in looks.values()}) == len(looks)


def test_a_turn_is_told_by_a_word_and_an_arrow_without_sign():
    assert turn_words(0.5, "0.5") == {"turn": "0.5", "way": "longer", "arrow": "▲"}
    assert turn_words(-1.0, "1.0") == {"turn": "1.0", "way": "shorter", "arrow": "▼"}
    assert turn_words(0.0, "0.0") == {"turn": "", "way": "no turn", "arrow": ""}


@pytest.mark.parametrize(("far", "words"), [(17.78, "17.8 mm"), (4.96, "4.960 mm")])
def test_a_numbering_that_is_far_is_told_by_a_tenth_of_a_millimetre(far, words):
    found = {"markers": 4, "assigned": 4, "rms_mm": 0.0466, "next_best_mm": far}
    told = ring_words(found)
    assert told == f"4 of 4 numbered · RMS 0.047 mm · next best numbering {words}"


def test_the_day_leads_and_today_is_told_apart():
    assert when_words(("3", "2026-12-03", "2", "180.0"), "22") == (
        "day 3 of 22 · 2026-12-03 · adjustment 2"
    )
    assert "today" in when_words(("0", "2026-12-01", "0", "180.0"), "22")


def test_the_chooser_lists_folders_and_fitting_files_alone(tmp_path):
    for name in ("ct.nrrd", "ct.nii.gz", "CT.MHA", "case.json", "notes.txt", ".hidden.nrrd"):
        (tmp_path / name).write_bytes(b"")
    (tmp_path / "series").mkdir()
    (tmp_path / ".cache").mkdir()
    found = listing(tmp_path, IMAGE_SUFFIXES)
    names = [entry["name"] for entry in found["entries"]]
    assert names == ["series", "CT.MHA", "ct.nii.gz", "ct.nrrd"]
    assert found["left_out"] == 2
    names = [entry["name"] for entry in listing(tmp_path, CASE_SUFFIXES)["entries"]]
    assert names == ["series", "case.json"]
    assert [e["kind"] for e in listing(tmp_path, ())["entries"]] == ["folder"]


def test_a_folder_of_thousands_of_files_is_cut_and_says_so(tmp_path):
    for index in range(MOST_ENTRIES + 1):
        (tmp_path / f"{index:04}.json").touch()
    found = listing(tmp_path, CASE_SUFFIXES)
    assert found["cut"]
    assert len(found["entries"]) == MOST_ENTRIES


def test_an_unreadable_folder_is_refused_with_the_next_step(tmp_path):
    with pytest.raises(InputError) as refused:
        listing(tmp_path / "none", ())
    assert refused.value.faults[0].next_step


def test_the_chooser_begins_beside_the_case(tmp_path, monkeypatch):
    assert start_folder(str(tmp_path / "case.json")) == tmp_path.resolve()
    monkeypatch.chdir(tmp_path)
    assert start_folder(None).samefile(tmp_path)


CORRECTIONS = {
    "target-pose": {
        "kind": "target-pose",
        "position_mm": [0.5, -1.25, 178.0],
        "angles_deg": [0.0, 2.5, -3.0],
    },
    "deformity": {
        "kind": "deformity",
        "moving": "distal",
        "origin_lps_mm": [1.0, 2.0, 3.5],
        "ap_angulation_deg": 12.0,
        "ap_angulation": "varus",
        "lateral_angulation_deg": 0.0,
        "axial_rotation_deg": 5.0,
        "axial_rotation": "external",
        "ap_translation_mm": 0.0,
        "lateral_translation_mm": 0.0,
        "axial_translation_mm": 4.5,
        "axial_translation": "short",
    },
}


@pytest.mark.parametrize("kind", CORRECTIONS)
def test_a_correction_shown_in_fields_is_the_same_when_set_again(kind):
    draft = drafts.of_document(CORRECTIONS[kind], drafts.empty())
    assert drafts.to_document(draft) == CORRECTIONS[kind]


def test_a_fragment_motion_by_numbers_moves_the_centre_by_the_shift_alone():
    draft = drafts.empty() | {
        "translation": ["1.5", "-2", "3"],
        "angles": ["10", "-5", "20"],
        "center": ["25", "-210.8", "936.4"],
        "moving": "proximal",
    }
    made = drafts.to_document(draft)
    assert (made["kind"], made["moving"]) == ("fragment-motion", "proximal")
    center = [25.0, -210.8, 936.4, 1.0]
    moved = [sum(a * b for a, b in zip(row, center, strict=True)) for row in made["matrix_lps"]]
    assert moved[:3] == pytest.approx([26.5, -212.8, 939.4], abs=1e-9)
    again = drafts.of_document(made, draft)
    assert [float(text) for text in again["angles"]] == pytest.approx([10, -5, 20], abs=1e-3)
    assert [float(text) for text in again["translation"]] == pytest.approx([1.5, -2, 3], abs=1e-3)


QUARTER_TURN = [[0.0, 0, 1.0, 0], [0, 1.0, 0, 0], [-1.0, 0, 0, 0], [0, 0, 0, 1.0]]


@pytest.mark.parametrize("center", [["1", "2", "3"], ["1", "2", "here"]])
def test_a_motion_that_no_numbers_tell_leaves_its_fields_empty(center):
    draft = drafts.empty() | {"translation": ["9", "9", "9"], "center": center}
    motion = {"kind": "fragment-motion", "moving": "distal", "matrix_lps": QUARTER_TURN}
    shown = drafts.of_document(motion, draft)
    assert {*shown["translation"], *shown["angles"]} == {""}
    with pytest.raises(InputError):
        drafts.to_document(shown)


def test_a_case_with_odd_values_is_shown_without_them(odd_documents):
    from hexafix.presenter import Presenter
    from hexafix.web.panel import Panel
    from trame.app import get_server

    presenter = Presenter(threaded=False)
    panel = Panel(get_server("odd-cases", client_type="vue3"), presenter, NoViews())
    for document in odd_documents:
        presenter.edit("odd", lambda _, document=document: document)
        panel.update(presenter.snapshot)
    presenter.close()


@pytest.mark.parametrize("kind", ["fragment-motion", "deformity"])
def test_the_fragment_that_moves_is_never_guessed(kind):
    numbers = {"center": ["1", "2", "3"], "origin": ["1", "2", "3"]}
    draft = drafts.empty() | numbers | {"kind": kind}
    with pytest.raises(InputError) as refused:
        drafts.to_document(draft)
    assert refused.value.faults[0].code == "moving-not-chosen"
    for moving in drafts.FRAGMENTS:
        assert drafts.to_document(draft | {"moving": moving})["moving"] == moving


def test_a_deformity_that_does_not_say_it_moves_the_distal_fragment():
    told = {k: v for k, v in CORRECTIONS["deformity"].items() if k != "moving"}
    assert drafts.of_document(told, drafts.empty())["moving"] == "distal"


def test_a_field_that_is_no_number_names_itself():
    draft = drafts.empty() | {"kind": "target-pose", "position": ["0", "1,5", "178"]}
    with pytest.raises(InputError) as refused:
        drafts.to_document(draft)
    assert refused.value.faults[0].where == "correction.position[1]"


class PlainState:
    """Stands for trame's state where only its context is asked for."""

    def __enter__(self):
        return self

    def __exit__(self, *_):
        return None


class PlainServer:
    state = PlainState()


class SilentPresenter:
    """Its actions are refused; its snapshot has no banner."""

    snapshot = SimpleNamespace(banners=())


@pytest.fixture
def a_context():
    return PanelContext(
        PlainServer(), SilentPresenter(), NoViews(), data=PanelState(), name=PanelState()
    )


def comma():
    number("175,5", where="strut_readings_mm[1]")


def test_a_refused_field_stays_marked_until_its_text_is_taken(a_context):
    assert not a_context.act(comma, field="reading-2")
    assert a_context.data.field_errors["reading-2"].startswith("not taken")
    assert a_context.data.notice == {}
    assert a_context.act(lambda: None, field="reading-3")
    assert "reading-2" in a_context.data.field_errors
    assert a_context.act(lambda: None, field="reading-2")
    assert a_context.data.field_errors == {}


def test_nothing_is_planned_while_a_field_shows_what_the_case_does_not_hold(a_context):
    done = []
    a_context.act(comma, field="reading-2")
    assert not a_context.plan(lambda: done.append(1))
    assert a_context.data.notice["code"] == "field-not-taken"
    a_context.restore()
    assert a_context.data.field_keys["reading-2"] == 1
    assert a_context.plan(lambda: done.append(2))
    assert done == [2]


def test_nothing_is_planned_while_a_part_of_the_panel_forbids_it(a_context):
    def forbid():
        raise InputError.of("correction-not-in-use", "typed and not set", hazard="H40")

    done = []
    a_context.before_planning.append(forbid)
    assert not a_context.plan(lambda: done.append(1))
    assert a_context.data.notice["hazard"] == "H40"
    assert done == []


@pytest.mark.parametrize(
    ("can_export", "names"), [(True, {"plan.json", "manifest.json"}), (False, None)]
)
def test_no_file_is_handed_out_while_the_export_is_blocked(can_export, names):
    from hexafix.web.panel import Panel
    from trame.app import get_server

    presenter = SimpleNamespace(
        snapshot=SimpleNamespace(can_export=can_export),
        prescription_files=lambda: {"plan.json": b"{}"},
    )
    server = get_server(f"downloads-{can_export}", client_type="vue3")
    files = Panel(server, presenter, NoViews()).downloads()
    assert files is None if names is None else set(files) == names


def test_an_action_that_the_presenter_refused_marks_its_field(a_context):
    assert not a_context.act(lambda: False, field="case-id")
    assert "not taken" in a_context.data.field_errors["case-id"]


def test_an_error_without_a_field_is_a_notice_with_the_next_step(a_context):
    def fail():
        raise Refused(Fault("x-code", "it is so", hazard="H24", next_step="read again"))

    assert not a_context.act(fail)
    notice = a_context.data.notice
    assert (notice["code"], notice["hazard"], notice["next_step"]) == (
        "x-code",
        "H24",
        "read again",
    )
    assert "Next step" not in notice["message"]


def test_a_defect_is_not_swallowed(a_context):
    def fail():
        raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        a_context.act(fail)
    assert not issubclass(ZeroDivisionError, HexaFixError)


def test_a_label_is_an_attribute_and_an_expression_is_bound():
    raw = marked(("'row-' + i",), label="Remove the ball")["raw_attrs"]
    assert raw == [""":data-testid="'row-' + i\"""", 'aria-label="Remove the ball"']


def test_fields_not_taken_are_told_by_what_stands_beside_them():
    from hexafix.web.panel.context import field_words

    told = {
        "reading-2": "strut 2",
        "again-6": "strut 6 again",
        "schedule-max_rate_mm_per_day": "fastest motion",
        "distal-0-sweep_deg": "layout of the distal ring, row 1, sweep",
        "risk-1-P": "structures at risk, point 2, P",
        "ball-diameter": "diameter of the marker balls",
        "limb-side": "side of the limb",
        "case-id": "name of the case",
        "fixator": "fixator",
    }
    assert {name: field_words(name) for name in told} == told
