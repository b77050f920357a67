"""No string of the input that could name a patient is in a scene bundle (H51)."""

import re
import zipfile

import pytest

DRIVER = """
import sys
from pathlib import Path
from hexafix.case import load_case
from hexafix.mrml import HeadlessMrmlApp, SceneLogic
from hexafix.pipeline import read_image

case_file, out, name = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
case = load_case(case_file)
volume = read_image(case.image_path, series_instance_uid=case.series_instance_uid)
app = HeadlessMrmlApp()
logic = SceneLogic(app.scene, app_logic=app.app_logic)
node = logic.add_volume(volume, name)
node.SetAttribute("DICOM.instanceUIDs", name)
node.SetDescription(name)
logic.plan(node, case, out / "export")
logic.scene.AddNewNodeByClass("vtkMRMLModelNode", name)
tree = app.scene.GetFirstNodeByClass("vtkMRMLSubjectHierarchyNode")
item = tree.CreateSubjectItem(tree.GetSceneItemID(), name)
tree.SetItemAttribute(item, "DICOM.PatientName", name)
logic.save_bundle(out / "scene.mrb")
other = SceneLogic(HeadlessMrmlApp().scene)
other.open_bundle(out / "scene.mrb")
print("reopened", other.case_from_scene().case_id)
"""


@pytest.fixture(scope="module")
def saved(salted_case, salt, tmp_path_factory):
    """The salted patient in a scene whose nodes were given the patient's name, saved."""
    out = tmp_path_factory.mktemp("bundle")
    code = f"import sys; sys.argv[1:] = {[str(salted_case.case), str(out), salt.text('node')]!r}"
    run = salted_case.run(code=f"{code}\n{DRIVER}")
    assert run.code == 0, run.stderr
    return run, out


def texts_of(name, content):
    """A member without its voxels or coordinates, which would take minutes to scan."""
    if name.endswith(".nrrd"):
        return content.partition(b"\n\n")[0]
    if name.endswith(".vtp"):
        return re.sub(rb"(?m)^[-+0-9.e ]+$", b"", content)
    return content


def test_a_bundle_names_the_patient_nowhere(saved, scan):
    _, out = saved
    with zipfile.ZipFile(out / "scene.mrb") as archive:
        names = archive.namelist()
        assert len(names) > 40
        assert b"vtkMRMLScalarVolumeNode1" in archive.read("hexafix/scene.mrml")
        assert archive.comment == b""
        assert {entry.extra + entry.comment for entry in archive.infolist()} == {b""}
        for name in names:
            text = texts_of(name, archive.read(name))
            assert len(text) > 50
            assert scan.of(name) == set()
            assert scan.of(text) == set(), name


def test_the_scan_finds_the_name_of_a_node_in_a_bundle(saved, salt, scan, tmp_path):
    _, out = saved
    with (
        zipfile.ZipFile(out / "scene.mrb") as archive,
        zipfile.ZipFile(tmp_path / "leaky.mrb", "w", zipfile.ZIP_DEFLATED) as leaky,
    ):
        text = archive.read("hexafix/scene.mrml").decode()
        leaky.writestr("hexafix/scene.mrml", text.replace('name="CT"', f'name="{salt.text("x")}"'))
    assert "text x" in scan.of((tmp_path / "leaky.mrb").read_bytes())


def test_saving_and_opening_say_nothing_of_the_patient_and_leave_nothing_behind(
    saved, salted_case, scan
):
    run, out = saved
    assert "reopened pseudonym-7" in run.stdout
    assert scan.of(run.stdout + run.stderr) == set()
    assert sorted(path.name for path in out.iterdir()) == ["export", "scene.mrb"]
    assert list(salted_case.scratch.rglob("*")) == []
