"""Rings, struts, balls and axes lie where the poses put them, closed and turned outwards."""

import dataclasses
import os
import subprocess
import sys

import numpy as np
import pytest
from hexafix import surfaces
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

RINGS = ("proximal", "distal")

angles = st.tuples(*3 * [st.floats(-180, 180)])
places = st.tuples(*3 * [st.floats(-900, 900)])


def in_ring(scene, ring, points):
    """LPS points in ring coordinates."""
    matrix = np.linalg.inv(scene.ring_pose(ring))
    return points @ matrix[:3, :3].T + matrix[:3, 3]


def outward_share(mesh, triangles):
    """Share of faces whose stored normals lie on the side that their corners' order says."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    normals = vtk_to_numpy(mesh.GetPointData().GetNormals())
    corners = vtk_to_numpy(mesh.GetPolys().GetConnectivityArray()).reshape(-1, 3)
    a, b, c = np.moveaxis(triangles(mesh), 1, 0)
    faces = np.cross(b - a, c - a)
    return np.mean(np.sum(faces * normals[corners].mean(1), axis=1) > 0)


@pytest.mark.parametrize("ring", RINGS)
def test_a_ring_has_its_hole_and_its_plate_ends_at_its_faces(a_scene, ring, triangles):
    points = in_ring(a_scene, ring, triangles(surfaces.ring_plate(a_scene, ring)).reshape(-1, 3))
    hardware = a_scene.ring(ring)
    across = np.hypot(*points[:, :2].T)
    assert across.min() > a_scene.inner_radius_mm(ring) - 0.2
    joint = hardware.joints_mm[0, 2]
    assert points[:, 2].max() == pytest.approx(max(0.0, joint, 3.0), abs=0.1)
    assert points[:, 2].min() == pytest.approx(min(-8.0, joint, -11.0), abs=0.1)


@pytest.mark.parametrize("ring", RINGS)
def test_only_the_front_mark_reaches_over_the_rim_and_it_lies_on_the_x_axis(
    a_scene, ring, triangles
):
    points = in_ring(a_scene, ring, triangles(surfaces.ring_plate(a_scene, ring)).reshape(-1, 3))
    radius = a_scene.ring(ring).outer_radius_mm
    over = points[np.hypot(*points[:, :2].T) > radius + 0.5]
    assert len(over)
    tip = over[np.argmax(over[:, 0])]
    np.testing.assert_allclose(tip, [radius + 14.0, 0.0, -4.0], atol=1e-3)
    assert np.all(over[:, 0] > radius - 1)
    assert np.abs(over[:, 1]).max() < 8


@pytest.mark.parametrize("ring", RINGS)
def test_a_boss_stands_under_each_joint_and_nowhere_else(a_scene, ring, triangles):
    points = in_ring(a_scene, ring, triangles(surfaces.ring_plate(a_scene, ring)).reshape(-1, 3))
    joints = a_scene.ring(ring).joints_mm
    outside = points[np.abs(points[:, 2] - joints[0, 2]) < 0.01]
    gaps = np.linalg.norm(outside[:, None] - joints[None], axis=-1)
    assert gaps.min(1).max() < 8.1
    assert set(gaps.argmin(1)) == set(range(6))


@given(angles, places)
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_all_shapes_are_turned_outwards_at_every_pose(
    make_scene, triangles, enclosed_mm3, turned, moved
):
    scene = make_scene(turned, moved)
    for ring in RINGS:
        plate = surfaces.ring_plate(scene, ring)
        # 72 sides: the plate's area is (72/2) sin(2π/72) (R² − r²); bosses and cone add to it.
        flat = 36 * np.sin(np.pi / 36) * (110**2 - scene.inner_radius_mm(ring) ** 2) * 8
        added = 6 * np.pi * 8**2 * 6 + np.pi * 7**2 * 14 / 3
        assert enclosed_mm3(plate) == pytest.approx(flat + added, rel=0.01)
        assert outward_share(plate, triangles) == 1.0
        assert enclosed_mm3(surfaces.joint_spheres(scene, ring)) == pytest.approx(
            6 * 4 / 3 * np.pi * 6**3, rel=0.03
        )
    for strut in surfaces.strut_tubes(scene):
        assert enclosed_mm3(strut) > 0
        assert outward_share(strut, triangles) == 1.0


def test_all_shapes_are_closed(a_scene, open_edges):
    shapes = [*surfaces.strut_tubes(a_scene), *surfaces.ball_spheres(a_scene).values()]
    shapes += [surfaces.ring_plate(a_scene, ring) for ring in RINGS]
    shapes += surfaces.axes(a_scene.distal_lps, length_mm=60.0)
    assert [open_edges(shape) for shape in shapes] == [0] * len(shapes)


def test_strut_k_runs_from_joint_k_to_joint_k(a_scene, triangles):
    """Its points' extent along its axis is the strut's length by the norm of Eq. 29."""
    struts = surfaces.strut_tubes(a_scene)
    assert len(struts) == 6
    a = a_scene.fixator.proximal.joints_mm @ a_scene.proximal_lps[:3, :3].T
    b = a_scene.fixator.distal.joints_mm @ a_scene.distal_lps[:3, :3].T
    gaps = a + a_scene.proximal_lps[:3, 3] - b - a_scene.distal_lps[:3, 3]
    for strut, gap, foot in zip(struts, gaps, b + a_scene.distal_lps[:3, 3], strict=True):
        length = np.linalg.norm(gap)
        points = triangles(strut).reshape(-1, 3) - foot
        along = points @ (gap / length)
        assert along.min() == pytest.approx(0.0, abs=1e-3)
        assert along.max() == pytest.approx(length, abs=1e-3)
        aside = np.linalg.norm(points - np.outer(along, gap / length), axis=1)
        assert aside.max() == pytest.approx(5.5, abs=1e-3)
        assert aside[along > 0.5 * length].max() == pytest.approx(3.4, abs=1e-3)


def test_each_ball_lies_at_its_centre_with_its_diameter(a_scene, triangles):
    meshes = surfaces.ball_spheres(a_scene)
    assert list(meshes) == [1, 2, 5]
    assert list(surfaces.ball_spheres(a_scene, "distal")) == [5]
    for ball in a_scene.balls:
        reach = np.linalg.norm(
            triangles(meshes[ball.number]).reshape(-1, 3) - ball.center_mm, axis=1
        )
        np.testing.assert_allclose(reach, ball.diameter_mm / 2, atol=1e-3)


def test_no_centre_gives_an_empty_mesh():
    assert surfaces.spheres([], diameters_mm=10.0).GetNumberOfCells() == 0


def test_the_axes_point_along_x_y_and_z_of_the_frame(a_scene, triangles):
    pose = a_scene.proximal_lps
    for column, arrow in enumerate(surfaces.axes(pose, length_mm=60.0)):
        points = triangles(arrow).reshape(-1, 3)
        tip = points[np.argmax((points - pose[:3, 3]) @ pose[:3, column])]
        np.testing.assert_allclose(tip, pose[:3, 3] + 60 * pose[:3, column], atol=1e-3)


def test_at_identity_poses_the_shapes_are_those_of_the_ring_frames(a_scene, triangles):
    local = dataclasses.replace(a_scene, proximal_lps=np.eye(4), distal_lps=np.eye(4))
    for ring in RINGS:
        placed = triangles(surfaces.ring_plate(a_scene, ring)).reshape(-1, 3)
        here = triangles(surfaces.ring_plate(local, ring)).reshape(-1, 3)
        there = in_ring(a_scene, ring, placed)
        # A boss's or a cone's facets may start anywhere about its axis; the plate's may not.
        radii = a_scene.inner_radius_mm(ring), a_scene.ring(ring).outer_radius_mm
        edges = []
        for points in (here, there):
            near = np.abs(np.hypot(*points[:, :2].T)[:, None] - radii).min(1) < 0.01
            edges.append(points[near & (np.abs(points[:, 2:] - [0.0, -8.0]).min(1) < 0.01)])
        assert len(edges[0]) > 400
        for some, others in (edges, edges[::-1]):
            gaps = np.linalg.norm(some[:, None] - others[None], axis=-1).min(1)
            assert gaps.max() < 1e-3


def test_the_colours_are_those_of_the_prescription():
    from hexafix.report.words import RING_COLOURS, STRUT_COLOURS

    for ring in RINGS:
        red, green, blue = (round(255 * part) for part in surfaces.ring_colour(ring))
        assert f"#{red:02x}{green:02x}{blue:02x}" == RING_COLOURS[ring]
    assert len({surfaces.strut_colour(k) for k in range(1, 7)}) == len(STRUT_COLOURS)
    for wrong in (0, 7):
        with pytest.raises(IndexError):
            surfaces.strut_colour(wrong)


def run(code):
    path = os.pathsep.join(p for p in sys.path if p)
    return subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": path},
    ).stdout


def test_vtk_is_loaded_at_the_first_shape_and_opengl_never():
    out = run(
        "import sys, hexafix.surfaces as s\n"
        "print('vtkmodules' in sys.modules)\n"
        "s.spheres([[1, 2, 3]], diameters_mm=4)\n"
        "print('vtkmodules' in sys.modules, 'vtkmodules.vtkRenderingOpenGL2' in sys.modules)\n"
    )
    assert out.split() == ["False", "True", "False"]


def test_without_vtk_the_error_names_what_to_install():
    out = run(
        "import sys\n"
        "sys.modules['vtkmodules'] = None\n"
        "import hexafix.surfaces as s\n"
        "from hexafix.errors import MissingLibrary\n"
        "try:\n"
        "    s.spheres([[1, 2, 3]], diameters_mm=4)\n"
        "except MissingLibrary as error:\n"
        "    print(error.faults[0].code, error.faults[0].next_step)\n"
    )
    assert out.startswith("library-missing")
    assert "hexafix[workstation]" in out
