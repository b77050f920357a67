"""Slices lie where the volume has them and are looked at as in radiology."""

import numpy as np
import pytest
from hexafix.imaging import Volume
from hexafix.surfaces import (
    SLICE_VIEWS,
    at_place,
    ball_at,
    balls_middle_mm,
    cut,
    half_height_mm,
    in_slice,
    look_at_slice,
    middle_mm,
    nearest_place,
    slice_image,
    slice_places_mm,
    spheres,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

LETTERS = {
    "L": (1, 0, 0), "R": (-1, 0, 0), "P": (0, 1, 0), "A": (0, -1, 0),
    "H": (0, 0, 1), "F": (0, 0, -1),
}  # fmt: skip


def a_volume(*, mirrored=False):
    rng = np.random.default_rng(3)
    voxels = rng.integers(-1000, 3000, (9, 7, 11)).astype(np.int16)
    spacing = np.array([0.7, 0.9, -1.6 if mirrored else 1.6])
    affine = np.eye(4)
    turn = Rotation.from_euler("xyz", [0.1, -0.2, 0.15]).as_matrix()
    affine[:3, :3] = turn * spacing
    affine[:3, 3] = [-31.0, 12.0, 840.0]
    return Volume(voxels, affine)


def camera_of(view, point):
    from vtkmodules.vtkRenderingCore import vtkCamera

    camera = vtkCamera()
    look_at_slice(camera, view, point)
    return camera


@pytest.mark.parametrize("view", SLICE_VIEWS, ids=lambda view: view.name)
def test_the_letters_at_the_edges_are_the_cameras_directions(view):
    camera = camera_of(view, (5.0, -7.0, 11.0))
    to_eye = np.array(camera.GetPosition()) - camera.GetFocalPoint()
    up = np.array(camera.GetViewUp())
    right = np.cross(up, to_eye / np.linalg.norm(to_eye))
    np.testing.assert_allclose(right, LETTERS[view.right], atol=1e-12)
    np.testing.assert_allclose(-right, LETTERS[view.left], atol=1e-12)
    np.testing.assert_allclose(up, LETTERS[view.top], atol=1e-12)
    np.testing.assert_allclose(-up, LETTERS[view.bottom], atol=1e-12)
    assert abs(to_eye[view.axis]) == pytest.approx(np.linalg.norm(to_eye))


@pytest.mark.parametrize("mirrored", [False, True])
def test_every_voxel_stands_in_vtk_where_the_volume_has_it(mirrored):
    volume = a_volume(mirrored=mirrored)
    image, matrix = slice_image(volume)
    rng = np.random.default_rng(4)
    for _ in range(50):
        i, j, k = (int(rng.integers(n)) for n in volume.size_ijk)
        assert image.GetScalarComponentAsDouble(i, j, k, 0) == volume.voxels[k, j, i]
        found = matrix.MultiplyPoint((i, j, k, 1.0))
        np.testing.assert_allclose(found[:3], volume.lps_from_ijk((i, j, k)), atol=1e-12)


def test_vtks_copy_leaves_the_volume_as_it_is():
    volume = a_volume()
    before = volume.voxels.copy()
    image, _ = slice_image(volume)
    image.SetScalarComponentFromDouble(0, 0, 0, 0, 17.0)
    np.testing.assert_array_equal(volume.voxels, before)


@pytest.mark.parametrize("view", SLICE_VIEWS, ids=lambda view: view.name)
def test_the_places_reach_from_end_to_end_about_a_voxel_apart(view):
    volume = a_volume()
    places = slice_places_mm(volume, view)
    corners = volume.corners_mm()[:, view.axis]
    assert places[0] == pytest.approx(corners.min())
    assert places[-1] == pytest.approx(corners.max())
    steps = np.diff(places)
    assert steps.min() > 0
    assert 0.2 <= steps.max() <= 2 * np.abs(volume.spacing_mm).max()
    for place in (0, len(places) // 2, len(places) - 1):
        assert nearest_place(places, places[place] + 0.3 * steps[0]) == place


@pytest.mark.parametrize("view", SLICE_VIEWS, ids=lambda view: view.name)
@pytest.mark.parametrize("aspect", [0.4, 1.0, 2.5])
def test_the_whole_slice_fits_into_the_view(view, aspect):
    volume = a_volume()
    half = half_height_mm(volume, view, aspect=aspect)
    size = np.ptp(volume.corners_mm(), axis=0)
    up = np.abs(LETTERS[view.top]) @ size
    across = np.abs(LETTERS[view.right]) @ size
    assert 2 * half >= up
    assert 2 * half * aspect >= across
    assert 2 * half <= 1.1 * max(up, across / aspect)


@pytest.mark.parametrize("view", SLICE_VIEWS, ids=lambda view: view.name)
def test_a_point_moves_into_a_slice_along_its_axis_only(view):
    moved = np.array(at_place(view, (1.0, 2.0, 3.0), 9.0))
    assert moved[view.axis] == 9.0
    kept = [axis for axis in range(3) if axis != view.axis]
    np.testing.assert_array_equal(moved[kept], np.array([1.0, 2.0, 3.0])[kept])


@pytest.mark.parametrize("view", SLICE_VIEWS, ids=lambda view: view.name)
def test_a_ball_is_cut_in_a_circle_of_its_own_radius(view):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    center, offset = np.array([10.0, -20.0, 30.0]), 3.0
    lines = cut(spheres([center], diameters_mm=10.0), view, center[view.axis] + offset)
    points = vtk_to_numpy(lines.GetPoints().GetData())
    far = np.linalg.norm(points - at_place(view, center, center[view.axis] + offset), axis=1)
    np.testing.assert_allclose(far, 4.0, atol=0.15)
    assert cut(spheres([center], diameters_mm=10.0), view, 500.0).GetNumberOfPoints() == 0


def test_only_balls_near_a_slice_are_named_there():
    centers = [(0, 0, 0), (0, 0, 5.9), (0, 0, -6.1), (90, 90, 1)]
    view = next(view for view in SLICE_VIEWS if view.name == "axial")
    assert in_slice(centers, view=view, place_mm=0.0, reach_mm=6.0) == [0, 1, 3]


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 30.0))
def test_a_click_finds_the_nearest_ball_within_reach_or_none(seed, reach):
    rng = np.random.default_rng(seed)
    centers = rng.uniform(-50, 50, (6, 3))
    point = rng.uniform(-50, 50, 3)
    far = [float(np.sqrt(((center - point) ** 2).sum())) for center in centers]
    found = ball_at(centers, point_mm=point, reach_mm=reach)
    if found is None:
        assert min(far) > reach
    else:
        assert far[found] == min(far) <= reach


def test_without_balls_there_is_none_to_find():
    assert ball_at([], point_mm=(0, 0, 0), reach_mm=10.0) is None
    assert balls_middle_mm([]) is None


def test_the_middles_are_those_of_the_boxes():
    volume = a_volume()
    low, high = volume.corners_mm().min(0), volume.corners_mm().max(0)
    np.testing.assert_allclose(middle_mm(volume), (low + high) / 2)
    np.testing.assert_allclose(balls_middle_mm([(0, 0, 0), (2, 4, -6), (1, 1, 0)]), (1, 2, -3))
