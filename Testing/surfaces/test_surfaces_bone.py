"""The bone's surface lies where the voxels are, whatever the hand of their grid."""

import numpy as np
import pytest
from hexafix import surfaces
from hexafix.report.scene import BoneSample
from hexafix.surfaces import bone as bone_module
from vtkmodules.util.numpy_support import vtk_to_numpy

RADIUS_MM = 15.0
SPACING_MM = np.array([1.9, 1.7, 2.3])
SIZE = np.array([44, 46, 50])
ENDS = {"inside": (-35.0, 40.0), "cut by the grid's end": (-35.0, 1000.0)}


def rotation():
    from scipy.spatial.transform import Rotation

    return Rotation.from_euler("xyz", [20.0, -15.0, 40.0], degrees=True).as_matrix()


def a_rod(*, mirrored=False, ends=ENDS["inside"], hu=540):
    """A rod of 15 mm radius along z of an oblique, anisotropic, off-origin grid of either hand.

    It stands at the same place in LPS for both hands; 220 HU lies half-way between rod and air.
    """
    affine = np.eye(4)
    affine[:3, :3] = rotation() * SPACING_MM
    middle = np.array([-130.0, 75.0, -640.0])
    affine[:3, 3] = middle - affine[:3, :3] @ ((SIZE - 1) / 2)
    k, j, i = np.mgrid[: SIZE[2], : SIZE[1], : SIZE[0]]
    place = (np.stack([i, j, k], -1) - (SIZE - 1) / 2) * SPACING_MM
    inside = np.hypot(place[..., 0], place[..., 1] - 2.0) < RADIUS_MM
    inside &= (place[..., 2] > ends[0]) & (place[..., 2] < ends[1])
    voxels = np.where(inside, hu, -100).astype(np.int16)
    if mirrored:
        voxels = voxels[:, :, ::-1]
        flip = np.diag([-1.0, 1.0, 1.0, 1.0])
        flip[0, 3] = SIZE[0] - 1
        affine = affine @ flip
    assert (np.linalg.det(affine[:3, :3]) < 0) == mirrored
    return BoneSample(np.ascontiguousarray(voxels), affine), middle


def in_rod(points, middle):
    return (points - middle) @ rotation() - [0.0, 2.0, 0.0]


@pytest.mark.parametrize("mirrored", [False, True], ids=["right-handed", "left-handed"])
def test_the_surface_encloses_the_rod_and_is_turned_outwards(
    mirrored, enclosed_mm3, triangles, open_edges
):
    sample, middle = a_rod(mirrored=mirrored)
    mesh = surfaces.bone_surface(sample)
    assert open_edges(mesh) == 0
    assert enclosed_mm3(mesh) == pytest.approx(np.pi * RADIUS_MM**2 * 75.0, rel=0.07)
    points = in_rod(triangles(mesh).mean(1), middle)
    side = points[np.abs(points[:, 2] - 2.5) < 25]
    np.testing.assert_allclose(np.hypot(side[:, 0], side[:, 1]), RADIUS_MM, atol=1.5)
    np.testing.assert_allclose(side[:, :2].mean(0), 0.0, atol=0.4)


@pytest.mark.parametrize("mirrored", [False, True], ids=["right-handed", "left-handed"])
def test_the_stored_normals_point_away_from_the_rods_axis(mirrored):
    sample, middle = a_rod(mirrored=mirrored)
    mesh = surfaces.bone_surface(sample)
    points = in_rod(vtk_to_numpy(mesh.GetPoints().GetData()).astype(float), middle)
    normals = vtk_to_numpy(mesh.GetPointData().GetNormals()) @ rotation()
    side = np.abs(points[:, 2] - 2.5) < 25
    away = points[side, :2] / np.linalg.norm(points[side, :2], axis=1, keepdims=True)
    assert np.sum(normals[side, :2] * away, axis=1).min() > 0.8


def test_where_the_grid_ends_the_bone_is_closed(open_edges, enclosed_mm3):
    sample, _ = a_rod(ends=ENDS["cut by the grid's end"])
    mesh = surfaces.bone_surface(sample)
    assert open_edges(mesh) == 0
    shown = 35.0 + SIZE[2] * SPACING_MM[2] / 2
    assert enclosed_mm3(mesh) == pytest.approx(np.pi * RADIUS_MM**2 * shown, rel=0.07)


def test_specks_are_left_out(triangles):
    sample, middle = a_rod()
    voxels = sample.hu.copy()
    voxels[2:4, 2:4, 2:4] = 1500
    mesh = surfaces.bone_surface(BoneSample(voxels, sample.ijk_to_lps))
    points = in_rod(triangles(mesh).reshape(-1, 3), middle)
    assert np.hypot(points[:, 0], points[:, 1]).max() < RADIUS_MM + 2


def test_nothing_dense_gives_an_empty_mesh():
    sample, _ = a_rod(hu=50)
    assert surfaces.bone_surface(sample).GetNumberOfCells() == 0


def test_metal_is_a_surface_of_its_own():
    sample, _ = a_rod(hu=900)
    assert surfaces.metal_surface(sample).GetNumberOfCells() == 0
    sample, _ = a_rod(hu=3000)
    assert surfaces.metal_surface(sample).GetNumberOfCells() > 1000


def test_a_large_surface_is_thinned_and_keeps_its_shape(monkeypatch, enclosed_mm3, open_edges):
    sample, _ = a_rod()
    whole = surfaces.bone_surface(sample)
    monkeypatch.setattr(bone_module, "MOST_TRIANGLES", 2000)
    thin = surfaces.bone_surface(sample)
    assert whole.GetNumberOfCells() > 4000
    assert thin.GetNumberOfCells() <= 2100
    assert open_edges(thin) == 0
    assert enclosed_mm3(thin) == pytest.approx(enclosed_mm3(whole), rel=0.02)
    assert thin.GetPointData().GetNormals() is not None


def test_the_sample_is_not_changed():
    sample, _ = a_rod()
    sample.hu.setflags(write=False)
    sample.ijk_to_lps.setflags(write=False)
    before = sample.ijk_to_lps.copy()
    surfaces.bone_surface(sample)
    np.testing.assert_array_equal(sample.ijk_to_lps, before)


def test_the_phantoms_bone_runs_through_both_rings(a_phantom, a_read_case, a_recognised, triangles):
    from hexafix.pipeline.document import recognition
    from hexafix.report.scene import SceneGeometry, sample_bone

    seen = {**recognition(a_read_case, a_recognised), "case": dict(a_read_case.document)}
    scene = SceneGeometry.from_document(seen)
    mesh = surfaces.bone_surface(sample_bone(a_phantom.volume, scene))
    assert 5_000 < mesh.GetNumberOfCells() <= 61_000
    along = triangles(mesh).reshape(-1, 3) @ scene.distal_lps[:3, 2]
    for pose in (scene.proximal_lps, scene.distal_lps):
        assert along.min() < pose[:3, 3] @ scene.distal_lps[:3, 2] < along.max()
