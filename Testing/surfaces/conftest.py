import numpy as np
import pytest
from scipy.spatial.transform import Rotation


def pose(angles_deg, position_mm):
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_euler("xyz", angles_deg, degrees=True).as_matrix()
    matrix[:3, 3] = position_mm
    return matrix


@pytest.fixture(scope="session")
def make_scene():
    """A scene at given ring poses: `make_scene(angles_deg, position_mm)` of the distal ring."""
    from hexafix.hardware import shipped_fixator
    from hexafix.report.scene import SceneBall, SceneGeometry

    def make(angles_deg=(12.0, -7.0, 31.0), position_mm=(-140.0, 60.0, -812.0)):
        distal = pose(angles_deg, position_mm)
        proximal = distal @ pose((4.0, -6.0, 8.0), (5.0, -3.0, 172.0))
        balls = (
            SceneBall(1, proximal[:3, :3] @ [100, 0, 20] + proximal[:3, 3], 10.0, "proximal"),
            SceneBall(2, proximal[:3, :3] @ [0, 100, 20] + proximal[:3, 3], 8.0, "proximal"),
            SceneBall(5, distal[:3, :3] @ [-70, 70, 20] + distal[:3, 3], 10.0, "distal"),
        )
        return SceneGeometry(proximal, distal, shipped_fixator(), balls, "left")

    return make


@pytest.fixture(scope="session")
def a_scene(make_scene):
    return make_scene()


@pytest.fixture(scope="session")
def triangles():
    """A mesh's corners, shape (N, 3, 3), mm, in their order."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    def read(mesh):
        points = vtk_to_numpy(mesh.GetPoints().GetData()).astype(float)
        corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray())
        assert len(corners) == 3 * mesh.GetNumberOfCells(), "every face is a triangle"
        return points[corners.reshape(-1, 3)]

    return read


@pytest.fixture(scope="session")
def enclosed_mm3(triangles):
    """The volume that a mesh encloses, by the divergence theorem: negative if inside out."""

    def measure(mesh):
        a, b, c = np.moveaxis(triangles(mesh) - triangles(mesh).mean((0, 1)), 1, 0)
        return float(np.sum(a * np.cross(b, c)) / 6)

    return measure


@pytest.fixture(scope="session")
def open_edges():
    """How many edges of a mesh belong to one face only, points at one place taken as one."""
    from vtkmodules.vtkFiltersCore import vtkCleanPolyData, vtkFeatureEdges

    def count(mesh):
        clean = vtkCleanPolyData()
        clean.SetInputData(mesh)
        clean.SetAbsoluteTolerance(1e-3)
        clean.ToleranceIsAbsoluteOn()
        edges = vtkFeatureEdges()
        edges.SetInputConnection(clean.GetOutputPort())
        edges.FeatureEdgesOff()
        edges.NonManifoldEdgesOff()
        edges.ManifoldEdgesOff()
        edges.Update()
        return edges.GetOutput().GetNumberOfCells()

    return count
