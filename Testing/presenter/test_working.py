"""Long steps leave the door's thread: progress, stop, edits meanwhile, defects, the end."""

import queue
import threading

import pytest
from hexafix.errors import InputError, Refused
from hexafix.presenter import Step


@pytest.fixture
def a_worker(make_presenter, an_engine, a_case_file):
    """With a working thread of its own; what is held is let go at the end."""
    presenter = make_presenter(engine=an_engine)
    presenter.open_case(a_case_file)
    yield presenter
    for event in an_engine.hold.values():
        event.set()


def hold(engine, name):
    engine.hold[name] = threading.Event()
    engine.entered.clear()
    return engine.hold[name]


def test_work_leaves_the_calling_thread_and_ends(a_worker, an_engine, states):
    go = hold(an_engine, "find_case_balls")
    assert a_worker.run_all()
    assert an_engine.entered.wait(10)
    assert a_worker.snapshot.busy
    assert states(a_worker)["markers"] == "running"
    assert a_worker.snapshot.export_blocked_by.startswith("work is under way")
    go.set()
    assert a_worker.wait(20)
    assert set(states(a_worker).values()) == {"done"}
    assert a_worker.snapshot.progress is None


def test_progress_is_told_with_its_words(a_worker):
    seen = []
    a_worker.changed.connect(lambda snapshot: seen.append(snapshot.progress))
    a_worker.run_all()
    a_worker.wait(20)
    texts = [progress[0] for progress in seen if progress]
    order = ["read_image", "find_case_balls", "recognise", "plan the correction", "prescribe"]
    assert list(dict.fromkeys(texts)) == order
    assert all(0.0 <= progress[1] <= 1.0 for progress in seen if progress)


def test_wait_gives_up_in_time(a_worker, an_engine):
    hold(an_engine, "read_image")
    a_worker.run_all()
    assert not a_worker.wait(0.01)


def test_cancel_leaves_older_results_as_they_were(a_worker, an_engine, states, codes):
    a_worker.run_all()
    assert a_worker.wait(20)
    older = {step: a_worker.value(step) for step in Step}
    a_worker.set_ball_diameter(9.5)
    hold(an_engine, "recognise")
    a_worker.run_all()
    assert an_engine.entered.wait(10)
    assert a_worker.cancel()
    assert a_worker.wait(20)
    assert codes(a_worker)[0] == "cancelled"
    found = states(a_worker)
    assert (found["markers"], found["poses"], found["export"]) == ("done", "stale", "stale")
    for step in (Step.POSES, Step.SCHEDULE, Step.EXPORT):
        assert a_worker.value(step) is older[step]
    a_worker.undo()
    assert set(states(a_worker).values()) == {"done"}


def test_an_edit_meanwhile_computes_the_case_as_it_is_then(a_worker, an_engine, states):
    go = hold(an_engine, "find_case_balls")
    a_worker.run_all()
    assert an_engine.entered.wait(10)
    calls = an_engine.calls.count("search")
    a_worker.set_ball_diameter(9.5)
    go.set()
    assert a_worker.wait(20)
    assert set(states(a_worker).values()) == {"done"}
    assert an_engine.calls.count("search") == calls + 1
    straight = an_engine.find_case_balls(a_worker.value("load"), ball_diameter_mm=9.5)
    assert a_worker.value("markers").made == straight.made


def test_an_edit_that_does_not_concern_the_running_step_lets_it_finish(a_worker, an_engine):
    go = hold(an_engine, "read_image")
    a_worker.run_all()
    assert an_engine.entered.wait(10)
    a_worker.set_ball_diameter(9.5)
    go.set()
    assert a_worker.wait(20)
    assert an_engine.calls.count("read_image") == 1
    assert a_worker.is_fresh(Step.EXPORT)


def test_more_work_asked_for_meanwhile_is_done_after(a_worker, an_engine, states):
    go = hold(an_engine, "read_image")
    a_worker.run(Step.LOAD)
    assert an_engine.entered.wait(10)
    assert a_worker.run(Step.POSES)
    go.set()
    assert a_worker.wait(20)
    assert states(a_worker)["poses"] == "done"
    assert states(a_worker)["schedule"] == "ready"


def test_another_case_opened_meanwhile_stops_the_work(
    a_worker, an_engine, a_case, tmp_path, states
):
    import json

    (tmp_path / "b.json").write_text(json.dumps({**a_case, "case_id": "b"}))
    go = hold(an_engine, "recognise")
    a_worker.run_all()
    assert an_engine.entered.wait(10)
    assert a_worker.open_case(tmp_path / "b.json")
    assert a_worker.run(Step.LOAD)
    go.set()
    assert a_worker.wait(20)
    assert a_worker.snapshot.case_id == "b"
    assert states(a_worker)["load"] == "done"
    assert a_worker.value(Step.SCHEDULE) is None


def test_an_export_while_work_is_under_way_is_refused(a_worker, an_engine, tmp_path, codes):
    hold(an_engine, "read_image")
    a_worker.run_all()
    assert an_engine.entered.wait(10)
    assert not a_worker.export(tmp_path / "out")
    assert codes(a_worker)[0] == "export-blocked"


@pytest.mark.parametrize("name", ["read_image", "find_case_balls", "recognise", "prescribe"])
def test_a_refusal_in_a_step_is_its_banner_and_later_steps_are_not_run(
    name, a_worker, an_engine, states
):
    an_engine.fail[name] = Refused.of(
        "a-gate", "it refuses", value="7 mm", limit="5 mm", hazard="H12", next_step="look again"
    )
    a_worker.run_all()
    assert a_worker.wait(20)
    step = dict(
        zip(
            ["read_image", "find_case_balls", "recognise", "prescribe"],
            ["load", "markers", "poses", "export"],
            strict=True,
        )
    )[name]
    (banner,) = (b for b in a_worker.snapshot.banners if b.kind == "refused")
    assert (banner.code, banner.hazard, banner.step) == ("a-gate", "H12", step)
    assert banner.message == "it refuses (value 7 mm, limit 5 mm)"
    assert banner.next_step == "look again"
    assert states(a_worker)[step] == "refused"
    assert not a_worker.snapshot.can_export
    an_engine.fail.clear()
    a_worker.run_all()
    assert a_worker.wait(20)
    assert set(states(a_worker).values()) == {"done"}
    assert not [b for b in a_worker.snapshot.banners if b.kind == "refused"]


def test_older_results_stay_grey_where_a_step_refuses(a_planned, an_engine, states):
    older = a_planned.value(Step.POSES)
    an_engine.fail["recognise"] = Refused.of("a-gate", "it refuses")
    a_planned.set_limb(bone="femur")
    a_planned.run_all()
    assert states(a_planned)["poses"] == "refused"
    assert states(a_planned)["schedule"] == "stale"
    assert a_planned.value(Step.POSES) is older
    assert a_planned.snapshot.tables["poses"].stale
    assert a_planned.snapshot.tables["strut_plan"].stale


def test_a_wrong_input_is_an_error_and_no_refusal(a_presenter, an_engine):
    an_engine.fail["read_image"] = InputError.of("file-unreadable", "it cannot be read")
    a_presenter.run(Step.LOAD)
    assert [b.kind for b in a_presenter.snapshot.banners] == ["error"]


@pytest.mark.parametrize(
    "name", ["read_image", "find_case_balls", "judge", "recognise", "weigh", "preview", "plan"]
)
def test_a_defect_is_told_without_what_it_holds(name, a_worker, an_engine):
    an_engine.fail[name] = ZeroDivisionError("Doe^Jane 1970-01-01")
    a_worker.run_all()
    assert a_worker.wait(20)
    (banner,) = (b for b in a_worker.snapshot.banners if b.code == "defect")
    assert "ZeroDivisionError at conftest.py:" in banner.message
    assert banner.kind == "error"
    assert "Doe" not in repr(a_worker.snapshot)
    assert not a_worker.snapshot.can_export


def test_a_defect_in_showing_a_value_blocks_the_export(a_planned, an_engine, monkeypatch, tmp_path):
    good = type(an_engine).balls_document
    monkeypatch.setattr(
        an_engine, "balls_document", lambda balls: {**good(an_engine, balls), "balls": [{}]}
    )
    a_planned.set_ball_diameter(9.5)
    a_planned.run_all()
    assert [b.code for b in a_planned.snapshot.banners] == ["defect"]
    assert not a_planned.snapshot.can_export
    assert not a_planned.export(tmp_path / "out")


def test_what_is_missing_ends_the_work_at_its_step(a_presenter, states, codes):
    a_presenter.set_correction(None)
    a_presenter.run_all()
    found = states(a_presenter)
    assert (found["readings"], found["correction"]) == ("done", "waiting")
    assert "missing" in codes(a_presenter)


def test_the_doors_own_thread_gets_every_snapshot(make_presenter, an_engine, a_case_file):
    jobs, threads = queue.Queue(), set()
    presenter = make_presenter(engine=an_engine, post=jobs.put)
    presenter.changed.connect(lambda _: threads.add(threading.current_thread().name))
    presenter.open_case(a_case_file)
    presenter.run_all()
    while presenter.snapshot.busy:
        jobs.get(timeout=20)()
    assert threads == {threading.main_thread().name}
    assert presenter.is_fresh(Step.EXPORT)


def test_a_closed_presenter_tells_and_does_nothing_more(a_worker, an_engine):
    hold(an_engine, "read_image")
    a_worker.run_all()
    assert an_engine.entered.wait(10)
    seen = []
    a_worker.changed.connect(seen.append)
    a_worker.close()
    assert not any(t.name == "hexafix-work" for t in threading.enumerate())
    assert seen == []
    assert not a_worker.set_case_id("other")
    a_worker.close()


def test_work_that_cannot_be_stopped_does_not_keep_a_closed_door_alive(
    make_presenter, an_engine, a_case_file, monkeypatch
):
    from hexafix.presenter import worker

    monkeypatch.setattr(worker, "JOIN_S", 0.01)
    let_go, entered = threading.Event(), threading.Event()

    def deaf(*_, **__):
        entered.set()
        let_go.wait(20)

    an_engine.read_image = deaf
    presenter = make_presenter(engine=an_engine)
    presenter.open_case(a_case_file)
    presenter.run(Step.LOAD)
    assert entered.wait(10)
    presenter.close()
    (thread,) = (t for t in threading.enumerate() if t.name == "hexafix-work")
    assert thread.daemon
    let_go.set()
    thread.join(10)


def test_an_edit_made_by_a_callback_reaches_all_callbacks_last(a_presenter):
    first, second = [], []

    def edits(snapshot):
        first.append(snapshot.case_id)
        if snapshot.case_id == "one":
            a_presenter.set_case_id("two")

    a_presenter.changed.connect(edits)
    a_presenter.changed.connect(lambda snapshot: second.append(snapshot.case_id))
    a_presenter.set_case_id("one")
    assert first == second == ["one", "two"]
    a_presenter.changed.disconnect(edits)
    a_presenter.set_case_id("three")
    assert (first[-1], second[-1]) == ("two", "three")


def test_the_series_of_a_folder_are_listed_with_their_uid(a_worker, tmp_path):
    assert a_worker.list_series(tmp_path)
    assert a_worker.wait(20)
    table = a_worker.snapshot.tables["series"]
    assert table.columns[-1] == "SeriesInstanceUID"
    assert table.rows[0][-1] == "1.2.3"
