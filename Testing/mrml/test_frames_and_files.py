"""LPS in the chain and on disk, RAS in the nodes, and the inverse in a transform's file (H36)."""

import json

import numpy as np
import pytest
import SimpleITK
from hexafix import surfaces
from hexafix.errors import Refused
from hexafix.geometry import Pose
from hexafix.mrml import markups, models, transforms
from hexafix.mrml.geometry import array4, lps_points, motion_of_vtk, require_rigid, vtk_of_motion
from hypothesis import given
from hypothesis import strategies as st

MOTION = Pose.from_xyz_fixed(position_mm=[12.0, -34.0, 56.0], angles_rad=[0.2, -0.3, 0.5]).matrix

POINT = np.array([10.0, 20.0, 30.0])


def write(node, path):
    node.AddDefaultStorageNode()
    storage = node.GetStorageNode()
    storage.SetFileName(str(path))
    assert storage.WriteData(node)
    return path


def test_a_node_holds_ras_and_gives_lps(app):
    node = transforms.put_transform(app.scene, "transform/a", "A", MOTION)
    held = array4(node.GetMatrixTransformToParent())
    flip = np.diag([-1.0, -1, 1, 1])
    np.testing.assert_allclose(held @ flip @ [*POINT, 1], flip @ MOTION @ [*POINT, 1])
    np.testing.assert_array_equal(transforms.motion_lps(node), MOTION)


@given(st.lists(st.floats(-1e3, 1e3), min_size=6, max_size=6))
def test_a_motion_comes_back_from_its_vtk_matrix_to_the_last_bit(values):
    pose = Pose.from_xyz_fixed(position_mm=values[:3], angles_rad=np.array(values[3:]) / 400)
    np.testing.assert_array_equal(motion_of_vtk(vtk_of_motion(pose.matrix)), pose.matrix)


def test_a_transform_moves_points_the_way_the_motion_says(app):
    """A model below the transform goes where the motion takes its points."""
    node = transforms.put_transform(app.scene, "transform/a", "A", MOTION)
    ball = models.put_model(
        app.scene,
        "model/a",
        "A",
        surfaces.spheres([POINT], diameters_mm=2.0),
        colour=(1.0, 0.0, 0.0),
    )
    transforms.put_below(ball, node)
    bounds = [0.0] * 6
    ball.GetRASBounds(bounds)
    middle = (np.array(bounds[::2]) + np.array(bounds[1::2])) / 2
    np.testing.assert_allclose(lps_points(middle), (MOTION @ [*POINT, 1])[:3], atol=0.05)


@pytest.mark.parametrize("extension", ["tfm", "h5", "txt"])
def test_a_transforms_file_holds_the_inverse_in_lps(app, tmp_path, extension):
    """Read as the motion itself, the file would correct the bone the wrong way."""
    node = transforms.put_transform(app.scene, "transform/a", "A", MOTION)
    file = write(node, tmp_path / f"motion.{extension}")
    read = SimpleITK.ReadTransform(str(file))
    moved = (MOTION @ [*POINT, 1])[:3]
    np.testing.assert_allclose(read.TransformPoint(moved), POINT, atol=1e-9)
    assert np.linalg.norm(np.array(read.TransformPoint(POINT)) - moved) > 50


def test_the_way_back_from_the_file_is_the_motion(app, tmp_path):
    node = transforms.put_transform(app.scene, "transform/a", "A", MOTION)
    file = write(node, tmp_path / "motion.tfm")
    other = app.scene.AddNewNodeByClass("vtkMRMLLinearTransformNode")
    other.AddDefaultStorageNode()
    other.GetStorageNode().SetFileName(str(file))
    assert other.GetStorageNode().ReadData(other)
    np.testing.assert_allclose(transforms.motion_lps(other), MOTION, atol=1e-12)


def test_a_list_of_points_is_ras_in_the_node_and_lps_in_its_file(app, tmp_path):
    node = markups.put_points(
        app.scene,
        "markups/a",
        "A",
        [markups.Point((10.0, 20.0, 30.0), "7", "distal ring", 3)],
        colour=(1.0, 0.0, 0.0),
    )
    at = [0.0] * 3
    node.GetNthControlPointPosition(0, at)
    assert at == [-10.0, -20.0, 30.0]
    content = json.loads(write(node, tmp_path / "a.mrk.json").read_text())["markups"][0]
    assert content["coordinateSystem"] == "LPS"
    (point,) = content["controlPoints"]
    assert point["position"] == [10.0, 20.0, 30.0]
    assert (point["label"], point["description"]) == ("7", "distal ring")


def test_the_exports_markers_open_where_the_balls_are(an_export, app):
    """What `hexafix plan` writes and what the bridge shows are at one place."""
    plan = json.loads((an_export / "plan.json").read_text())
    node = app.scene.AddNewNodeByClass("vtkMRMLMarkupsFiducialNode")
    node.AddDefaultStorageNode()
    node.GetStorageNode().SetFileName(str(an_export / "markers.mrk.json"))
    assert node.GetStorageNode().ReadData(node)
    for ball, place in zip(
        sorted(plan["balls"], key=lambda ball: ball["number"]),
        markups.positions_lps_mm(node),
        strict=True,
    ):
        np.testing.assert_allclose(place, ball["center_mm"], atol=1e-9)


@pytest.mark.parametrize("extension", ["vtp", "vtk", "stl", "ply"])
def test_a_shapes_file_is_lps(app, tmp_path, extension):
    from vtkmodules import vtkIOGeometry, vtkIOLegacy, vtkIOPLY, vtkIOXML

    node = models.put_model(
        app.scene,
        "model/a",
        "A",
        surfaces.spheres([POINT], diameters_mm=6.0),
        colour=(1.0, 0.0, 0.0),
    )
    bounds = np.array(node.GetPolyData().GetBounds())
    np.testing.assert_allclose((bounds[::2] + bounds[1::2]) / 2, POINT * [-1, -1, 1], atol=0.05)
    file = write(node, tmp_path / f"a.{extension}")
    reader = {
        "vtp": vtkIOXML.vtkXMLPolyDataReader,
        "vtk": vtkIOLegacy.vtkPolyDataReader,
        "stl": vtkIOGeometry.vtkSTLReader,
        "ply": vtkIOPLY.vtkPLYReader,
    }[extension]()
    reader.SetFileName(str(file))
    reader.Update()
    bounds = np.array(reader.GetOutput().GetBounds())
    np.testing.assert_allclose((bounds[::2] + bounds[1::2]) / 2, POINT, atol=0.05)


@pytest.mark.parametrize(
    "spoil",
    [
        np.diag([1.001, 1, 1, 1]),
        np.diag([-1.0, 1, 1, 1]),
        np.array([[1, 0.01, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]]),
        np.full((4, 4), np.nan),
    ],
    ids=["scaled", "mirrored", "sheared", "no numbers"],
)
def test_a_dragged_motion_that_is_not_rigid_is_refused(app, logic, spoil):
    logic.show_target(MOTION, "proximal")
    np.testing.assert_allclose(logic.fragment_motion_lps(), MOTION, atol=1e-12)
    node = app.scene.GetFirstNodeByClass("vtkMRMLLinearTransformNode")
    from hexafix.mrml.geometry import vtk4

    node.SetMatrixTransformToParent(vtk4(array4(node.GetMatrixTransformToParent()) @ spoil))
    with pytest.raises(Refused) as refused:
        logic.fragment_motion_lps()
    assert refused.value.faults[0].code == "transform-not-rigid"
    assert refused.value.faults[0].hazard == "H36"


def test_rounding_of_a_widget_is_cleaned_away():
    noisy = MOTION.copy()
    noisy[:3, :3] += 1e-8 * np.random.default_rng(1).normal(size=(3, 3))
    clean = require_rigid(noisy, what="motion")
    np.testing.assert_allclose(clean[:3, :3] @ clean[:3, :3].T, np.eye(3), atol=1e-14)
    np.testing.assert_allclose(clean, MOTION, atol=1e-7)
