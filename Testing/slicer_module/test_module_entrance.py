"""HexaFixModule.py imports anywhere, holds no work, and its logic plans on a real MRML scene."""

import ast
import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hexafix.errors import HexaFixError, Refused

STANDARD = set(sys.stdlib_module_names)


@pytest.fixture(scope="module")
def entrance(top):
    return top / "HexaFixModule" / "HexaFixModule.py"


@pytest.fixture(scope="module")
def a_scene():
    from hexafix.mrml import HeadlessMrmlApp

    with HeadlessMrmlApp() as app:
        yield app.scene


@pytest.fixture(scope="module")
def a_case_file(a_phantom, tmp_path_factory):
    """The same bytes as the case of the fixture `an_export`."""
    file = tmp_path_factory.mktemp("entrance") / "case.json"
    file.write_text(json.dumps(a_phantom.case))
    return file


@pytest.fixture(scope="module")
def a_planned_scene(a_scene, a_phantom, a_case_file, top):
    """Scene, volume node, plan document and export of the script that the document prints."""
    from hexafix.mrml import SceneLogic

    page = (top / "Resources/Documents/slicer-module.md").read_text()
    code = page.split("<!-- tested by Testing/slicer_module -->\n```python\n")[1].split("```")[0]
    node = SceneLogic(a_scene).add_volume(a_phantom.volume)
    out = a_case_file.parent / "export"
    given = {"scene": a_scene, "volumeNode": node, "caseFile": a_case_file, "folder": out}
    exec(compile(code, "slicer-module.md", "exec"), given)
    return a_scene, node, given["document"], out


def test_without_slicer_the_four_classes_are_there_and_nothing_is_loaded(run_python):
    code = (
        "import sys\n"
        "sys.modules['slicer'] = None\n"
        "import HexaFixModule as m\n"
        "print(m.HexaFixModule.__bases__[0].__name__, hasattr(m, 'HexaFixModuleWidget'),\n"
        "      hasattr(m, 'HexaFixModuleLogic'), hasattr(m, 'HexaFixModuleTest'))\n"
        "print(*({n.split('.')[0] for n in sys.modules} & {'numpy', 'scipy', 'vtk', 'vtkmodules',"
        " 'pydantic', 'SimpleITK', 'qt', 'hexafix'}))\n"
    )
    run = run_python(code)
    assert run.stdout.splitlines() == ["_Inert True True True", ""], run.stderr


def test_at_file_scope_only_the_standard_library_and_slicer_are_imported(entrance):
    """A rule of Slicer's index of extensions: what may be missing is imported when it is used."""
    tree = ast.parse(entrance.read_text())
    top_level = [n for node in tree.body for n in _statements(node)]
    names = set()
    for node in top_level:
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add(node.module.split(".")[0])
    assert names - STANDARD == {"slicer"}


def _statements(node):
    """The node and all below it that run at import: no function's body."""
    yield node
    if not isinstance(node, ast.FunctionDef | ast.Lambda):
        for child in ast.iter_child_nodes(node):
            yield from _statements(child)


def test_the_entrance_is_short(entrance):
    assert entrance.read_text().count("\n") <= 150


def test_a_volume_node_goes_in_and_nodes_and_the_plain_export_come_out(a_planned_scene, an_export):
    from hexafix.mrml.nodes import find
    from hexafix.mrml.phantom_check import SHOWN

    scene, _, document, out = a_planned_scene
    assert document == json.loads((an_export / "plan.json").read_text())
    assert {path.name for path in out.iterdir()} == {path.name for path in an_export.iterdir()}
    for path in an_export.iterdir():
        assert (out / path.name).read_bytes() == path.read_bytes(), path.name
    assert all(find(scene, role) is not None for role in SHOWN)


def test_a_moved_volume_node_is_not_planned(a_scene, a_phantom, a_case_file, tmp_path):
    """A harden or a drag that shears the volume must not become a plan (H36)."""
    from hexafix.mrml import SceneLogic
    from vtkmodules.vtkCommonMath import vtkMatrix4x4

    import HexaFixModule

    node = SceneLogic(a_scene).add_volume(a_phantom.volume, "Sheared")
    matrix = vtkMatrix4x4()
    node.GetIJKToRASMatrix(matrix)
    matrix.SetElement(0, 1, matrix.GetElement(0, 1) + 0.2)
    node.SetIJKToRASMatrix(matrix)
    with pytest.raises(Refused):
        HexaFixModule.HexaFixModuleLogic(scene=a_scene).plan(node, a_case_file, tmp_path / "out")
    assert not (tmp_path / "out").exists()


class Copied:
    """A plan function that only copies an export, for the checks on what is missing."""

    def __init__(self, export, document=None):
        self.export, self.document = export, document

    def __call__(self, node, case_file, folder):
        import shutil

        assert Path(case_file).is_file()
        assert np.prod(node.GetImageData().GetDimensions()) > 1e6
        shutil.copytree(self.export, folder)
        self.change(folder)
        return self.document or json.loads((self.export / "plan.json").read_text())

    def change(self, folder):
        """Nothing here."""


def faults_of(plan, scene, phantom):
    from hexafix.mrml.phantom_check import check_on_phantom

    with pytest.raises(HexaFixError) as caught:
        check_on_phantom(plan, scene, phantom=phantom)
    return [fault.what for fault in caught.value.faults]


def test_the_modules_own_test_passes_on_a_sound_installation(a_phantom, monkeypatch):
    """Its phantom is of the kind that the session has made already."""
    from hexafix.mrml import phantom_check

    import HexaFixModule

    made = []

    def make(spec):
        made.append(spec)
        return a_phantom

    for field in ("size_ijk", "spacing_mm", "image_angles_rad", "noise_hu", "correction"):
        assert getattr(phantom_check.SPEC, field) == getattr(a_phantom.spec, field)
    monkeypatch.setattr(phantom_check, "make_phantom", make)
    HexaFixModule.HexaFixModuleTest().runTest()
    assert made == [phantom_check.SPEC]


def test_the_modules_own_test_raises_when_nodes_are_missing(an_export, a_phantom):
    from hexafix.mrml import HeadlessMrmlApp
    from hexafix.mrml.phantom_check import SHOWN

    with HeadlessMrmlApp() as app:
        assert faults_of(Copied(an_export), app.scene, a_phantom) == [
            f"no node {role}" for role in SHOWN
        ]


def test_the_modules_own_test_raises_when_a_file_is_missing(a_planned_scene, an_export, a_phantom):
    plan = Copied(an_export)
    plan.change = lambda folder: (folder / "schedule.csv").unlink()
    faults = faults_of(plan, a_planned_scene[0], a_phantom)
    assert faults == ["the export lacks schedule.csv"]


def test_the_modules_own_test_raises_when_the_export_does_not_verify(
    a_planned_scene, an_export, a_phantom
):
    plan = Copied(an_export)

    def change(folder):
        text = (folder / "schedule.csv").read_text()
        (folder / "schedule.csv").write_text(text.replace(".5", ".0", 1))

    plan.change = change
    assert faults_of(plan, a_planned_scene[0], a_phantom) == ["the export does not verify"]


def test_the_modules_own_test_raises_when_the_plan_is_off_the_truth(
    a_planned_scene, an_export, a_phantom
):
    document = json.loads((an_export / "plan.json").read_text())
    document["mechanism"]["matrix"][0][3] += 0.5
    faults = faults_of(Copied(an_export, document), a_planned_scene[0], a_phantom)
    assert faults == ["recognised_mm is off the truth"]


def test_slicers_own_scene_is_emptied_and_used_where_there_is_one(monkeypatch):
    import slicer
    from hexafix.mrml.phantom_check import scene_for_test

    class Scene:
        cleared = None

        def Clear(self, singletons):  # noqa: N802 - VTK's name
            self.cleared = singletons

    scene = Scene()
    monkeypatch.setattr(slicer, "mrmlScene", scene, raising=False)
    with scene_for_test() as given:
        assert given is scene
    assert scene.cleared == 0
