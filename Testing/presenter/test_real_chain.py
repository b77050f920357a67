"""The presenter over the real pipeline, on a phantom written once."""

import json
import shutil
from pathlib import Path

import pytest
from hexafix.case import case_from_document, load_case
from hexafix.pipeline import plan_and_export
from hexafix.presenter import Presenter, Step


@pytest.fixture(scope="module")
def a_phantom_folder(a_case_on_disk):
    """The session's phantom as a user has it: an NRRD and a case file."""
    return a_case_on_disk.parent


@pytest.fixture(scope="module")
def a_planned_case(a_phantom_folder):
    """A presenter with the phantom's case planned; tests undo what they edit."""
    presenter = Presenter()
    assert presenter.open_case(a_phantom_folder)
    assert presenter.run_all()
    assert presenter.wait(120)
    presenter.confirm_side("left")
    assert presenter.snapshot.can_export, presenter.snapshot.export_blocked_by
    yield presenter
    presenter.close()


@pytest.fixture
def a_plan(a_planned_case):
    yield a_planned_case
    while a_planned_case.snapshot.can_undo:
        a_planned_case.undo()
    assert a_planned_case.snapshot.can_export


def contents(folder):
    return {path.name: path.read_bytes() for path in Path(folder).iterdir()}


def test_the_export_equals_the_command_lines_byte_for_byte(a_plan, a_phantom_folder, tmp_path):
    assert a_plan.export(tmp_path / "here")
    assert a_plan.wait(60)
    assert a_plan.snapshot.export_folder == str(tmp_path / "here")
    plan_and_export(load_case(a_phantom_folder / "case.json"), tmp_path / "there")
    assert contents(tmp_path / "here") == contents(tmp_path / "there")
    assert set(a_plan.prescription_files()) == set(contents(tmp_path / "here")) - {"manifest.json"}


def test_an_edited_and_saved_case_exports_as_the_command_line_plans_it(
    a_phantom, a_phantom_folder, tmp_path
):
    shutil.copytree(a_phantom_folder, tmp_path / "case")
    presenter = Presenter()
    try:
        presenter.open_case(tmp_path / "case")
        presenter.run(Step.NUMBERING)
        assert presenter.wait(60)
        center = presenter.value(Step.MARKERS).balls[2].center_mm
        assert presenter.move_marker(2, [center[0] + 0.8, center[1] - 0.5, center[2]])
        presenter.set_schedule({**presenter.snapshot.document["schedule"], "strut_step_mm": 1.0})
        presenter.save_case(tmp_path / "case" / "edited.json")
        presenter.run_all()
        assert presenter.wait(120)
        presenter.confirm_side("left")
        assert presenter.export(tmp_path / "here"), presenter.snapshot.banners
        assert presenter.wait(60)
    finally:
        presenter.close()
    raw = (tmp_path / "case" / "edited.json").read_bytes()
    case = case_from_document(raw, folder=tmp_path / "case")
    assert case.marker_edits
    plan_and_export(case, tmp_path / "there", volume=presenter.value(Step.LOAD))
    assert contents(tmp_path / "here") == contents(tmp_path / "there")
    assert json.loads(contents(tmp_path / "here")["plan.json"])["case"]["schema_version"] == 2


def test_two_numbers_swapped_are_refused_at_once_and_undo_makes_all_fresh(a_plan):
    assert a_plan.swap_numbers(1, 2)
    view = a_plan.snapshot.view(Step.NUMBERING)
    assert view.state == "refused"
    (banner,) = (b for b in a_plan.snapshot.banners if b.kind == "refused")
    assert (banner.code, banner.hazard) == ("numbering-does-not-fit", "H19")
    assert banner.next_step
    assert not a_plan.snapshot.can_export
    a_plan.undo()
    assert a_plan.snapshot.can_export


def test_a_mistyped_reading_is_refused_at_once(a_plan):
    a_plan.set_reading(1, 190.0)
    assert a_plan.snapshot.view(Step.READINGS).state == "refused"
    assert "strut-reading" in [b.code for b in a_plan.snapshot.banners]
    table = a_plan.snapshot.tables["struts"]
    assert table.alerts[0] == "disagrees with the CT"
    assert table.rows[0][1] == "190.000"


def test_a_target_beyond_the_struts_is_told_while_it_is_drawn(a_plan):
    far = {"kind": "target-pose", "position_mm": [0, 0, 400], "angles_deg": [0, 0, 0]}
    a_plan.set_correction(far)
    assert a_plan.snapshot.view(Step.CORRECTION).state == "refused"
    assert "strut-out-of-range" in [b.code for b in a_plan.snapshot.banners]
    assert "beyond the strut's stroke" in a_plan.snapshot.tables["target"].alerts


def test_a_ball_that_is_not_there_cannot_be_added(a_plan):
    edge = a_plan.value(Step.LOAD).lps_from_ijk([1.0, 1.0, 1.0])
    a_plan.add_marker(list(edge))
    assert a_plan.snapshot.view(Step.MARKERS).state == "refused"
    assert "added-ball-outside" in [b.code for b in a_plan.snapshot.banners]


def test_every_table_is_ready_to_be_shown(a_plan):
    tables = a_plan.snapshot.tables
    assert [name for name, table in tables.items() if not table.rows] == ["series"]
    for name, table in tables.items():
        assert len(table.alerts) == len(table.rows), name
        for row in table.rows:
            assert len(row) == len(table.columns), name
            assert all(isinstance(cell, str) for cell in row)
        assert not table.stale
    assert tables["strut_plan"].rows[0][3:] == (
        "180.0",
        "175.0",
        "167.0",
        "168.0",
        "157.0",
        "181.5",
    )
    assert [row[1] for row in tables["balls"].rows].count("-") == 0
    assert "G9" in {row[0] for row in tables["gates"].rows}


def test_playback_and_pictures_are_of_the_plan_shown(a_plan):
    playback = a_plan.playback()
    assert len(playback.rows) == len(a_plan.snapshot.tables["strut_plan"].rows)
    assert a_plan.playback() is playback
    assert {"layout_proximal", "layout_distal", "strut_curves", "strut_map"} <= set(
        a_plan.pictures()
    )


def test_no_text_of_the_workstation_names_the_place_of_the_image(a_plan, a_phantom_folder):
    snapshot = a_plan.snapshot
    shown = repr((snapshot.steps, snapshot.banners, snapshot.tables, snapshot.confirmed))
    assert str(a_phantom_folder) not in shown
