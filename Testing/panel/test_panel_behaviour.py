"""What the panel does with what is typed, chosen and clicked."""

import datetime
import json

import pytest
from hexafix.presenter import Step

LAYOUT = [["1", "100", "0", "20"], ["2", "100", "105", "20"], ["3", "100", "235", "20"]]


def wrong(panel):
    return {banner.code for banner in panel.banners() if banner.kind in ("error", "refused")}


def test_a_typed_number_goes_into_the_case_and_undo_brings_the_old_one_back(
    panel, widgets, document
):
    widgets.type("ballDiameterLineEdit", "10")
    assert document("markers", "ball_diameter_mm") == 10.0
    widgets.type("ballDiameterLineEdit", "12.5")
    widgets.click("undoButton")
    assert document("markers", "ball_diameter_mm") == 10.0
    assert widgets.get("ballDiameterLineEdit", "text") == "10"


def test_a_comma_is_marked_and_changes_nothing(panel, widgets, document):
    widgets.type("ballDiameterLineEdit", "10")
    widgets.type("ballDiameterLineEdit", "12,5")
    assert document("markers", "ball_diameter_mm") == 10.0
    assert widgets.get("ballDiameterLineEdit", "text") == "12,5"
    assert widgets.values["ballDiameterLineEdit", "mark"]
    assert "not-a-number" in wrong(panel)
    widgets.type("ballDiameterLineEdit", "12.5")
    assert not widgets.values["ballDiameterLineEdit", "mark"]
    assert document("markers", "ball_diameter_mm") == 12.5


def test_nothing_is_computed_while_a_field_holds_what_is_no_number(
    panel, widgets, presenter, monkeypatch
):
    started = []
    monkeypatch.setattr(presenter, "run_all", lambda: started.append("all"))
    monkeypatch.setattr(presenter, "run", started.append)
    widgets.type("reading1LineEdit", "19O.5")
    widgets.click("runAllButton")
    widgets.click("planButton")
    assert started == []
    assert "not-a-number" in wrong(panel)
    widgets.type("reading1LineEdit", "190.5")
    widgets.click("runAllButton")
    assert started == ["all"]


def test_what_is_still_being_typed_is_taken_over_before_the_case_is_saved(panel, widgets, tmp_path):
    widgets.begin_typing("caseIdLineEdit", "left-tibia-2")
    widgets.paths = [str(tmp_path / "case.json")]
    widgets.click("saveCaseButton")
    assert json.loads((tmp_path / "case.json").read_text())["case_id"] == "left-tibia-2"


def test_a_snapshot_does_not_write_over_what_is_being_typed(panel, widgets, presenter):
    widgets.begin_typing("caseIdLineEdit", "half a na")
    presenter.set_ball_diameter(8.0)
    assert widgets.get("caseIdLineEdit", "text") == "half a na"
    assert widgets.get("ballDiameterLineEdit", "text") == "8"


def test_six_readings_and_their_second_entry(panel, widgets, presenter, document):
    for strut in range(1, 7):
        widgets.type(f"reading{strut}LineEdit", f"{180 + strut}.5")
    assert document("strut_readings_mm") == [181.5, 182.5, 183.5, 184.5, 185.5, 186.5]
    assert presenter.snapshot.confirmed["readings"] is False
    for strut in range(1, 7):
        widgets.type(f"repeat{strut}LineEdit", f"{180 + strut}.5" if strut != 4 else "148.5")
    widgets.click("repeatReadingsButton")
    assert presenter.snapshot.confirmed["readings"] is False
    assert any("strut 4" in banner.message for banner in panel.banners())
    widgets.type("repeat4LineEdit", "184.5")
    widgets.click("repeatReadingsButton")
    assert presenter.snapshot.confirmed["readings"] is True
    assert "agree" in widgets.get("repeatStateLabel", "text")


def test_a_second_entry_with_a_gap_is_refused(panel, widgets, presenter):
    for strut in range(1, 7):
        widgets.type(f"reading{strut}LineEdit", "180")
    widgets.click("repeatReadingsButton")
    assert "not-a-number" in wrong(panel)
    assert presenter.snapshot.confirmed["readings"] is False


def test_a_row_of_the_layout_goes_into_the_case_once_it_is_whole(panel, widgets, document):
    widgets.click("addProximalMarkerButton")
    widgets.fill("proximalMarkersTable", [["1", "100", "", "20"]])
    assert widgets.get("proximalMarkersTable", "table") == [["1", "100", "", "20"]]
    widgets.fill("proximalMarkersTable", LAYOUT[:1])
    widgets.click("addProximalMarkerButton")
    widgets.fill("proximalMarkersTable", LAYOUT[:2])
    held = document("markers", "proximal")
    assert held[1] == {"number": 2, "radius_mm": 100.0, "sweep_deg": 105.0, "height_mm": 20.0}
    widgets.choose_row("proximalMarkersTable", 0)
    widgets.click("removeProximalMarkerButton")
    assert [row["number"] for row in document("markers", "proximal")] == [2]


def test_a_word_in_the_layout_is_marked_and_changes_nothing(panel, widgets, document):
    widgets.click("addDistalMarkerButton")
    widgets.fill("distalMarkersTable", LAYOUT[:1])
    widgets.fill("distalMarkersTable", [["1", "1O0", "0", "20"]])
    assert widgets.values["distalMarkersTable", "mark"]
    assert document("markers", "distal")[0]["radius_mm"] == 100.0
    assert not panel.commit()


def target(widgets, values=("0", "0", "185", "0", "0", "-2.5")):
    names = ("X", "Y", "Z", "Alpha", "Beta", "Gamma")
    for name, value in zip(names, values, strict=True):
        widgets.type(f"target{name}LineEdit", value)


def test_a_typed_correction_counts_only_once_it_is_used(panel, widgets, document, presenter):
    target(widgets)
    assert "correction" not in presenter.snapshot.document
    assert "No correction" in widgets.get("correctionStateLabel", "text")
    widgets.click("useCorrectionButton")
    assert document("correction") == {
        "kind": "target-pose",
        "position_mm": [0.0, 0.0, 185.0],
        "angles_deg": [0.0, 0.0, -2.5],
    }
    widgets.type("targetZLineEdit", "186")
    assert document("correction", "position_mm") == [0.0, 0.0, 186.0]
    widgets.click("undoButton")
    assert widgets.get("targetZLineEdit", "text") == "185"


def test_no_schedule_is_made_while_another_correction_was_typed(
    panel, widgets, presenter, monkeypatch
):
    started = []
    monkeypatch.setattr(presenter, "run_all", lambda: started.append("all"))
    monkeypatch.setattr(presenter, "run", started.append)
    target(widgets)
    widgets.click("useCorrectionButton")
    widgets.choose("correctionKindComboBox", 3)
    widgets.type("apAngulationLineEdit", "5")
    widgets.click("runAllButton")
    widgets.click("planButton")
    assert started == []
    assert "correction-not-in-use" in wrong(panel)
    widgets.click("recogniseButton")
    assert started == [Step.POSES]
    widgets.choose("correctionKindComboBox", 0)
    widgets.click("runAllButton")
    assert started == [Step.POSES, "all"]


def test_undo_shows_the_cases_number_though_another_was_typed_meanwhile(panel, widgets, document):
    target(widgets)
    widgets.click("useCorrectionButton")
    widgets.click("clearCorrectionButton")
    widgets.type("targetZLineEdit", "200")
    widgets.click("undoButton")
    assert document("correction", "position_mm")[2] == 185.0
    assert widgets.get("targetZLineEdit", "text") == "185"


def deformity(widgets):
    widgets.choose("correctionKindComboBox", 3)
    widgets.choose("deformityMovingComboBox", 2)
    for axis, value in zip("LPS", ("10", "-20", "300"), strict=True):
        widgets.type(f"origin{axis}LineEdit", value)
    widgets.type("apAngulationLineEdit", "8")
    widgets.choose("apAngulationComboBox", 1)


def test_a_deformity_stands_in_the_case_with_its_words(panel, widgets, document):
    deformity(widgets)
    widgets.click("useCorrectionButton")
    assert document("correction") == {
        "kind": "deformity",
        "moving": "distal",
        "origin_lps_mm": [10.0, -20.0, 300.0],
        "ap_angulation_deg": 8.0,
        "ap_angulation": "varus",
    }


def test_a_word_without_a_size_is_refused(panel, widgets, presenter):
    deformity(widgets)
    widgets.choose("axialTranslationComboBox", 1)
    widgets.click("useCorrectionButton")
    assert "size-missing" in wrong(panel)
    assert "correction" not in presenter.snapshot.document


def test_the_fragment_that_moves_is_never_guessed(panel, widgets, presenter):
    deformity(widgets)
    widgets.choose("deformityMovingComboBox", 0)
    widgets.click("useCorrectionButton")
    assert "moving-not-chosen" in wrong(panel)
    assert "correction" not in presenter.snapshot.document


@pytest.mark.parametrize("begun", [1, 2, 4, 5])
def test_a_click_never_mixes_its_axes_with_those_of_a_point_begun_by_typing(panel, widgets, begun):
    widgets.click("addLandmarkButton")
    (row,) = widgets.get("landmarksTable", "table")
    typed = ["7.5"] * begun + [""] * (len(row) - begun)
    widgets.fill("landmarksTable", [typed])
    widgets.tick("pickLandmarkButton")
    panel.clicked((1.0, 2.0, 3.0))
    panel.clicked((4.0, 5.0, 6.0))
    rows = widgets.get("landmarksTable", "table")
    points = [row[k : k + 3] for row in rows for k in (0, 3)]
    assert ["1", "2", "3"] in points
    assert ["4", "5", "6"] in points
    assert all(len(row) == 6 for row in rows)
    assert sum(cell == "7.5" for row in rows for cell in row) == begun


def test_landmarks_by_clicks_become_pairs(panel, widgets, document):
    widgets.choose("correctionKindComboBox", 2)
    widgets.choose("landmarksMovingComboBox", 1)
    widgets.tick("pickLandmarkButton")
    for value in range(6):
        panel.clicked((value, 10.0 * value, -value))
    widgets.click("useCorrectionButton")
    assert document("correction", "moving_points_lps_mm") == [[0, 0, 0], [2, 20, -2], [4, 40, -4]]
    assert document("correction", "fixed_points_lps_mm") == [[1, 10, -1], [3, 30, -3], [5, 50, -5]]
    assert len(widgets.get("landmarksTable", "table")) == 3


def test_a_schedule_is_used_whole_then_followed_live(panel, widgets, document, presenter):
    tomorrow = (datetime.date.today() + datetime.timedelta(1)).isoformat()
    widgets.values["startDateEdit", "date"] = tomorrow
    widgets.values["adjustmentsSpinBox", "value"] = 4
    widgets.type("strutStepLineEdit", "0.25")
    widgets.click("useScheduleButton")
    assert document("schedule") == {
        "start_date": tomorrow,
        "adjustments_per_day": 4,
        "compensation": "fused",
        "strut_step_mm": 0.25,
    }
    widgets.type("maxRateLineEdit", "0.8")
    widgets.tick("pickRiskPointButton")
    panel.clicked((1.0, 2.0, 3.0))
    assert document("schedule", "max_rate_mm_per_day") == 0.8
    assert document("schedule", "structures_at_risk_lps_mm") == [[1.0, 2.0, 3.0]]
    widgets.type("maxRateLineEdit", "")
    assert "max_rate_mm_per_day" not in document("schedule")


def test_side_bone_and_fixator_are_chosen_and_never_assumed(panel, widgets, presenter, document):
    assert widgets.get("limbSideComboBox", "index") == 0
    assert "limb" not in presenter.snapshot.document
    widgets.choose("limbSideComboBox", 2)
    widgets.choose("limbBoneComboBox", 2)
    assert document("limb") == {"side": "right", "bone": "femur"}
    items = widgets.values["fixatorComboBox", "items"]
    title = "Generic 6-SPS hexapod, 160 mm rings (generic-6sps-160)"
    widgets.choose("fixatorComboBox", items.index(title))
    assert document("fixator") == "generic-6sps-160"


def test_a_fixator_of_the_cases_own_stands_in_the_list_by_its_name(panel, widgets, presenter):
    presenter.set_fixator({"id": "own-160", "name": "Own hexapod"})
    items, index = (widgets.values["fixatorComboBox", what] for what in ("items", "index"))
    assert items[index] == "Own hexapod (definition in the case)"
    widgets.choose("fixatorComboBox", index)
    assert presenter.snapshot.document["fixator"]["id"] == "own-160"
    presenter.set_fixator("generic-6sps-160")
    assert not any("Own hexapod" in item for item in widgets.values["fixatorComboBox", "items"])


def test_a_choice_that_is_not_taken_over_is_taken_back(panel, widgets, presenter):
    widgets.choose("limbSideComboBox", 1)
    widgets.choose("confirmSideComboBox", 2)
    assert presenter.snapshot.confirmed["side"] is False
    assert widgets.get("confirmSideComboBox", "index") == 0
    assert "H37" in widgets.values["bannerBrowser", "html"]


def test_a_case_with_changes_is_left_only_when_the_user_says_so(panel, widgets, presenter):
    widgets.type("caseIdLineEdit", "mine")
    widgets.answers = [2]
    widgets.click("newCaseButton")
    assert presenter.snapshot.case_id == "mine"
    widgets.answers = [1]
    widgets.click("newCaseButton")
    assert presenter.snapshot.case_id == ""
    assert len(widgets.asked) == 2


def test_another_case_starts_with_empty_forms(panel, widgets, presenter):
    deformity(widgets)
    widgets.type("repeat1LineEdit", "180")
    widgets.type("ballDiameterLineEdit", "1O")
    widgets.answers = [1]
    widgets.click("newCaseButton")
    for name in ("apAngulationLineEdit", "repeat1LineEdit", "originLLineEdit"):
        assert widgets.get(name, "text") == ""
    assert panel.mistakes == {}


def test_a_click_without_a_mode_fills_the_place_only(panel, widgets, presenter):
    before = dict(presenter.snapshot.document)
    panel.clicked((1.25, -2.5, 3.0))
    places = [widgets.get(f"marker{axis}LineEdit", "text") for axis in "LPS"]
    assert places == ["1.25", "-2.5", "3"]
    assert dict(presenter.snapshot.document) == before


def test_a_click_does_nothing_of_the_page_that_was_left(panel, widgets, presenter):
    presenter.go_to(Step.MARKERS)
    widgets.tick("pickMarkerButton")
    presenter.go_to(Step.READINGS)
    assert widgets.get("pickMarkerButton", "checked") is False
    panel.clicked((1.0, 2.0, 3.0))
    assert "marker_edits" not in presenter.snapshot.document


def test_a_number_is_given_only_by_a_click_on_a_ball(panel, widgets):
    widgets.click("addProximalMarkerButton")
    widgets.fill("proximalMarkersTable", LAYOUT[:1])
    widgets.tick("pickNumberButton")
    panel.clicked((0.0, 0.0, 0.0), None)
    assert "no-ball-there" in wrong(panel)


def test_a_message_links_to_its_step_and_is_escaped(panel, widgets, presenter):
    from hexafix.panel.frame import banner_html
    from hexafix.presenter import Banner

    banner = Banner("1", "error", "x", "T <b>", "a & <i>", next_step="do", step=Step.READINGS)
    html = banner_html((banner,))
    assert "<i>" not in html
    assert "&lt;i&gt;" in html
    event, follow = widgets.callbacks["bannerBrowser"]
    assert event == "link"
    follow("step:readings")
    assert presenter.snapshot.current == Step.READINGS
    follow("step:elsewhere")
    assert presenter.snapshot.current == Step.READINGS


@pytest.mark.parametrize("place", range(8))
def test_the_list_of_steps_opens_their_pages(panel, widgets, presenter, place):
    event, chosen = widgets.callbacks["stepList"]
    assert event == "row"
    chosen(place)
    assert widgets.get("stepStack", "index") == place
    assert presenter.snapshot.current == list(Step)[place]


def test_a_mistake_is_told_without_keys_of_the_case_file(panel, widgets):
    from hexafix.errors import InputError
    from hexafix.panel.panel import BINDINGS

    error = InputError.of(
        "x", "it is wrong", value="1", limit="2", where="schedule.strut_step_mm", next_step="mend"
    )
    binding = next(b for b in BINDINGS if b.widget == "strutStepLineEdit")
    panel._wrong(binding, error)
    words = "it is wrong (value 1, limit 2), at: smallest strut step"
    assert panel.notices[0].message == words
    assert widgets.values["strutStepLineEdit", "mark"] == f"{words}. Next step: mend"


def test_a_case_with_odd_values_is_shown_without_them(panel, presenter, odd_documents):
    for document in odd_documents:
        assert presenter.edit("odd", lambda _, document=document: document)
    assert panel.snapshot.can_undo


def test_no_numbers_of_another_motion_stand_beside_one_that_none_can_tell(
    panel, widgets, presenter, monkeypatch
):
    from hexafix.panel import correction

    monkeypatch.setattr(correction, "center", lambda panel: [1.0, 2.0, 3.0])
    value = presenter.value
    monkeypatch.setattr(
        presenter, "value", lambda step: object() if step == Step.POSES else value(step)
    )
    shift = [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    turn = [[0.0, 0.0, 1.0, 0.0], [0.0, 1.0, 0.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
    given = {"kind": "fragment-motion", "moving": "distal"}
    presenter.set_correction({**given, "matrix_lps": shift})
    assert widgets.get("motionXLineEdit", "text") == "5"
    presenter.set_correction({**given, "matrix_lps": turn})
    assert {widgets.get(name, "text") for name in correction.MOTION} == {""}
