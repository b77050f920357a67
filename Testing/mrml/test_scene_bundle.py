"""A scene saved and reopened: nothing lost, nothing foreign along, and the same plan."""

import json
import re
import stat
import subprocess
import sys
import zipfile

import numpy as np
import pytest
from hexafix.errors import InputError
from hexafix.mrml import HeadlessMrmlApp, SceneLogic, open_bundle, save_bundle, transforms
from hexafix.mrml import volume as volumes
from hexafix.mrml.hierarchy import tree_of
from hexafix.mrml.markups import positions_lps_mm
from hexafix.mrml.nodes import ROLE, find, nodes_of
from hexafix.mrml.tables import table_rows
from hexafix.pipeline import playback


@pytest.fixture(scope="module")
def bundle(planned, tmp_path_factory):
    path = tmp_path_factory.mktemp("bundle") / "scene.mrb"
    planned.logic.save_bundle(path)
    return path


@pytest.fixture(scope="module")
def reopened(bundle):
    app = HeadlessMrmlApp()
    logic = SceneLogic(app.scene, app_logic=app.app_logic)
    logic.open_bundle(bundle)
    yield logic
    app.close()


def getters(node):
    """Every plain value that a node can be asked for without an argument."""
    skip = {
        *("GetMTime", "GetID", "GetSceneID", "GetReferenceCount", "GetClassName", "GetStoredTime"),
        *("GetDebug", "GetGlobalWarningDisplay", "GetObjectDescription", "GetAddressAsString"),
        *("GetInteractionHandleToWorldMatrix", "GetWriteCopy", "GetTransformNodeID"),
        *("GetDisableModifiedEvent", "GetModifiedSinceRead", "GetCustomModifiedEventPending"),
        *("GetModifiedEventPending", "GetInMRMLCallbackFlag", "GetAddToScene", "GetDescription"),
        *("GetAddToSceneNoModify", "GetIsAddedToScene"),
    }
    found = {}
    for name in sorted(set(dir(node)) - skip):
        if not name.startswith("Get") or name.endswith(("ID", "Time", "MinValue", "MaxValue")):
            continue
        try:
            value = getattr(node, name)()
        except TypeError:
            continue
        if isinstance(value, (str, int, float, bool, tuple)):
            found[name] = value
    return found


def same(one, other):
    if isinstance(one, float):
        # colours and sizes are written to the scene file with six digits
        return abs(one - other) <= 1e-5 * max(1.0, abs(one))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    return one == other


def test_every_node_comes_back_in_its_role(planned, reopened, roles_of):
    before, after = roles_of(planned.app.scene), roles_of(reopened.scene)
    assert set(before) == set(after)
    assert {r: n.GetClassName() for r, n in before.items()} == {
        r: n.GetClassName() for r, n in after.items()
    }
    assert len(before) > 40


def test_every_property_of_every_node_and_display_comes_back(planned, reopened, roles_of):
    before, after = roles_of(planned.app.scene), roles_of(reopened.scene)
    compared = 0
    for role, node in before.items():
        pairs = [(node, after[role])]
        if node.IsA("vtkMRMLDisplayableNode"):
            pairs.append((node.GetDisplayNode(), after[role].GetDisplayNode()))
        for one, two in pairs:
            if one is None:
                assert two is None
                continue
            wanted, got = getters(one), getters(two)
            if one.IsA("vtkMRMLDisplayNode"):
                wanted.pop("GetName"), got.pop("GetName")
            different = {
                name: (value, got.get(name))
                for name, value in wanted.items()
                if not same(value, got.get(name))
            }
            assert not different, role
            compared += len(wanted)
    assert compared > 3000


def test_attributes_references_and_transforms_come_back(planned, reopened, roles_of):
    before, after = roles_of(planned.app.scene), roles_of(reopened.scene)
    for role, node in before.items():
        other = after[role]
        ours = {n: node.GetAttribute(n) for n in node.GetAttributeNames() if "HexaFix" in n}
        assert {n: other.GetAttribute(n) for n in ours} == ours
        if node.IsA("vtkMRMLTransformableNode"):
            parent, twin = node.GetParentTransformNode(), other.GetParentTransformNode()
            assert (parent and parent.GetAttribute(ROLE)) == (twin and twin.GetAttribute(ROLE))
    volume = find(reopened.scene, "parameters").GetNodeReference("inputVolume")
    assert volume is reopened.volume_node()


def test_voxels_points_shapes_matrices_and_table_come_back(planned, reopened, roles_of):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    before, after = roles_of(planned.app.scene), roles_of(reopened.scene)
    kinds = set()
    for role, node in before.items():
        other = after[role]
        kinds.add(node.GetClassName())
        if node.IsA("vtkMRMLScalarVolumeNode"):
            one, two = planned.logic.volume_of(node), reopened.volume_of(other)
            np.testing.assert_array_equal(one.voxels, two.voxels)
            np.testing.assert_array_equal(one.ijk_to_lps, two.ijk_to_lps)
            assert one.source == two.source
        elif node.IsA("vtkMRMLModelNode"):
            for of in (
                lambda mesh: mesh.GetPoints().GetData(),
                lambda mesh: mesh.GetPolys().GetConnectivityArray(),
                lambda mesh: mesh.GetPolys().GetOffsetsArray(),
            ):
                one, two = (of(n.GetPolyData()) for n in (node, other))
                # in text a float32 has eight digits: the last bit, a tenth of a micrometre, may go
                np.testing.assert_allclose(vtk_to_numpy(one), vtk_to_numpy(two), rtol=2e-7)
            normals = [n.GetPolyData().GetPointData().GetNormals() for n in (node, other)]
            if normals[0] is not None:
                np.testing.assert_allclose(*map(vtk_to_numpy, normals), rtol=2e-7, atol=1e-7)
        elif node.IsA("vtkMRMLLinearTransformNode"):
            np.testing.assert_allclose(
                transforms.motion_lps(other), transforms.motion_lps(node), atol=1e-9
            )
        elif node.IsA("vtkMRMLMarkupsNode"):
            # markups files round the last bit of a number
            np.testing.assert_allclose(
                positions_lps_mm(other), positions_lps_mm(node), rtol=0, atol=1e-12
            )
            for k in range(node.GetNumberOfControlPoints()):
                for ask in ("Label", "Description", "ID", "Selected", "Visibility"):
                    name = f"GetNthControlPoint{ask}"
                    assert getattr(other, name)(k) == getattr(node, name)(k)
        elif node.IsA("vtkMRMLTableNode"):
            assert table_rows(other) == table_rows(node)
            assert other.GetColumnUnitLabel("strut_1_mm") == "mm"
    assert len(kinds) == 6


def test_the_tree_comes_back(planned, reopened):
    # folders stand in the order in which their first nodes came
    assert sorted(tree_of(reopened.scene)) == sorted(tree_of(planned.app.scene))


def test_a_reopened_scene_plans_to_identical_files(planned, reopened, tmp_path):
    reopened.plan(reopened.volume_node(), reopened.case_from_scene(), tmp_path / "export")
    for path in planned.export.iterdir():
        assert (tmp_path / "export" / path.name).read_bytes() == path.read_bytes()


def test_playback_runs_in_a_reopened_scene(planned, reopened, a_plan):
    row = playback(a_plan).rows[-1]
    reopened.show_playback_row(playback(a_plan), row.index)
    node = find(reopened.scene, transforms.RING["proximal"])
    np.testing.assert_allclose(transforms.motion_lps(node), row.proximal_lps, atol=1e-12)
    reopened.show_playback_row(None, None)
    np.testing.assert_allclose(
        transforms.motion_lps(node), planned.document["rings"]["proximal"]["matrix_lps"], atol=1e-9
    )


def test_slicers_own_reader_of_bundles_reads_it(bundle, planned, roles_of):
    with HeadlessMrmlApp() as app:
        assert app.scene.ReadFromMRB(str(bundle))
        assert set(roles_of(app.scene)) == set(roles_of(planned.app.scene))


@pytest.mark.parametrize("dtype", [np.int16, np.float32])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_volume_goes_through_a_bundle_to_the_last_bit(
    logic, oblique_volume, tmp_path, dtype, mirrored
):
    volume = oblique_volume(dtype, mirrored=mirrored)
    logic.add_volume(volume)
    logic.save_bundle(tmp_path / "a.mrb")
    with HeadlessMrmlApp() as app:
        other = SceneLogic(app.scene)
        other.open_bundle(tmp_path / "a.mrb")
        back = other.volume_of(other.volume_node())
    assert back.voxels.dtype == volume.voxels.dtype
    np.testing.assert_array_equal(back.voxels, volume.voxels)
    np.testing.assert_array_equal(back.ijk_to_lps, volume.ijk_to_lps)
    assert back.source.warnings == ()


def test_nothing_of_the_scene_goes_along_but_our_nodes(app, logic, oblique_volume, tmp_path):
    node = logic.add_volume(oblique_volume(), "Doe^Jane 1960")
    node.SetDescription("Doe of the clinic")
    node.SetAttribute("DICOM.instanceUIDs", "1.2.3.Doe")
    node.GetDisplayNode().SetName("Doe's display")
    foreign = app.scene.AddNewNodeByClass("vtkMRMLModelNode", "Doe's model")
    foreign.SetAttribute("PatientName", "Doe")
    tree = app.scene.GetFirstNodeByClass("vtkMRMLSubjectHierarchyNode")
    if tree is not None:
        tree.CreateSubjectItem(tree.GetSceneItemID(), "Doe^Jane")
    parameters = logic.save_case_into({"schema_version": 1, "case_id": "case-1"})
    parameters.SetParameter("operator", "Dr. Doe")
    parameters.SetName("Doe")
    parameters.SetParameter(
        "caseJson", json.dumps({"case_id": "case-1", "image": {"path": "/home/Doe/ct"}})
    )
    logic.save_bundle(tmp_path / "a.mrb")
    with zipfile.ZipFile(tmp_path / "a.mrb") as archive:
        texts = [archive.read(name).decode("latin-1") for name in archive.namelist()]
        texts += archive.namelist()
    assert len(texts) > 3
    assert not any("Doe" in text for text in texts)
    assert any("case-1" in text for text in texts)


@pytest.fixture
def a_small_bundle(logic, oblique_volume, a_recognised, a_judged, layouts, tmp_path):
    """A volume and balls: quickly saved and opened."""
    logic.add_volume(oblique_volume())
    logic.show_balls(a_recognised.balls, a_judged, layouts)
    logic.save_bundle(tmp_path / "small.mrb")
    return tmp_path / "small.mrb"


def test_a_bundle_does_not_tell_when_or_by_whom_it_was_saved(logic, a_small_bundle, tmp_path):
    logic.save_bundle(tmp_path / "again.mrb")
    with zipfile.ZipFile(a_small_bundle) as one, zipfile.ZipFile(tmp_path / "again.mrb") as two:
        assert one.namelist() == two.namelist()
        for name in one.namelist():
            # the tree's numbers go on counting
            first, second = (a.read(name).decode("latin-1") for a in (one, two))
            bare = [re.sub(r'(id|parent)="\d+"', "", text) for text in (first, second)]
            assert bare[0] == bare[1], name
        assert {entry.date_time for entry in one.infolist()} == {(1980, 1, 1, 0, 0, 0)}
        assert {stat.S_IFMT(e.external_attr >> 16) for e in one.infolist()} == {stat.S_IFREG}


def test_saving_changes_nothing_in_the_scene(logic, oblique_volume, tmp_path):
    node = logic.add_volume(oblique_volume(), "my own name")
    before = logic.scene.GetNumberOfNodes(), node.GetName(), node.GetMTime()
    logic.save_bundle(tmp_path / "a.mrb")
    assert (logic.scene.GetNumberOfNodes(), node.GetName(), node.GetMTime()) == before


def test_opening_takes_the_place_of_our_nodes_and_leaves_others(app, logic, a_small_bundle):
    logic.show_landmarks([[1.0, 2, 3]], [])
    foreign = app.scene.AddNewNodeByClass("vtkMRMLModelNode", "somebody else's")
    open_bundle(app.scene, a_small_bundle)
    assert find(app.scene, "markups/landmarks/moving") is None
    assert app.scene.IsNodePresent(foreign)
    first = app.scene.GetNumberOfNodes()
    open_bundle(app.scene, a_small_bundle)
    assert app.scene.GetNumberOfNodes() == first, "nothing is left over from the first"


def test_an_older_bundle_stays_if_the_new_one_cannot_be_written(planned, tmp_path, monkeypatch):
    target = tmp_path / "a.mrb"
    target.write_bytes(b"older")
    from hexafix.mrml import archive

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(archive, "_write_entries", full)
    with pytest.raises(InputError) as refused:
        save_bundle(planned.app.scene, target)
    assert refused.value.faults[0].code == "bundle-not-written"
    assert target.read_bytes() == b"older"
    assert list(tmp_path.iterdir()) == [target]


def test_a_volume_that_somebody_else_loaded_is_saved_too(app, logic, oblique_volume, tmp_path):
    node = logic.add_volume(oblique_volume(), "Doe")
    for name in list(node.GetAttributeNames()):
        node.RemoveAttribute(name)
    volumes.adopt(app.scene, node)
    before = logic.volume_of(node)
    assert before.source.warnings == (volumes.FOREIGN,)
    logic.save_bundle(tmp_path / "a.mrb")
    with HeadlessMrmlApp() as other_app:
        other = SceneLogic(other_app.scene)
        other.open_bundle(tmp_path / "a.mrb")
        back = other.volume_of(other.volume_node())
    np.testing.assert_array_equal(back.ijk_to_lps, before.ijk_to_lps)
    np.testing.assert_array_equal(back.voxels, before.voxels)
    assert back.source == before.source


def test_the_archive_is_one_that_other_tools_read(bundle):
    run = subprocess.run(
        [sys.executable, "-m", "zipfile", "-t", str(bundle)],
        capture_output=True,
        text=True,
        check=True,
    )
    assert "Done testing" in run.stdout


def test_no_role_is_given_twice(planned):
    roles = [node.GetAttribute(ROLE) for node in nodes_of(planned.app.scene)]
    assert len(roles) == len(set(roles))
