"""Each edit greys exactly what depends on it, and nothing else (H40)."""

import json

import pytest
from hexafix.presenter import Step

LIVE = {"numbering", "readings", "correction"}
"""Steps that follow at once where what they need is fresh."""

AFTER_POSES = ["poses", "readings", "correction", "schedule", "export"]

EDITS = {
    "another image": (
        lambda p: p.edit("x", lambda d: d["image"].update(series_instance_uid="1.2.3")),
        ["load", "markers", "numbering", *AFTER_POSES],
    ),
    "another diameter": (
        lambda p: p.set_ball_diameter(9.5),
        ["markers", "numbering", *AFTER_POSES],
    ),
    "a ball added": (lambda p: p.add_marker([50.0, 0.0, 0.0]), AFTER_POSES),
    "a ball removed": (lambda p: p.remove_marker(3), AFTER_POSES),
    "a ball moved": (lambda p: p.move_marker(3, [50.0, 0.0, 0.0]), AFTER_POSES),
    "numbers swapped": (lambda p: p.swap_numbers(1, 2), AFTER_POSES),
    "another layout": (
        lambda p: p.set_markers(
            "proximal",
            [
                {"number": k, "radius_mm": 90.0, "sweep_deg": 100.0 * k, "height_mm": 20.0}
                for k in (1, 2, 3)
            ],
        ),
        AFTER_POSES,
    ),
    "another side": (lambda p: p.set_limb(side="right"), AFTER_POSES),
    "another bone": (lambda p: p.set_limb(bone="femur"), AFTER_POSES),
    "the relaxed layout accepted": (lambda p: p.accept_relaxed_layout(True), AFTER_POSES),
    "another reading": (lambda p: p.set_reading(2, 174.5), ["schedule", "export"]),
    "another correction": (
        lambda p: p.set_correction(
            {"kind": "target-pose", "position_mm": [0, 0, 170], "angles_deg": [0, 0, 0]}
        ),
        ["schedule", "export"],
    ),
    "another start": (
        lambda p: p.set_schedule({"start_date": "2027-01-01"}),
        ["schedule", "export"],
    ),
    "another name": (lambda p: p.set_case_id("other"), ["schedule", "export"]),
    "the front confirmed": (lambda p: p.confirm_ring_front(True), ["schedule", "export"]),
}


@pytest.mark.parametrize("name", EDITS)
def test_an_edit_greys_exactly_what_depends_on_it(name, a_planned, states):
    edit, stale = EDITS[name]
    assert edit(a_planned)
    found = states(a_planned)
    assert {step for step, state in found.items() if state == "stale"} == set(stale)
    assert {step for step, state in found.items() if state == "done"} == set(found) - set(stale)
    assert not a_planned.snapshot.can_export
    assert a_planned.prescription_files() is None


@pytest.mark.parametrize("name", EDITS)
def test_undo_makes_it_fresh_again_without_computing(name, a_planned, an_engine, states):
    before = a_planned.version.raw
    EDITS[name][0](a_planned)
    an_engine.calls.clear()
    assert a_planned.undo()
    assert a_planned.version.raw == before
    assert set(states(a_planned).values()) == {"done"}
    assert a_planned.snapshot.can_export
    assert an_engine.calls == []


@pytest.mark.parametrize("name", EDITS)
def test_running_again_computes_only_what_is_stale(name, a_planned, an_engine, states):
    EDITS[name][0](a_planned)
    an_engine.calls.clear()
    a_planned.run_all()
    assert set(states(a_planned).values()) == {"done"}
    first = {"load": "read_image", "markers": "search", "poses": "recognise", "schedule": "plan"}
    for step, call in first.items():
        assert (call in an_engine.calls) == (step in EDITS[name][1]), call


def test_readings_reach_the_poses_only_where_the_layouts_leave_a_choice(a_planned, states):
    rows = [dict(row) for row in a_planned.snapshot.document["markers"]["proximal"]]
    rows[0]["radius_mm"] = 99.0
    a_planned.set_markers("proximal", rows)
    a_planned.run_all()
    assert set(states(a_planned).values()) == {"done"}
    judged = a_planned.value(Step.NUMBERING)
    a_planned.set_reading(2, 174.5)
    assert a_planned.value(Step.NUMBERING) != judged
    assert states(a_planned)["poses"] == "stale"
    a_planned.set_readings(None)
    assert states(a_planned)["numbering"] == "refused"


def test_a_changed_fixator_file_greys_the_poses_and_blocks_the_export(
    a_planned, tmp_path, states, codes
):
    from hexafix.paths import resources

    definition = json.loads(
        (resources() / "Hardware" / "Frames" / "generic-6sps-160.json").read_text()
    )
    (tmp_path / "frame.json").write_text(json.dumps(definition))
    assert a_planned.set_fixator(str(tmp_path / "frame.json"))
    assert a_planned.snapshot.document["fixator"] == "frame.json"
    a_planned.run_all()
    assert a_planned.snapshot.can_export
    definition["strut"]["max_mm"] = 239.0
    (tmp_path / "frame.json").write_text(json.dumps(definition))
    assert not a_planned.export(tmp_path / "out")
    assert "export-blocked" in codes(a_planned)
    assert states(a_planned)["poses"] == "stale"
    assert not (tmp_path / "out").exists()


def test_an_image_changed_on_disk_blocks_the_export(a_planned, tmp_path, states, codes):
    (tmp_path / "ct.txt").write_text("another image")
    assert not a_planned.export(tmp_path / "out")
    assert codes(a_planned)[0] == "export-blocked"
    assert states(a_planned)["load"] == "stale"
    assert not (tmp_path / "out").exists()
    before = a_planned.value(Step.POSES).made
    a_planned.run_all()
    assert a_planned.value(Step.POSES).made != before


def test_an_image_touched_but_the_same_is_read_again_and_nothing_else(
    a_planned, tmp_path, an_engine, states
):
    import os

    os.utime(tmp_path / "ct.txt", (1, 1))
    an_engine.calls.clear()
    a_planned.run_all()
    assert an_engine.calls == ["read_image"]
    assert set(states(a_planned).values()) == {"done"}


def test_what_is_stale_keeps_its_value_and_its_table_is_grey(a_planned):
    value = a_planned.value(Step.SCHEDULE)
    a_planned.set_case_id("other")
    assert a_planned.value(Step.SCHEDULE) is value
    assert not a_planned.is_fresh(Step.SCHEDULE)
    tables = a_planned.snapshot.tables
    assert tables["strut_plan"].stale
    assert tables["strut_plan"].rows
    assert not tables["poses"].stale


def test_an_older_image_gives_way_with_everything_made_of_it(a_planned, tmp_path, states):
    for name in ("two", "three"):
        (tmp_path / name).write_text(name)
        a_planned.load_image(tmp_path / name)
        a_planned.run_all()
    for _ in range(2):
        a_planned.undo()
    assert states(a_planned)["load"] == "stale"
    assert not a_planned.is_fresh(Step.POSES)
    assert not a_planned.snapshot.can_export


def test_pictures_show_the_layout_as_it_is_now(a_planned, an_engine, monkeypatch):
    before = a_planned.pictures()
    assert before["strut_curves"] == a_planned.value(Step.SCHEDULE).made
    monkeypatch.setattr(
        an_engine, "layout_pictures", lambda p, _: {"layout_proximal": str(p.sites[0].radius_mm)}
    )
    rows = [dict(row) for row in a_planned.snapshot.document["markers"]["proximal"]]
    for radius in (90.0, 95.0):
        rows[0]["radius_mm"] = radius
        a_planned.set_markers("proximal", rows)
        shown = a_planned.pictures()
        assert shown == {**before, "layout_proximal": str(radius)}
