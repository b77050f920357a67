"""Saving the scene: where it goes, what is asked before, what is told after."""

import asyncio
import threading
from types import SimpleNamespace

import pytest
from hexafix.errors import InputError, Refused
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.controls import NoViews
from hexafix.web.panel.scene import SceneFile, scene_path
from hexafix.web.state import PanelState


class Views(NoViews):
    """Views that write what they are told to, or raise."""

    fault: Exception | None = None
    late: Exception | None = None
    thread = None

    def take_scene(self):
        if self.fault is not None:
            raise self.fault
        return self

    def write(self, path, *, progress):
        self.thread = threading.current_thread()
        for part in range(101):
            progress("pack the CT", part / 100)
        if self.late is not None:
            raise self.late
        path.write_bytes(b"scene")


@pytest.fixture
def views():
    return Views()


@pytest.fixture
def scene(views, request):
    from trame.app import get_server

    server = get_server(f"scene-{request.node.name}", client_type="vue3")
    data, name = typed_state(server, PanelState)
    written = []
    presenter = SimpleNamespace(
        snapshot=SimpleNamespace(banners=(), busy=False),
        value={"load": "the CT"}.get,
        scene_written=lambda *what: written.append(what),
        written=written,
    )
    return SceneFile(PanelContext(server, presenter, views, data=data, name=name), None)


def take(scene, path, *, answer=None):
    """Let the chooser hand over a path, and wait until all is told."""

    async def told():
        scene.take(path)
        asked = scene._data.asking
        if asked and answer is not None:
            answer()
        if scene.task is not None:
            await scene.task
        return asked

    return asyncio.run(told())


def test_a_scene_goes_into_a_folder_or_gets_its_ending(tmp_path):
    assert scene_path(tmp_path) == tmp_path / "scene.mrb"
    assert scene_path(tmp_path / "tibia") == tmp_path / "tibia.mrb"
    assert scene_path(tmp_path / "tibia.json") == tmp_path / "tibia.json.mrb"
    assert scene_path(tmp_path / "Tibia.MRB") == tmp_path / "Tibia.MRB"


def test_a_saved_scene_is_told_with_its_place(scene, tmp_path):
    assert not take(scene, tmp_path / "tibia")
    assert (tmp_path / "tibia.mrb").read_bytes() == b"scene"
    assert scene._data.saved == str(tmp_path / "tibia.mrb")
    assert not scene._data.saving
    assert scene._context.presenter.written == [(tmp_path / "tibia.mrb", "the CT")]


def test_a_file_is_replaced_only_when_the_user_says_so(scene, tmp_path):
    path = tmp_path / "tibia.mrb"
    path.write_bytes(b"older")
    assert take(scene, path, answer=scene._keep)
    assert (path.read_bytes(), scene._data.saved) == (b"older", "")
    assert take(scene, path, answer=scene._replace)
    assert (path.read_bytes(), scene._data.asking) == (b"scene", False)


@pytest.mark.parametrize("kind", [InputError, Refused])
def test_what_hinders_saving_is_told_like_every_other_error(scene, views, tmp_path, kind):
    views.fault = kind.of("x-code", "it is so", hazard="H46", next_step="do this")
    take(scene, tmp_path / "tibia.mrb")
    notice = scene._context.data.notice
    assert (notice["code"], notice["hazard"], notice["next_step"]) == ("x-code", "H46", "do this")
    assert (scene._data.saved, scene._data.saving) == ("", False)


def test_no_scene_is_saved_while_a_field_shows_what_the_case_does_not_hold(scene, tmp_path):
    scene._context.data.field_errors = {"reading-2": "not taken"}
    take(scene, tmp_path / "tibia.mrb")
    assert scene._context.data.notice["code"] == "field-not-taken"
    assert not (tmp_path / "tibia.mrb").exists()


def test_the_file_is_written_off_the_pages_thread_and_progress_is_told(scene, views, tmp_path):
    told = []
    show = scene._show
    scene._show = lambda percent: (told.append(percent), show(percent))
    take(scene, tmp_path / "tibia.mrb")
    assert views.thread is not threading.current_thread()
    assert told
    assert told == sorted(told)
    assert max(told) <= 100


@pytest.mark.parametrize("kind", [InputError, Refused])
def test_what_hinders_the_writing_is_told_too(scene, views, tmp_path, kind):
    views.late = kind.of("bundle-not-written", "the disk is full", hazard="H46")
    take(scene, tmp_path / "tibia.mrb")
    assert scene._context.data.notice["code"] == "bundle-not-written"
    assert (scene._data.saved, scene._data.saving) == ("", False)


def test_a_workstation_that_ends_stops_the_writing(scene, views, tmp_path):
    scene._ended.set()
    take(scene, tmp_path / "tibia.mrb")
    assert not (tmp_path / "tibia.mrb").exists()
    assert (scene._data.saved, scene._data.saving) == ("", False)
