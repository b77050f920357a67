import dataclasses
import struct
import subprocess
import sys

import numpy as np
import pytest
from hexafix.imaging.volume import Volume
from hexafix.report import pdf, picture
from hexafix.report.picture import SceneRenderer, draw_pictures, start_scene_render
from hexafix.report.scene import (
    ANATOMY,
    BoneSample,
    SceneGeometry,
    sample_bone,
    scene_views,
    view_from_above,
)


@pytest.fixture
def a_scene(a_plan):
    return SceneGeometry.from_document(a_plan)


@pytest.fixture
def a_bone(a_scene):
    """A cylinder of 700 HU about the distal ring's axis, on an oblique, coarse grid."""
    affine = np.eye(4)
    affine[:3, :3] = a_scene.distal_lps[:3, :3] @ np.diag([2.5, 2.5, 3.0])
    affine[:3, 3] = a_scene.distal_lps[:3, 3] - affine[:3, :3] @ [20, 20, 10]
    _, j, i = np.mgrid[:80, :41, :41]
    inside = np.hypot(i - 20, j - 20) < 6
    return BoneSample(np.where(inside, 700, -500).astype(np.int16), affine)


def _png_size(data):
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    return struct.unpack(">II", data[16:24])


def test_views_are_right_handed_and_look_from_where_they_say(a_scene):
    ap, lateral, oblique = scene_views(a_scene)
    for view in (ap, lateral, oblique, view_from_above(a_scene)):
        np.testing.assert_allclose(np.cross(view.right, view.up), view.toward, atol=1e-12)
    np.testing.assert_allclose(ap.toward, ANATOMY["front"])
    np.testing.assert_allclose(ap.right, ANATOMY["left"])
    np.testing.assert_allclose(lateral.toward, ANATOMY["left"])
    np.testing.assert_allclose(lateral.right, ANATOMY["back"])
    assert oblique.toward @ ANATOMY["head"] > 0


def test_the_lateral_view_of_a_right_limb_is_from_the_right(a_long_plan):
    _, lateral, _ = scene_views(SceneGeometry.from_document(a_long_plan))
    np.testing.assert_allclose(lateral.toward, ANATOMY["right"])
    np.testing.assert_allclose(lateral.right, ANATOMY["front"])


def test_words_stand_where_the_patient_directions_point(a_scene):
    ap, _, _ = scene_views(a_scene)
    words = ap.words()
    assert set(words) == {"left", "right", "head", "foot"}
    np.testing.assert_allclose(words["left"], [1, 0], atol=1e-12)
    np.testing.assert_allclose(words["head"], [0, -1], atol=1e-12)


def test_from_above_the_front_is_up_and_the_patient_left_is_left(a_scene):
    words = view_from_above(a_scene).words()
    assert words["front"][1] < -0.9
    assert words["left"][0] < -0.9


def test_projection_keeps_lengths_in_the_picture_plane(a_scene):
    rng = np.random.default_rng(4)
    for view in scene_views(a_scene):
        points = rng.uniform(-100, 100, (20, 3))
        flat = points - np.outer(points @ view.toward, view.toward)
        wanted = np.linalg.norm(np.diff(flat, axis=0), axis=1)
        got = np.linalg.norm(np.diff(view.project(points)[:, :2], axis=0), axis=1)
        np.testing.assert_allclose(got, wanted, atol=1e-9)


def test_every_ball_and_joint_lies_inside_every_view(a_scene):
    points = np.vstack([ball.center_mm for ball in a_scene.balls])
    joints = [a_scene.joints_mm(ring) for ring in ("proximal", "distal")]
    for view in scene_views(a_scene):
        places = view.project(np.vstack([points, *joints]))[:, :2]
        assert np.all(places > 10)
        assert np.all(places < [view.width_mm - 10, view.height_mm - 10])


def test_the_line_drawing_numbers_every_ball_and_strut_once_in_each_view(a_scene):
    pictures = draw_pictures(a_scene, why="asked for")
    assert pictures.kind == "drawn"
    assert "asked for" in pictures.note
    for view in pictures.views:
        numbers = [part.split("</text>")[0].split(">")[1] for part in view.svg.split("<text")[1:]]
        digits = sorted(word for word in numbers if word.isdigit())
        assert digits == sorted([*"123456", *"1234567"])


def test_vtk_renders_three_views_with_the_bone(a_scene, a_bone):
    pytest.importorskip("vtkmodules.vtkRenderingOpenGL2")
    scene = dataclasses.replace(a_scene, bone=a_bone)
    with start_scene_render(scene, time_limit_s=120.0) as renderer:
        pictures = renderer.result()
    assert pictures.kind == "rendered", pictures.note
    assert [view.name for view in pictures.views] == ["ap", "lateral", "oblique"]
    assert all("data:image/png;base64," in view.svg for view in pictures.views)


def _mirrored(sample):
    """The same bone on a left-handed grid."""
    flip = np.diag([-1.0, 1.0, 1.0, 1.0])
    flip[0, 3] = sample.hu.shape[2] - 1
    return BoneSample(np.ascontiguousarray(sample.hu[:, :, ::-1]), sample.ijk_to_lps @ flip)


@pytest.mark.parametrize("mirrored", [False, True], ids=["right-handed", "left-handed"])
def test_the_rendered_bone_and_balls_stand_where_the_view_projects_them(
    a_scene, a_bone, tmp_path, monkeypatch, mirrored
):
    pytest.importorskip("vtkmodules.vtkRenderingOpenGL2")
    image = pytest.importorskip("PIL.Image")
    scene = dataclasses.replace(a_scene, bone=_mirrored(a_bone) if mirrored else a_bone)
    shown = []
    monkeypatch.setattr(picture, "_picture", lambda view, _, png: shown.append((view, png)))
    start_scene_render(scene, time_limit_s=120.0).result()
    assert len(shown) == 3
    for view, png in shown:
        (tmp_path / "view.png").write_bytes(png)
        pixels = np.asarray(image.open(tmp_path / "view.png").convert("RGB"), float)
        scale = np.array(_png_size(png)) / [view.width_mm, view.height_mm]
        # Ball 4 sits 45 mm above its ring: nothing stands before it in any view.
        x, y = (view.project(scene.balls[3].center_mm)[:2] * scale).astype(int)
        # The middle of a ball may hold the highlight; most of it does not.
        ball = np.median(pixels[y - 7 : y + 8, x - 7 : x + 8].reshape(-1, 3), axis=0)
        assert np.ptp(ball) < 40, "a ball is grey"
        assert ball.max() < 245
        middle = scene.distal_lps @ [0, 0, 90, 1]
        x, y = (view.project(middle[:3])[:2] * scale).astype(int)
        red, _, blue = np.median(pixels[y - 4 : y + 5, x - 4 : x + 5].reshape(-1, 3), axis=0)
        assert red > blue + 15, "the bone is ivory"
        assert pixels[3, 3].min() > 250, "the corner is empty"


def test_without_opengl_the_lines_take_over_and_say_so(a_scene):
    renderer = start_scene_render(a_scene, opengl_windows=("vtkNoSuchRenderWindow",))
    pictures = renderer.result()
    assert pictures.kind == "drawn"
    assert "OpenGL" in pictures.note


def test_a_child_that_hangs_is_ended_and_the_lines_take_over(a_scene, monkeypatch, tmp_path):
    (tmp_path / "vtk_child.py").write_text("import time; time.sleep(600)")
    monkeypatch.setattr(picture, "CHILD_SCRIPT", tmp_path / "vtk_child.py")
    renderer = start_scene_render(a_scene, time_limit_s=0.5)
    child = renderer._child
    pictures = renderer.result()
    assert pictures.kind == "drawn"
    assert "too long" in pictures.note
    assert child is not None
    assert child.poll() is not None


def test_a_child_that_crashes_leaves_the_lines(a_scene, monkeypatch, tmp_path):
    (tmp_path / "vtk_child.py").write_text("import os; os.abort()")
    monkeypatch.setattr(picture, "CHILD_SCRIPT", tmp_path / "vtk_child.py")
    pictures = start_scene_render(a_scene).result()
    assert pictures.kind == "drawn"


def test_without_vtk_the_lines_say_so(a_scene, monkeypatch, tmp_path):
    code = "import sys; sys.exit(3)"
    (tmp_path / "vtk_child.py").write_text(code)
    monkeypatch.setattr(picture, "CHILD_SCRIPT", tmp_path / "vtk_child.py")
    assert "not installed" in start_scene_render(a_scene).result().note


def test_a_renderer_that_shows_nothing_leaves_no_process_and_no_files():
    renderer = SceneRenderer()
    child, folder = renderer._child, renderer._folder.name
    renderer.close()
    renderer.close()
    assert child is None or child.poll() is not None
    assert not picture.Path(folder).exists()


def test_the_report_loads_neither_vtk_nor_matplotlib_nor_typst_before_use():
    code = (
        "import sys, hexafix.report.pdf, hexafix.report.tables, hexafix.report.printed;"
        "print([n for n in ('vtkmodules', 'vtk', 'matplotlib', 'typst') if n in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_pdf_says_which_kind_of_picture_it_holds(a_plan, a_scene):
    content = pdf.prescription_content(a_plan, pictures=draw_pictures(a_scene, why="no OpenGL"))
    assert content["pictures"]["note"].startswith("Line drawing")
    assert content["pictures"]["note"].endswith("no OpenGL.")


def test_the_bone_sample_keeps_its_place_and_leaves_the_rings_out(a_scene):
    affine = np.eye(4)
    affine[:3, :3] = np.array([[0.9, 0.1, 0], [-0.1, 0.9, 0.05], [0, -0.05, 1.0]]) * 0.8
    middle = (a_scene.distal_lps[:3, 3] + a_scene.joints_mm("distal")[0]) / 2
    affine[:3, 3] = middle - affine[:3, :3] @ [90, 90, 90]
    k, j, i = np.mgrid[:180, :180, :180].astype(np.int16)
    volume = Volume((i + 2 * j + 3 * k).astype(np.int16), affine)
    sample = sample_bone(volume, a_scene)
    inside = np.argwhere(sample.hu > -1024)
    assert 50_000 < len(inside) < sample.hu.size
    assert sample.hu.size < volume.voxels.size / 7, "the copy is coarse"
    places = inside[:, ::-1] @ sample.ijk_to_lps[:3, :3].T + sample.ijk_to_lps[:3, 3]
    wanted = volume.ijk_from_lps(places) @ [1, 2, 3]
    np.testing.assert_allclose(sample.hu[tuple(inside.T)], wanted, atol=1e-6)
    for ring in ("proximal", "distal"):
        for joint in a_scene.joints_mm(ring):
            assert np.linalg.norm(places - joint, axis=1).min() > 8.0
