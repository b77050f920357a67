"""The module in a stand-in for desktop Slicer: `desktop_slicer.py` says what stands for what."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from hexafix.errors import MissingLibrary

HERE = Path(__file__).resolve().parent


def in_slicer(top, script, *arguments):
    run = subprocess.run(
        [sys.executable, str(HERE / script), *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
        env=os.environ
        | {
            "PYTHONPATH": os.pathsep.join([str(top / "HexaFixModule"), str(HERE)]),
            "OPENBLAS_NUM_THREADS": "1",
        },
    )
    assert run.returncode == 0, run.stderr[-4000:]
    return json.loads(run.stdout.splitlines()[-1]), run.stderr


@pytest.fixture(scope="module")
def a_walk(a_case_on_disk, top, tmp_path_factory):
    """From opening the case to the export; what was seen, and the export's folder."""
    out = tmp_path_factory.mktemp("slicer") / "export"
    seen, errors = in_slicer(top, "walk_through_slicer.py", a_case_on_disk, out)
    assert "Traceback" not in errors
    return seen, out


def test_slicer_shows_title_icon_and_that_it_is_no_medical_device(a_walk):
    described = a_walk[0]["described"]
    assert described["title"] == "HexaFix"
    assert described["icon"] is True
    assert described["hidden"] is False
    assert "not a medical device" in described["help"]


def test_logic_and_test_stand_on_slicers_base_classes(a_walk):
    assert a_walk[0]["logic_has_slicers_scene"] is True
    assert a_walk[0]["test_is_a_unittest"] == "runTest"


def test_the_panel_opens_and_an_edit_and_undo_go_through_its_widgets(a_walk):
    seen = a_walk[0]
    assert seen["opened"]
    assert seen["first_id"] == seen["undone_id"] == "phantom-11"
    assert seen["edited_id"] == "another-name"
    assert "phantom-11" in seen["case_label"]


def test_the_case_of_an_opened_scene_is_taken_over_but_for_its_image(a_walk):
    """What the scene says of its image leads nowhere (H51); a case of one's own stays."""
    seen = a_walk[0]
    assert seen["scene_case"] == {"case_id": "of-the-scene", "image": None}
    assert seen["scene_balls_diameter"] == 10.0
    assert seen["own_case"] == "of-the-panel"


def test_the_chain_runs_off_the_interface_and_comes_back_to_its_thread(a_walk):
    seen = a_walk[0]
    assert seen["busy_at_once"]
    assert seen["ticks"] > 20, "the event loop went on"
    assert seen["threads"], "every change came on Slicer's thread"
    assert seen["timer_stops"]
    assert set(seen["states"].values()) == {"done"}


def test_the_scene_holds_volume_balls_frame_bone_and_table(a_walk):
    roles = set(a_walk[0]["roles"])
    assert {"volume", "markups/proximal", "markups/distal", "table/struts", "parameters"} <= roles
    assert {f"model/strut/{strut}" for strut in range(1, 7)} <= roles
    assert {"model/bone/proximal", "model/bone/distal", "transform/target/fragment"} <= roles


def test_every_ball_stands_in_the_table(a_walk):
    assert a_walk[0]["balls_rows"] == a_walk[0]["balls"] >= 7


def test_a_click_on_a_ball_chooses_it_and_a_drag_does_not(a_walk):
    seen = a_walk[0]
    assert seen["row_after_drag"] == -1
    assert seen["row_after_click"] == 2
    for shown, wanted in zip(seen["clicked_place"], seen["ball_place"], strict=True):
        assert float(shown) == pytest.approx(wanted, abs=0.51), "half a pixel, LPS"


def test_a_view_of_another_layout_is_watched_too_and_none_twice(a_walk):
    assert a_walk[0]["clicked_in_both"] == [2, 2]


def test_where_slicer_has_no_window_there_is_nothing_to_watch():
    from hexafix.slicer_panel.clicks import SliceClicks

    clicks = SliceClicks(None, print, print)
    clicks.start()
    clicks.stop()
    assert clicks._observers == []


def test_choosing_a_ball_brings_all_slices_to_it(a_walk):
    assert max(a_walk[0]["slice_misses"]) < 1e-3


def test_the_dragged_bone_becomes_the_correction_when_it_is_let_go(a_walk):
    """2 mm to the right in RAS are −2 mm along L."""
    seen = a_walk[0]
    assert seen["edited_while_dragging"] is False
    assert seen["moved_lps_mm"] == pytest.approx([-2.0, 0.0, 0.0], abs=1e-6)
    assert seen["fresh_after_drag"] is False
    assert seen["fresh_after_undo"] is True


def test_playback_moves_the_ring(a_walk):
    assert a_walk[0]["ring_moves"] > 1.0


def test_after_leaving_the_module_clicks_are_not_ours(a_walk):
    assert a_walk[0]["row_after_exit"] == -1
    assert a_walk[0]["row_after_return"] == 2


def test_a_closed_scene_comes_back_with_the_module(a_walk):
    seen = a_walk[0]
    assert seen["roles_after_close"] == []
    assert seen["roles_after_return"] == seen["roles"]


def test_the_page_of_the_prescription_is_shown_whole(a_walk):
    """A PNG cut off at its first zero, as PythonQt's QByteArray would do, shows nothing."""
    width, height = a_walk[0]["page_pixels"]
    assert width >= 100
    assert height == pytest.approx(width * 297 / 210, abs=2)


def test_the_export_is_the_command_lines_byte_for_byte(a_walk, a_case_on_disk, tmp_path):
    from hexafix.case import load_case
    from hexafix.pipeline import plan_and_export

    seen, out = a_walk
    assert seen["blocked"] == ""
    assert seen["export_banners"] == []
    plan_and_export(load_case(a_case_on_disk), tmp_path / "plain")
    names = {path.name for path in out.iterdir()}
    assert names == {path.name for path in (tmp_path / "plain").iterdir()}
    for name in names:
        assert (out / name).read_bytes() == (tmp_path / "plain" / name).read_bytes(), name


def test_nothing_was_told_in_a_message_box_and_all_is_closed(a_walk):
    assert a_walk[0]["messages"] == []
    assert a_walk[0]["closed"] is True


def test_missing_packages_are_asked_for_only_when_the_user_wants_it(top):
    seen, _ = in_slicer(top, "install_in_slicer.py")
    assert seen["asked_before"] == []
    assert seen["opened_before"] is False
    assert seen["loaded_before"] == []
    assert len(seen["buttons"]) == 1
    assert "pydicom>=" in seen["labels"][0]
    needed, requester = seen["asked"][0]
    assert requester == "HexaFix"
    assert any(need.startswith("pydicom>=") for need in needed)
    assert not any(need.startswith("numpy") for need in needed)
    assert seen["opened_declined"] is False
    assert "pydantic" in seen["declined"][0]
    assert len(seen["asked"]) == 2
    assert seen["opened"] is True
    assert seen["messages"] == seen["declined"], "nothing was said after the consent"


def test_what_is_asked_for_is_what_pyproject_needs(top):
    from hexafix.slicer_panel import requirements

    project = tomllib.loads((top / "pyproject.toml").read_text())["project"]
    assert list(requirements.stated()) == project["dependencies"]
    assert not any("==" in need for need in requirements.stated())


def test_every_widget_of_the_binder_stands_in_the_ui_and_is_one_of_qts_own(top):
    """A widget class of CTK or MRML would not exist in the stand-alone window."""
    from xml.etree import ElementTree

    from hexafix.panel import BINDINGS
    from PySide6 import QtWidgets

    tree = ElementTree.parse(top / "Resources" / "UI" / "HexaFixModule.ui")
    classes = {widget.get("name"): widget.get("class") for widget in tree.iter("widget")}
    assert {binding.widget for binding in BINDINGS} <= set(classes)
    assert len(BINDINGS) > 80
    assert all(hasattr(QtWidgets, name) for name in classes.values())
    assert list(tree.iter("customwidget")) == []


@pytest.fixture
def an_older_slicer(monkeypatch):
    """A Slicer without `slicer.packaging`, with the answer and the list that pip got."""
    import types

    import slicer

    state = types.SimpleNamespace(answer=True, asked=[], got=[], present=False)

    def confirm(text, title):
        state.asked.append(text)
        return state.answer

    util = types.SimpleNamespace(confirmOkCancelDisplay=confirm, pip_install=state.got.append)
    monkeypatch.setattr(slicer, "util", util, raising=False)
    monkeypatch.delattr(slicer, "packaging", raising=False)
    return state


def test_an_older_slicer_asks_by_its_own_question(an_older_slicer, monkeypatch):
    from hexafix.slicer_panel import requirements

    monkeypatch.setattr(requirements, "_is_installed", lambda need: bool(an_older_slicer.got))
    requirements.install()
    assert an_older_slicer.got == [list(requirements.stated())]
    assert "changes Slicer's Python environment" in an_older_slicer.asked[0]


def test_who_declines_gets_the_list_and_nothing_is_installed(an_older_slicer, monkeypatch):
    from hexafix.slicer_panel import requirements

    an_older_slicer.answer = False
    monkeypatch.setattr(requirements, "_is_installed", lambda need: not need.startswith("typst"))
    with pytest.raises(MissingLibrary, match="typst"):
        requirements.install()
    assert an_older_slicer.got == []


def test_an_installation_that_did_not_help_is_told(an_older_slicer, monkeypatch):
    from hexafix.slicer_panel import requirements

    monkeypatch.setattr(requirements, "_is_installed", lambda need: False)
    with pytest.raises(MissingLibrary, match="pydantic"):
        requirements.install()


def test_here_nothing_is_missing(monkeypatch):
    import slicer
    from hexafix.slicer_panel import requirements

    monkeypatch.delattr(slicer, "packaging", raising=False)
    assert requirements.missing() == ()


def test_the_interfaces_thread_runs_what_others_post_in_order(top, run_python):
    """Without Qt: a timer that is ticked by hand."""
    code = (
        "import threading, types\n"
        "from hexafix.slicer_panel.ui_thread import UiThread\n"
        "class Timer:\n"
        "    running = False\n"
        "    def setInterval(self, ms): assert ms == 0\n"
        "    def connect(self, signal, slot): assert signal == 'timeout()'; self.slot = slot\n"
        "    def start(self): self.running = True\n"
        "    def stop(self): self.running = False\n"
        "timer, seen = Timer(), []\n"
        "ui = UiThread(timer)\n"
        "ui.post(lambda: seen.append('own'))\n"
        "ui.set_busy(True)\n"
        "def work():\n"
        "    for k in range(3): ui.post(lambda k=k: seen.append((k, threading.get_ident())))\n"
        "worker = threading.Thread(target=work); worker.start(); worker.join()\n"
        "assert seen == ['own'] and timer.running\n"
        "timer.slot()\n"
        "assert seen[1:] == [(k, threading.get_ident()) for k in range(3)] and timer.running\n"
        "ui.set_busy(False); timer.slot()\n"
        "assert not timer.running\n"
        "print('good')\n"
    )
    run = run_python(code)
    assert run.stdout == "good\n", run.stderr
