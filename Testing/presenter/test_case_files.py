"""Cases are opened, saved and opened again at any point, whole or not at all."""

import json
import os

import pytest
from hexafix.presenter import Step, StepState


def test_an_unedited_case_keeps_its_bytes(a_presenter, a_case_file):
    raw = a_case_file.read_bytes()
    a_presenter.run_all()
    assert a_presenter.version.raw == raw
    assert a_presenter.save_case()
    assert a_case_file.read_bytes() == raw
    assert not a_presenter.snapshot.edited


def test_an_edit_that_changes_nothing_is_none(a_presenter, a_case_file):
    raw = a_case_file.read_bytes()
    a_presenter.set_ball_diameter(10.0)
    a_presenter.set_limb(side="left")
    a_presenter.set_case_id("left-tibia-01")
    assert a_presenter.version.raw == raw
    assert not a_presenter.snapshot.can_undo


def test_the_folder_of_a_case_opens_its_case(a_presenter, a_case_file):
    assert a_presenter.open_case(a_case_file.parent)
    assert a_presenter.snapshot.case_path == str(a_case_file)


@pytest.mark.parametrize(
    ("content", "code"),
    [
        (None, "file-unreadable"),
        ("{", "not-json"),
        ("[]", "not-json"),
        ("{}", "not-a-case"),
        ('{"schema_version": 1, "schema_version": 2}', "duplicate-key"),
        ('{"schema_version": NaN}', "not-json"),
    ],
)
def test_what_is_no_case_file_is_told_and_the_open_case_stays(
    content, code, a_planned, tmp_path, codes
):
    file = tmp_path / "other.json"
    if content is not None:
        file.write_text(content)
    before = a_planned.version
    assert not a_planned.open_case(file)
    assert code in codes(a_planned)
    assert a_planned.version is before
    assert a_planned.snapshot.can_export


def test_a_new_case_waits_and_says_what_is_missing(make_presenter, an_engine):
    presenter = make_presenter(engine=an_engine, threaded=False)
    views = {view.step: view for view in presenter.snapshot.steps}
    assert {view.state for view in views.values()} == {StepState.WAITING}
    assert views[Step.LOAD].summary == "choose the CT"
    assert views[Step.READINGS].summary == "read all six struts"
    assert views[Step.CORRECTION].summary == "give the correction"
    assert [banner.kind for banner in presenter.snapshot.banners] == []
    assert not presenter.snapshot.edited


def test_a_case_is_made_step_by_step_and_each_step_runs_as_soon_as_it_can(
    make_presenter, an_engine, a_case, tmp_path, states
):
    presenter = make_presenter(engine=an_engine, threaded=False)
    (tmp_path / "ct.txt").write_text("one image")
    presenter.load_image(tmp_path / "ct.txt")
    assert states(presenter)["load"] == "done"
    presenter.set_ball_diameter(10.0)
    presenter.run(Step.MARKERS)
    assert states(presenter)["markers"] == "done"
    for ring in ("proximal", "distal"):
        presenter.set_markers(ring, a_case["markers"][ring])
    assert states(presenter)["numbering"] == "done"
    assert states(presenter)["poses"] == "waiting"
    presenter.set_limb(side="left", bone="tibia")
    presenter.set_fixator("generic-6sps-160")
    presenter.run(Step.POSES)
    for strut, mm in enumerate(a_case["strut_readings_mm"], 1):
        presenter.set_reading(strut, mm)
    assert states(presenter)["readings"] == "done"
    presenter.set_correction(a_case["correction"])
    assert states(presenter)["correction"] == "done"
    presenter.set_schedule(a_case["schedule"])
    presenter.set_case_id("left-tibia-01")
    presenter.confirm_ring_front(True)
    assert presenter.run_all()
    presenter.confirm_side("left")
    presenter.repeat_readings(a_case["strut_readings_mm"])
    assert presenter.snapshot.can_export, presenter.snapshot.export_blocked_by


@pytest.mark.parametrize("kept", range(8))
def test_a_draft_is_saved_and_opened_again_at_any_point(
    kept, make_presenter, an_engine, a_case, tmp_path
):
    first = make_presenter(engine=an_engine, threaded=False)
    (tmp_path / "ct.txt").write_text("one image")
    edits = [
        lambda p: p.load_image(tmp_path / "ct.txt"),
        lambda p: p.set_ball_diameter(10.0),
        lambda p: p.set_markers("proximal", a_case["markers"]["proximal"]),
        lambda p: p.set_limb(side="left"),
        lambda p: p.set_reading(3, 167.0),
        lambda p: p.set_correction({"kind": "target-pose"}),
        lambda p: p.set_schedule({"start_date": ""}),
    ]
    for edit in edits[:kept]:
        assert edit(first)
    assert first.snapshot.edited == (kept > 0)
    assert first.save_case(tmp_path / "draft.json")
    assert not first.snapshot.edited
    second = make_presenter(engine=an_engine, threaded=False)
    assert second.open_case(tmp_path / "draft.json")
    assert second.version.raw == first.version.raw
    if kept:
        assert second.run(Step.LOAD)
    assert [(v.step, v.summary, v.faults) for v in second.snapshot.steps] == [
        (v.step, v.summary, v.faults) for v in first.snapshot.steps
    ]


def test_a_case_saved_elsewhere_leads_to_the_same_files(a_presenter, tmp_path, states):
    from hexafix.case import load_case

    a_presenter.run_all()
    assert a_presenter.save_case(tmp_path / "below" / "here" / "case.json")
    assert a_presenter.snapshot.document["image"]["path"] == "../../ct.txt"
    assert a_presenter.snapshot.case_path == str(tmp_path / "below" / "here" / "case.json")
    loaded = load_case(tmp_path / "below" / "here" / "case.json")
    assert loaded.image_path == tmp_path / "ct.txt"
    # the plan names the hash of the case's bytes, which are others now
    assert {s for s, state in states(a_presenter).items() if state != "done"} == {
        "schedule",
        "export",
    }
    a_presenter.run_all()
    assert a_presenter.value(Step.LOAD) is not None


def test_an_edit_undone_after_the_case_was_saved_elsewhere_is_read_from_its_own_folder(
    a_presenter, tmp_path, states
):
    raw = a_presenter.version.raw
    a_presenter.set_case_id("other")
    a_presenter.save_case(tmp_path / "below" / "case.json")
    a_presenter.undo()
    assert a_presenter.version.raw == raw
    assert a_presenter.snapshot.edited
    a_presenter.run(Step.LOAD)
    assert states(a_presenter)["load"] == "done"


def test_a_file_changed_by_another_program_is_not_overwritten(a_presenter, a_case_file, codes):
    a_presenter.set_case_id("mine")
    a_case_file.write_text('{"schema_version": 1, "case_id": "theirs"}')
    assert not a_presenter.save_case()
    (banner,) = (b for b in a_presenter.snapshot.banners if b.kind == "error")
    assert (banner.code, banner.hazard) == ("case-changed-on-disk", "H47")
    assert "theirs" in a_case_file.read_text()
    assert a_presenter.snapshot.edited


def test_a_case_without_a_file_asks_where_to_save(make_presenter, an_engine, codes):
    presenter = make_presenter(engine=an_engine)
    assert not presenter.save_case()
    assert codes(presenter) == ["no-case-file"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_disk_that_fills_up_leaves_the_older_file_whole(
    call, a_presenter, a_case_file, monkeypatch, codes
):
    raw = a_case_file.read_bytes()
    a_presenter.set_case_id("other")

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, call, full)
    assert not a_presenter.save_case()
    monkeypatch.undo()
    assert a_case_file.read_bytes() == raw
    assert codes(a_presenter)[0] == "file-not-written"
    assert a_presenter.snapshot.edited
    assert sorted(p.name for p in a_case_file.parent.iterdir() if "staging" in p.name) == []
    assert a_presenter.save_case()
    assert json.loads(a_case_file.read_bytes())["case_id"] == "other"


def test_what_cannot_stand_in_a_file_is_refused(a_presenter, codes):
    raw = a_presenter.version.raw
    assert not a_presenter.set_ball_diameter(float("nan"))
    assert codes(a_presenter)[0] == "not-json"
    assert not a_presenter.edit("x", lambda document: {**document, "case_id": {1, 2}})
    assert a_presenter.version.raw == raw


def test_a_wrong_value_is_kept_told_at_its_step_and_stops_it(a_presenter, states):
    a_presenter.run_all()
    a_presenter.set_ball_diameter(80.0)
    assert a_presenter.snapshot.document["markers"]["ball_diameter_mm"] == 80.0
    view = a_presenter.snapshot.view(Step.MARKERS)
    assert view.faults[0].where == "markers.ball_diameter_mm"
    (banner,) = (b for b in a_presenter.snapshot.banners if b.step == Step.MARKERS)
    assert "80" in banner.message
    assert not a_presenter.snapshot.can_export
    a_presenter.undo()
    assert set(states(a_presenter).values()) == {"done"}


def test_the_shown_document_cannot_be_used_to_change_the_case(a_presenter):
    raw = a_presenter.version.raw
    with pytest.raises(TypeError):
        a_presenter.snapshot.document["case_id"] = "other"
    a_presenter.snapshot.document["limb"]["side"] = "right"
    a_presenter.set_case_id("other")
    a_presenter.undo()
    assert a_presenter.version.raw == raw
    a_presenter.set_limb(bone="femur")
    assert json.loads(a_presenter.version.raw)["limb"]["side"] == "left"


def test_who_may_read_a_case_stays_as_it_was_and_leftovers_go(a_presenter, a_case_file):
    a_case_file.chmod(0o600)
    (a_case_file.parent / ".case.json.staging-killed").write_text("half")
    a_presenter.set_case_id("other")
    assert a_presenter.save_case()
    assert a_case_file.stat().st_mode & 0o777 == 0o600
    assert {path.name for path in a_case_file.parent.iterdir()} == {"case.json", "ct.txt"}
