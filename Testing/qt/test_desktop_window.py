"""The stand-alone window on the phantom: from the case to the export, by its widgets."""

import gc
import json
import threading
import weakref

import numpy as np
import pytest
from hexafix.presenter import Step, StepState

DONE = StepState.DONE


def states(window):
    return {view.step: view.state for view in window.presenter.snapshot.steps}


def click(window, name):
    window._find(name).click()


def choose(window, name, text):
    box = window._find(name)
    index = box.findText(text)
    assert index >= 0, f"{name} has no {text}"
    box.setCurrentIndex(index)
    box.activated.emit(index)


def files(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_the_case_runs_to_the_prescription(a_planned_window):
    assert set(states(a_planned_window).values()) == {DONE}
    assert not a_planned_window.presenter.snapshot.busy


def test_the_views_show_frame_bone_and_slices(a_planned_window, settled, pixels):
    window = a_planned_window
    window.presenter.go_to(Step.POSES)
    settled(window)
    assert {"bone-proximal", "bone-distal", "ring-proximal", "strut-6", "ball-1"} <= (
        window.stage.view3d.names
    )
    for widget in (window.stage.view3d.plotter, *(p.interactor for p in window.stage.slices)):
        seen = pixels(widget)
        assert seen.std() > 10, f"{widget.accessibleName()} is blank"
        assert len(np.unique(seen.reshape(-1, 3), axis=0)) > 100


def test_a_slice_shows_the_ball_where_the_truth_has_it(a_planned_window, a_phantom, pixels):
    window = a_planned_window
    for ball in a_phantom.truth["balls"][:3]:
        center = tuple(float(x) for x in ball["center_mm"])
        for pane in window.stage.slices:
            pane.go_to(center)
            seen = pixels(pane.interactor)
            x, y = on_screen(pane, center)
            # beside the middle, which the cross marks
            bright = seen[seen.shape[0] - 1 - y + 3, x + 3].min()
            assert bright > 150, f"no ball at its place in the {pane.view.name} slice"


def on_screen(pane, point):
    from vtkmodules.vtkRenderingCore import vtkCoordinate

    place = vtkCoordinate()
    place.SetCoordinateSystemToWorld()
    place.SetValue(*point)
    return tuple(place.GetComputedDisplayValue(pane.renderer))


def test_a_click_in_a_slice_gives_the_point_of_the_patient(a_planned_window, a_phantom):
    window = a_planned_window
    center = tuple(float(x) for x in a_phantom.truth["balls"][0]["center_mm"])
    for pane in window.stage.slices:
        pane.go_to(center)
        x, y = on_screen(pane, center)
        found = pane.point_at(x, y)
        pixel_mm = 2 * pane.renderer.GetActiveCamera().GetParallelScale() / pane.interactor.height()
        slice_mm = pane.places[1] - pane.places[0]
        assert np.abs(np.subtract(found, center)).max() <= max(pixel_mm, slice_mm)


def test_two_numbers_swapped_are_refused_and_undo_makes_everything_fresh(a_planned_window, settled):
    window = a_planned_window
    before = window.presenter.value(Step.EXPORT)
    window.presenter.go_to(Step.NUMBERING)
    choose(window, "swapFirstComboBox", "1")
    choose(window, "swapSecondComboBox", "2")
    click(window, "swapNumbersButton")
    settled(window)
    assert states(window)[Step.NUMBERING] == StepState.REFUSED
    assert states(window)[Step.SCHEDULE] == StepState.STALE
    assert not window.presenter.snapshot.can_export
    shown = window._find("bannerBrowser")
    assert shown.isVisibleTo(window.root)
    assert "Next step" in shown.toPlainText()
    assert "H19" in shown.toPlainText()
    window.actions["undo"].trigger()
    settled(window)
    assert set(states(window).values()) == {DONE}
    assert window.presenter.value(Step.EXPORT) is before


def test_the_export_equals_the_command_lines_byte_for_byte(
    a_planned_window, a_case_on_disk, settled, tmp_path, monkeypatch
):
    from hexafix.case import load_case
    from hexafix.pipeline import plan_and_export

    window = a_planned_window
    window.presenter.go_to(Step.EXPORT)
    side = json.loads(a_case_on_disk.read_text())["limb"]["side"]
    assert not window._find("exportButton").isEnabled()
    choose(window, "confirmSideComboBox", side)
    folder = tmp_path / "from-window"
    monkeypatch.setattr(window.widgets, "ask_new_file", lambda *_: str(folder))
    click(window, "exportButton")
    settled(window)
    plan_and_export(load_case(a_case_on_disk), tmp_path / "from-command-line")
    assert files(folder) == files(tmp_path / "from-command-line")
    assert str(folder) in window._find("exportStateLabel").text()


def test_a_wrong_side_the_second_time_blocks_the_export(a_planned_window, a_case_on_disk):
    window = a_planned_window
    window.presenter.go_to(Step.EXPORT)
    side = json.loads(a_case_on_disk.read_text())["limb"]["side"]
    choose(window, "confirmSideComboBox", {"left": "right", "right": "left"}[side])
    assert not window._find("exportButton").isEnabled()
    assert "H37" in window._find("bannerBrowser").toPlainText()
    assert window._find("confirmSideComboBox").currentText() == "choose"


def test_the_playback_moves_the_frame_to_its_last_day(a_planned_window, settled):
    window = a_planned_window
    window.presenter.go_to(Step.SCHEDULE)
    slider = window._find("playbackSlider")
    rows = window.presenter.playback().rows
    assert slider.maximum() == len(rows) - 1
    slider.setValue(slider.maximum())
    settled(window)
    assert rows[-1].date.isoformat() in window._find("playbackLabel").text()
    assert f"day {rows[-1].day}" in window.stage.view3d.title.text()
    moving = window.presenter.playback().moving
    shown = np.array(window.stage.view3d._actors[f"bone-{moving}"].user_matrix)
    np.testing.assert_allclose(shown, rows[-1].fragment_lps, atol=1e-12)
    slider.setValue(0)


def test_a_pixel_on_a_ball_of_the_3d_view_names_it_and_one_beside_it_names_none(
    a_planned_window, a_phantom, settled, pixels
):
    window = a_planned_window
    window.presenter.go_to(Step.POSES)
    settled(window)
    view = window.stage.view3d
    view.look((0, -1, 0), (0, 0, 1))
    pixels(view.plotter)
    for ball in a_phantom.truth["balls"]:
        x, y = on_screen(view.plotter, ball["center_mm"])
        assert view.ball_at(x, y) == f"ball-{ball['number']}"
    assert view.ball_at(2, 2) is None


def test_a_ball_clicked_in_the_3d_view_is_chosen_in_the_table(a_planned_window, settled):
    window = a_planned_window
    window.presenter.go_to(Step.MARKERS)
    window.stage.view3d._ball_clicked("ball-3")
    settled(window)
    row = window.widgets.get("ballsTable", "index")
    assert window._find("ballsTable").item(row, 1).text() == "3"
    center = window.presenter.value(Step.MARKERS).balls[row].center_mm
    for pane in window.stage.slices:
        assert abs(pane.place_mm() - center[pane.view.axis]) <= pane.places[1] - pane.places[0]


def test_the_dragged_bone_becomes_the_cases_fragment_motion(a_planned_window, settled):
    window = a_planned_window
    window.presenter.go_to(Step.CORRECTION)
    window._find("dragBoneButton").click()
    settled(window)
    assert window.stage.view3d.handles is not None
    before = window.presenter.snapshot.document["correction"]["matrix_lps"]
    moved = [list(row) for row in before]
    moved[2][3] += 1.5
    window.stage.view3d._dragged(moved)
    settled(window)
    held = window.presenter.snapshot.document["correction"]
    assert held["kind"] == "fragment-motion"
    np.testing.assert_allclose(held["matrix_lps"], moved, atol=1e-12)
    assert states(window)[Step.SCHEDULE] == StepState.STALE
    np.testing.assert_allclose(
        np.array(window.stage.view3d._actors["target"].user_matrix), moved, atol=1e-9
    )
    window._find("dragBoneButton").click()
    window.presenter.undo()
    settled(window)
    assert window.stage.view3d.handles is None
    assert set(states(window).values()) == {DONE}


def test_closing_during_a_run_ends_it_and_leaves_no_thread(qapp, a_window, a_case_on_disk):
    window, before = a_window, set(threading.enumerate())
    window.open_case(a_case_on_disk)
    click(window, "runAllButton")
    assert window.presenter.snapshot.busy
    assert set(threading.enumerate()) > before
    window.main.close()
    assert window.closed
    qapp.processEvents()
    assert set(threading.enumerate()) <= before


def test_a_closed_window_is_freed(qapp, a_case_on_disk, tmp_path):
    from hexafix.qt import Window
    from hexafix.qt.kit import kit

    q = kit()
    window = Window(settings=q.QSettings(str(tmp_path / "s.ini"), q.QSettings.IniFormat))
    window.show()
    qapp.processEvents()
    held = [weakref.ref(pane.renderer) for pane in window.stage.slices]
    held.append(weakref.ref(window.stage.view3d.plotter.renderer))
    window.main.close()
    assert window.closed
    window.main.deleteLater()
    del window
    qapp.sendPostedEvents(None, q.QEvent.DeferredDelete)
    qapp.processEvents()
    gc.collect()
    assert [ref() for ref in held] == [None] * 4


def test_unsaved_changes_ask_before_the_window_closes(a_window, an_own_case, monkeypatch):
    window = a_window
    window.open_case(an_own_case)
    window.presenter.set_case_id("changed")
    asked = []

    def answer(title, question, answers):
        asked.append(answers)
        return reply

    monkeypatch.setattr(window.widgets, "ask", answer)
    reply = 2
    window.main.close()
    assert asked
    assert not window.closed
    reply = 0
    window.main.close()
    assert window.closed
    assert json.loads(an_own_case.read_text())["case_id"] == "changed"


def test_the_shortcuts_save_and_undo_what_is_being_typed(qtbot, a_window, an_own_case):
    window = a_window
    window.open_case(an_own_case)
    window.main.activateWindow()
    field = window._find("caseIdLineEdit")
    field.setFocus()
    field.selectAll()
    qtbot.keyClicks(field, "typed-1")
    save = window.actions["save"]
    assert save.shortcut().toString() == "Ctrl+S"
    save.trigger()
    assert json.loads(an_own_case.read_text())["case_id"] == "typed-1"
    assert window.actions["undo"].shortcut().toString() == "Ctrl+Z"
    window.actions["undo"].trigger()
    assert window._find("caseIdLineEdit").text() != "typed-1"
    assert window.actions["redo"].shortcut().toString() == "Ctrl+Shift+Z"
    window.actions["redo"].trigger()
    assert window._find("caseIdLineEdit").text() == "typed-1"


def test_the_case_that_was_open_last_is_offered_again(a_window, an_own_case):
    window = a_window
    assert not window.actions["recent"].isEnabled()
    window.open_case(an_own_case)
    assert window.recent() == str(an_own_case)
    assert window.actions["recent"].isEnabled()


def test_a_scene_is_opened_by_the_menu_with_its_case_and_ct(
    a_window, a_phantom, settled, tmp_path, monkeypatch
):
    from hexafix.mrml import scene_file
    from hexafix.presenter.scenes import SceneContent

    path = tmp_path / "tibia.mrb"
    path.write_bytes(b"read by a stand-in; Testing/mrml reads real ones")
    content = SceneContent(a_phantom.case, "a" * 64, a_phantom.volume, computed_to="load")
    monkeypatch.setattr(scene_file, "read_scene", lambda path, *, progress: content)
    asked = []
    monkeypatch.setattr(a_window.widgets, "ask_file", lambda *words: asked.append(words) or path)
    a_window.actions["open"].trigger()
    settled(a_window)
    assert "*.mrb" in asked[0][1]
    assert states(a_window)[Step.LOAD] == DONE
    assert a_window.presenter.snapshot.case_id == a_phantom.case["case_id"]
    assert a_window.presenter.value(Step.LOAD) is a_phantom.volume
    assert not a_window.presenter.snapshot.edited


def test_the_wheel_changes_no_choice_that_has_no_focus(a_window):
    from hexafix.qt.kit import kit

    q = kit()
    box = a_window._find("correctionKindComboBox")
    box.clearFocus()
    event = q.QWheelEvent(
        q.QPointF(3, 3), q.QPointF(3, 3), q.QPoint(0, -120), q.QPoint(0, -120),
        q.Qt.NoButton, q.Qt.NoModifier, q.Qt.NoScrollPhase, False,
    )  # fmt: skip
    before = box.currentIndex()
    q.QApplication.sendEvent(box, event)
    assert box.currentIndex() == before


@pytest.mark.parametrize("step", list(Step))
def test_every_page_opens_by_the_list_of_steps(a_window, step):
    place = list(Step).index(step)
    a_window._find("stepList").setCurrentRow(place)
    assert a_window.presenter.snapshot.current == step
    assert a_window._find("stepStack").currentIndex() == place
