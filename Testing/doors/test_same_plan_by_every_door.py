"""Presenter and module logic write the command line's export, byte for byte, from a DICOM folder.

The Qt window and the browser are compared with it where their windows are driven:
`qt/test_desktop_window.py` and `web/test_chromium_workflow.py`.
"""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule"


@pytest.fixture(scope="module")
def a_dicom_case(a_phantom, tmp_path_factory):
    """The phantom's case file beside its CT as a DICOM folder."""
    from hexafix.phantom import write_phantom

    folder = tmp_path_factory.mktemp("doors") / "phantom"
    write_phantom(a_phantom, folder)
    return folder / "case.json"


@pytest.fixture(scope="module")
def by_the_command_line(a_dicom_case, tmp_path_factory):
    return planned_by_command(a_dicom_case, tmp_path_factory.mktemp("command") / "prescription")


def planned_by_command(case, folder):
    subprocess.run(
        [sys.executable, "-m", "hexafix", "plan", case, "--out", folder],
        check=True,
        capture_output=True,
        env={**os.environ, "PYTHONPATH": str(PACKAGE), "OPENBLAS_NUM_THREADS": "1"},
    )
    return files_of(folder)


def files_of(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def by_the_presenter(case, folder):
    from hexafix.presenter import Presenter

    presenter = Presenter()
    assert presenter.open_case(case)
    export_by(presenter, folder)
    presenter.close()


def export_by(presenter, folder):
    presenter.run_all()
    presenter.wait(120)
    presenter.confirm_side(presenter.snapshot.document["limb"]["side"])
    presenter.export(folder)
    presenter.wait(60)


def scene_of(case, path):
    """A scene with the case and its CT, saved before anything was computed."""
    from hexafix.mrml import HeadlessMrmlApp, SceneLogic, SceneSync
    from hexafix.presenter import Presenter, Step

    presenter = Presenter()
    assert presenter.open_case(case)
    presenter.run(Step.LOAD)
    presenter.wait(60)
    with HeadlessMrmlApp() as app:
        sync = SceneSync(SceneLogic(app.scene), presenter)
        sync.update(presenter.snapshot)
        sync.save_bundle(path)
        sync.close()
    presenter.close()
    return path


def by_the_module_logic(case, folder):
    sys.path.insert(0, str(PACKAGE))
    from hexafix.mrml import HeadlessMrmlApp, SceneLogic
    from hexafix.pipeline import read_image

    from HexaFixModule import HexaFixModuleLogic

    with HeadlessMrmlApp() as app:
        node = SceneLogic(app.scene).add_volume(read_image(case.parent / "ct"))
        HexaFixModuleLogic(scene=app.scene).plan(node, case, folder)


@pytest.mark.parametrize("door", [by_the_presenter, by_the_module_logic])
def test_a_door_writes_the_files_of_the_command_line(
    door, a_dicom_case, by_the_command_line, tmp_path
):
    door(a_dicom_case, tmp_path / "prescription")
    written = files_of(tmp_path / "prescription")
    assert written.keys() == by_the_command_line.keys()
    assert written == by_the_command_line


def test_a_scene_and_a_case_saved_from_it_give_the_files_of_the_command_line(
    a_dicom_case, by_the_command_line, tmp_path
):
    from hexafix.mrml.scene_file import read_scene
    from hexafix.presenter import Presenter

    (tmp_path / "scenes").mkdir()
    presenter = Presenter(read_scene=read_scene)
    assert presenter.open_case(scene_of(a_dicom_case, tmp_path / "scenes" / "tibia.mrb"))
    assert presenter.wait(60)
    export_by(presenter, tmp_path / "one")
    assert files_of(tmp_path / "one") == by_the_command_line
    # the case file is another one: its CT is the scene's
    assert presenter.save_case(tmp_path / "case.json")
    export_by(presenter, tmp_path / "two")
    presenter.close()
    written = files_of(tmp_path / "two")
    assert written["plan.json"] != by_the_command_line["plan.json"]
    assert planned_by_command(tmp_path / "case.json", tmp_path / "three") == written
