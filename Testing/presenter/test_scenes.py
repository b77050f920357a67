"""A scene is opened whole or not at all, and the work goes on exactly where it stood."""

import hashlib
import json
import threading

import pytest
from hexafix.errors import Refused
from hexafix.presenter import Step, StepState


@pytest.fixture
def a_scene(a_planned, save_fake_scene, tmp_path):
    """The scene of the planned case, in a folder of its own."""
    path = tmp_path / "scenes" / "tibia.mrb"
    path.parent.mkdir()
    save_fake_scene(a_planned, path)
    return path


@pytest.fixture
def another(make_presenter, a_fake_engine_class, a_fake_scene_reader):
    """A presenter that was started later, with an empty case."""
    return make_presenter(
        engine=a_fake_engine_class(), threaded=False, read_scene=a_fake_scene_reader
    )


@pytest.fixture
def a_busy_planned(make_presenter, an_engine, a_case_file, a_fake_scene_reader):
    """With a plan, and a reader of scenes that waits until it may go on."""
    reading, go_on = threading.Event(), threading.Event()

    def read_scene(path, *, progress):
        reading.set()
        assert go_on.wait(20)
        return a_fake_scene_reader(path, progress=progress)

    presenter = make_presenter(engine=an_engine, read_scene=read_scene)
    presenter.open_case(a_case_file)
    presenter.run_all()
    assert presenter.wait(20)
    presenter.confirm_side("left")
    assert presenter.snapshot.can_export
    presenter.reading, presenter.go_on = reading, go_on
    return presenter


def exported(presenter, folder):
    assert presenter.export(folder), presenter.snapshot.export_blocked_by
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def test_a_scene_gives_the_export_that_was_planned_before_it_was_saved(
    a_planned, a_scene, another, tmp_path
):
    assert another.open_scene(a_scene)
    assert {view.state for view in another.snapshot.steps} == {StepState.DONE}
    another.confirm_side("left")
    assert exported(another, tmp_path / "two") == exported(a_planned, tmp_path / "one")


def test_a_scene_is_opened_as_a_case_is(a_scene, another):
    assert another.open_case(a_scene)
    assert another.snapshot.case_id == "left-tibia-01"
    assert another.snapshot.case_path is None
    assert not another.snapshot.edited
    assert not another.snapshot.can_undo


def test_the_side_is_asked_again_for_an_opened_scene(a_scene, another):
    another.open_scene(a_scene)
    assert "side" in another.snapshot.export_blocked_by


def test_step_cut_and_accepted_layout_come_back(a_planned, another, save_fake_scene, tmp_path):
    a_planned.go_to(Step.CORRECTION)
    a_planned.split_fraction = 0.3
    a_planned.accept_relaxed_layout(True)
    a_planned.run(Step.POSES)
    save_fake_scene(a_planned, tmp_path / "a.mrb")
    another.open_scene(tmp_path / "a.mrb")
    snapshot = another.snapshot
    assert (snapshot.current, another.split_fraction) == (Step.CORRECTION, 0.3)
    assert snapshot.confirmed["relaxed_layout"]
    assert another.is_fresh(Step.POSES)
    assert not another.is_fresh(Step.SCHEDULE), "only what was computed is computed"


def test_an_edit_has_a_hash_of_its_own_and_undo_brings_the_files_back(
    a_planned, a_scene, another, an_engine
):
    another.open_scene(a_scene)
    planned = another.value(Step.SCHEDULE).made
    assert another.version.sha256 == a_planned.version.sha256
    assert another.version.sha256 != hashlib.sha256(another.version.raw).hexdigest()
    another.set_case_id("other")
    assert another.version.sha256 == hashlib.sha256(another.version.raw).hexdigest()
    another.run_all()
    assert another.value(Step.SCHEDULE).made != planned
    another.undo()
    assert another.version.sha256 == a_planned.version.sha256
    assert another.is_fresh(Step.SCHEDULE)
    assert another.value(Step.SCHEDULE).made == planned


def test_two_scenes_of_one_case_that_tell_other_hashes_have_other_plans(
    a_scene, another, a_planned, save_fake_scene
):
    another.open_scene(a_scene)
    planned = another.value(Step.SCHEDULE).made
    save_fake_scene(a_planned, a_scene, case_sha256="c" * 64)
    another.open_scene(a_scene)
    assert another.value(Step.SCHEDULE).made != planned


def test_readings_typed_once_are_still_to_be_repeated(
    a_planned, another, save_fake_scene, tmp_path
):
    a_planned.set_reading(1, 180.5)
    a_planned.run_all()
    save_fake_scene(a_planned, tmp_path / "once.mrb")
    another.open_scene(tmp_path / "once.mrb")
    another.run_all()
    another.confirm_side("left")
    assert another.snapshot.confirmed["readings_needed"]
    assert not another.snapshot.can_export
    assert "readings_to_repeat" not in another.snapshot.document
    assert another.version.sha256 == hashlib.sha256(another.version.raw).hexdigest()
    a_planned.repeat_readings(a_planned.version.content["strut_readings_mm"])
    save_fake_scene(a_planned, tmp_path / "twice.mrb")
    another.open_scene(tmp_path / "twice.mrb")
    another.run_all()
    another.confirm_side("left")
    assert another.snapshot.can_export, another.snapshot.export_blocked_by


@pytest.mark.parametrize(
    ("content", "code"),
    [
        ("no scene", "bundle-damaged"),
        ({"document": {}}, "not-a-case"),
        ({"document": {"schema_version": True}}, "not-a-case"),
        ({"document": {"schema_version": 1, "case_id": "\ud800"}}, "not-json"),
    ],
)
def test_a_refused_scene_leaves_the_open_case_as_it_was(
    content, code, a_scene, another, codes, tmp_path
):
    another.open_scene(a_scene)
    another.confirm_side("left")
    before = another.version
    bad = tmp_path / "bad.mrb"
    held = {**json.loads(a_scene.read_text()), **content} if isinstance(content, dict) else content
    bad.write_text(json.dumps(held) if isinstance(held, dict) else held)
    another.open_scene(bad)
    assert code in codes(another)
    assert another.version is before
    assert another.snapshot.can_export
    assert another.snapshot.confirmed["side"]


def test_a_case_edited_while_the_scene_is_read_stays_as_it_was_edited(
    a_busy_planned, a_scene, codes
):
    assert a_busy_planned.open_scene(a_scene)
    assert a_busy_planned.reading.wait(20)
    a_busy_planned.set_case_id("edited")
    a_busy_planned.go_on.set()
    assert a_busy_planned.wait(20)
    assert a_busy_planned.snapshot.case_id == "edited"
    assert "scene-changed-meanwhile" in codes(a_busy_planned)


def test_a_scene_replaced_while_it_is_read_is_not_opened(
    a_busy_planned, a_scene, a_planned, save_fake_scene, codes
):
    before = a_busy_planned.version
    a_busy_planned.open_scene(a_scene)
    assert a_busy_planned.reading.wait(20)
    a_planned.set_case_id("another-case-of-other-length")
    save_fake_scene(a_planned, a_scene)
    a_busy_planned.go_on.set()
    assert a_busy_planned.wait(20)
    assert a_busy_planned.version is before
    assert codes(a_busy_planned) == ["scene-changed-meanwhile"]
    assert a_busy_planned.snapshot.can_export


def test_opening_can_be_stopped_and_the_open_case_stays(a_busy_planned, a_scene, codes):
    before = a_busy_planned.version
    a_busy_planned.open_scene(a_scene)
    assert a_busy_planned.reading.wait(20)
    a_busy_planned.cancel()
    a_busy_planned.go_on.set()
    assert a_busy_planned.wait(20)
    assert a_busy_planned.version is before
    assert codes(a_busy_planned) == ["cancelled"]


def test_a_scene_read_whole_is_not_taken_once_its_opening_was_stopped(
    make_presenter, an_engine, a_scene, a_fake_scene_reader
):
    """The door's thread takes it later than the working thread has read it."""
    waiting = []
    presenter = make_presenter(
        engine=an_engine, read_scene=a_fake_scene_reader, post=waiting.append, threaded=False
    )
    presenter.open_scene(a_scene)
    presenter.cancel()
    for call in waiting:
        call()
    assert presenter.snapshot.case_id == ""


def test_a_new_case_ends_the_opening_of_a_scene(a_busy_planned, a_scene):
    a_busy_planned.open_scene(a_scene)
    assert a_busy_planned.reading.wait(20)
    a_busy_planned.new_case()
    a_busy_planned.go_on.set()
    assert a_busy_planned.wait(20)
    assert a_busy_planned.snapshot.case_id == ""


def test_a_scene_without_a_ct_waits_for_one(a_planned, another, save_fake_scene, tmp_path):
    save_fake_scene(a_planned, tmp_path / "a.mrb", volume=None)
    another.open_scene(tmp_path / "a.mrb")
    assert "image" not in another.snapshot.document
    assert another.snapshot.view(Step.LOAD).state == StepState.WAITING
    assert another.snapshot.view(Step.LOAD).summary == "choose the CT"
    another.load_image(tmp_path / "ct.txt")
    assert another.run_all()
    assert another.is_fresh(Step.EXPORT)


def test_a_case_saved_from_a_scene_finds_its_ct_in_the_scene(
    a_scene, another, make_presenter, a_fake_engine_class, a_fake_scene_reader, tmp_path
):
    another.open_scene(a_scene)
    assert another.save_case(tmp_path / "case" / "case.json")
    saved = (tmp_path / "case" / "case.json").read_bytes()
    assert json.loads(saved)["image"]["path"] == "../scenes/tibia.mrb"
    # the case file is another one now, and a plan names it
    assert another.version.sha256 == hashlib.sha256(saved).hexdigest()
    assert another.snapshot.view(Step.SCHEDULE).state == StepState.STALE
    another.run_all()
    third = make_presenter(
        engine=a_fake_engine_class(), threaded=False, read_scene=a_fake_scene_reader
    )
    third.open_case(tmp_path / "case" / "case.json")
    third.run_all()
    assert third.value(Step.EXPORT).made == another.value(Step.EXPORT).made


def test_a_case_saved_beside_its_scene_is_named_by_its_own_bytes(a_scene, another):
    another.open_scene(a_scene)
    assert another.save_case(a_scene.parent / "case.json")
    saved = (a_scene.parent / "case.json").read_bytes()
    assert another.version.sha256 == hashlib.sha256(saved).hexdigest()


def test_no_case_is_saved_over_a_scene(a_scene, another, codes):
    raw = a_scene.read_bytes()
    another.open_scene(a_scene)
    assert not another.save_case(a_scene)
    assert codes(another)[0] == "case-named-as-scene"
    assert a_scene.read_bytes() == raw


def test_the_ct_of_a_scene_is_read_from_it_again_when_others_took_its_place(
    a_scene, another, tmp_path
):
    another.open_scene(a_scene)
    made = another.value(Step.EXPORT).made
    for name in ("one", "two", "three"):
        (tmp_path / f"{name}.txt").write_text(name)
        another.load_image(tmp_path / f"{name}.txt")
    for _ in range(3):
        another.undo()
    assert not another.is_fresh(Step.LOAD)
    another.run_all()
    assert another.value(Step.EXPORT).made == made


def test_a_scene_saved_over_its_own_file_need_not_be_read_again(
    a_scene, another, save_fake_scene, tmp_path
):
    another.open_scene(a_scene)
    another.confirm_side("left")
    reads = another.engine.calls.count("read_image")
    save_fake_scene(another, a_scene, step="export")
    another.scene_written(a_scene, another.value(Step.LOAD))
    assert exported(another, tmp_path / "out")
    assert another.engine.calls.count("read_image") == reads


def test_a_scene_written_with_an_older_ct_leaves_the_present_one_to_be_read(
    a_scene, another, save_fake_scene, tmp_path
):
    another.open_scene(a_scene)
    older = another.value(Step.LOAD)
    (tmp_path / "other.txt").write_text("another image")
    another.load_image(tmp_path / "other.txt")
    present = another.value(Step.LOAD)
    another.scene_written(a_scene, older)
    another.scene_written(a_scene, present)
    assert another.value(Step.LOAD) is present
    another.undo()
    save_fake_scene(another, a_scene, volume="a third image, of another length")
    another.scene_written(a_scene, present)
    another.run(Step.LOAD)
    assert another.value(Step.LOAD).made == "a third image, of another length"


def test_a_scene_written_elsewhere_says_nothing_of_a_ct_that_changed_on_disk(a_planned, tmp_path):
    (tmp_path / "ct.txt").write_text("another image")
    a_planned.scene_written(tmp_path / "elsewhere.mrb", a_planned.value(Step.LOAD))
    assert not a_planned.export(tmp_path / "out")


def test_a_scene_with_another_ct_in_its_place_greys_what_was_computed(
    a_scene, another, a_planned, save_fake_scene, tmp_path
):
    another.open_scene(a_scene)
    another.confirm_side("left")
    save_fake_scene(a_planned, a_scene, volume="another CT, of another length")
    assert not another.export(tmp_path / "out")
    assert not another.is_fresh(Step.EXPORT)


def test_a_fixator_of_a_file_goes_along_as_its_definition(
    a_planned, another, save_fake_scene, tmp_path
):
    from hexafix.paths import resources

    definition = json.loads((resources() / "Hardware/Frames/generic-6sps-160.json").read_text())
    (tmp_path / "mine.json").write_text(json.dumps(definition))
    a_planned.set_fixator(str(tmp_path / "mine.json"))
    assert a_planned.snapshot.document["fixator"] == "mine.json"
    a_planned.run_all()
    (tmp_path / "scenes").mkdir()
    save_fake_scene(a_planned, tmp_path / "scenes" / "a.mrb")
    another.open_scene(tmp_path / "scenes" / "a.mrb")
    assert another.snapshot.document["fixator"] == definition
    assert another.value(Step.EXPORT).made == a_planned.value(Step.EXPORT).made


def test_a_door_without_a_reader_of_scenes_says_so(a_planned, a_scene, codes):
    before = a_planned.version
    assert not a_planned.open_scene(a_scene)
    assert codes(a_planned) == ["scene-not-opened-here"]
    assert a_planned.version is before


def test_an_error_of_the_reader_is_told_and_names_no_path(make_presenter, an_engine, tmp_path):
    def read_scene(path, *, progress):
        raise Refused.of("bundle-path", "an entry leads out", hazard="H48", next_step="do not")

    presenter = make_presenter(engine=an_engine, threaded=False, read_scene=read_scene)
    presenter.open_scene(tmp_path / "Doe.mrb")
    (banner,) = presenter.snapshot.banners
    assert (banner.kind, banner.code, banner.hazard) == ("refused", "bundle-path", "H48")
    assert "Doe" not in banner.message
