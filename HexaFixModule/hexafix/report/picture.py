"""The numbered pictures of the scene: rendered in a child process, or drawn by lines."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from hexafix.report.overlay import draw_labels, draw_scene
from hexafix.report.scene import SceneGeometry, View, scene_views
from hexafix.report.svg import Canvas
from hexafix.report.vtk_child import EXIT_BLANK, EXIT_NO_VTK, EXIT_NO_WINDOW
from hexafix.report.words import RING_COLOURS, STRUT_COLOURS

TIME_LIMIT_S = 30.0
"""Wall clock that the child may take before it is ended."""

PIXELS_PER_MM = 2.4
"""Pixels for a millimetre of the patient: about 250 to the inch on the page."""

OPENGL_WINDOWS: tuple[str | None, ...] = (
    ("vtkOSOpenGLRenderWindow", "vtkEGLRenderWindow") if sys.platform == "linux" else (None,)
)
"""Offscreen windows of VTK, tried in this order; None leaves the choice to VTK."""

CHILD_SCRIPT = Path(__file__).with_name("vtk_child.py")

REASONS = {
    EXIT_NO_VTK: "VTK is not installed",
    EXIT_NO_WINDOW: "VTK has no offscreen OpenGL here",
    EXIT_BLANK: "OpenGL gave an empty picture",
}


@dataclass(frozen=True, slots=True)
class ScenePicture:
    """One view, ready for the page.

    Attributes
    ----------
    name, title : str
    svg : str
    width_mm, height_mm : float
        Size of the shown window in the patient, mm.
    """

    name: str
    title: str
    svg: str
    width_mm: float
    height_mm: float


@dataclass(frozen=True, slots=True)
class ScenePictures:
    """The views of one scene.

    Attributes
    ----------
    views : tuple of ScenePicture
        AP, lateral, oblique.
    kind : str
        ``rendered`` (VTK) or ``drawn`` (lines).
    note : str
        How the pictures were made and what they lack; printed below them.
    """

    views: tuple[ScenePicture, ...]
    kind: str
    note: str


def _picture(view: View, scene: SceneGeometry, png: bytes | None) -> ScenePicture:
    canvas = Canvas(view.width_mm, view.height_mm)
    if png is None:
        draw_scene(canvas, view, scene)
    else:
        canvas.image(png)
    draw_labels(canvas, view, scene)
    return ScenePicture(view.name, view.title, canvas.svg(), view.width_mm, view.height_mm)


def draw_pictures(scene: SceneGeometry, *, why: str) -> ScenePictures:
    """The pictures drawn by lines; `why` there is no rendered picture stands in the note."""
    views = tuple(_picture(view, scene, None) for view in scene_views(scene))
    note = f"Line drawing of rings, struts and balls, without the bone: {why}."
    return ScenePictures(views, "drawn", note)


class SceneRenderer:
    """A child process that renders one scene while the program goes on.

    Start it early: it loads VTK while the volume is read. Then `show` the scene, and ask for the
    `result` when the page is set. Every way in which the child can fail ends in the line drawing.

    Parameters
    ----------
    time_limit_s : float
        From `show` on; then the child is ended.
    opengl_windows : sequence of str or None
        VTK's offscreen windows to try.
    """

    def __init__(
        self,
        *,
        time_limit_s: float = TIME_LIMIT_S,
        opengl_windows: Sequence[str | None] = OPENGL_WINDOWS,
    ) -> None:
        self._time_limit_s = time_limit_s
        self._windows = list(opengl_windows)
        self._folder = tempfile.TemporaryDirectory(prefix="hexafix-picture-")
        self._scene: SceneGeometry | None = None
        self._deadline = float("inf")
        self._child = self._start()

    def _start(self) -> subprocess.Popen[str] | None:
        """The child with the next window, or None if none is left or it cannot start."""
        if not self._windows:
            return None
        environment = dict(os.environ)
        environment.pop("VTK_DEFAULT_OPENGL_WINDOW", None)
        window = self._windows.pop(0)
        if window is not None:
            environment["VTK_DEFAULT_OPENGL_WINDOW"] = window
        try:
            return subprocess.Popen(
                [sys.executable, "-P", str(CHILD_SCRIPT)],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.DEVNULL,
                env=environment,
                text=True,
            )
        except OSError:
            return None

    def show(self, scene: SceneGeometry) -> None:
        """Hand the scene over; rendering begins."""
        self._scene = scene
        self._deadline = time.monotonic() + self._time_limit_s
        np.savez(Path(self._folder.name) / "scene.npz", **_arrays(scene))
        self._send()

    def _send(self) -> None:
        if self._child is None or self._child.stdin is None:
            return
        try:
            self._child.stdin.write(self._folder.name + "\n")
            self._child.stdin.close()
        except OSError:
            # The child has ended already; `result` reads its exit code.
            self._child.stdin = None

    def result(self) -> ScenePictures:
        """The pictures; waits for the child, at most to its time limit."""
        if self._scene is None:
            raise RuntimeError("show() a scene before asking for its pictures")
        scene, why = self._scene, "no child process could be started"
        try:
            while self._child is not None:
                code = self._wait()
                if code == 0:
                    return self._rendered(scene)
                why = _reason(code)
                if code in (None, EXIT_NO_VTK):
                    break
                self._child = self._start()
                self._send()
        finally:
            self.close()
        return draw_pictures(scene, why=why)

    def _wait(self) -> int | None:
        assert self._child is not None
        try:
            return self._child.wait(max(0.05, self._deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            return None

    def _rendered(self, scene: SceneGeometry) -> ScenePictures:
        folder = Path(self._folder.name)
        views = tuple(
            _picture(view, scene, (folder / f"view-{n}.png").read_bytes())
            for n, view in enumerate(scene_views(scene))
        )
        bone = "bone surface" if scene.bone is not None else "no bone"
        note = f"Rendered by VTK at the recognised poses, {bone}; the bone is a coarse surface."
        return ScenePictures(views, "rendered", note)

    def close(self) -> None:
        """End the child and remove its files; safe to call twice."""
        child, self._child = self._child, None
        if child is not None:
            if child.poll() is None:
                child.kill()
            child.wait()
            if child.stdin is not None and not child.stdin.closed:
                child.stdin.close()
        self._folder.cleanup()

    def __enter__(self) -> SceneRenderer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def start_scene_render(
    scene: SceneGeometry,
    *,
    time_limit_s: float = TIME_LIMIT_S,
    opengl_windows: Sequence[str | None] = OPENGL_WINDOWS,
) -> SceneRenderer:
    """Start rendering `scene`; the answer's `result()` waits for the pictures."""
    renderer = SceneRenderer(time_limit_s=time_limit_s, opengl_windows=opengl_windows)
    renderer.show(scene)
    return renderer


def _reason(code: int | None) -> str:
    if code is None:
        return "rendering took too long"
    return REASONS.get(code, "VTK's OpenGL failed")


def _rgb(colour: str) -> list[float]:
    return [int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)]


def _arrays(scene: SceneGeometry) -> dict[str, Any]:
    """The scene as plain arrays in LPS mm for the child."""
    plates = [scene.plate_mm(ring) for ring in ("proximal", "distal")]
    joints = [scene.joints_mm(ring) for ring in ("proximal", "distal")]
    views = scene_views(scene)
    sizes = np.array([[view.width_mm, view.height_mm] for view in views])
    bone = scene.bone
    return {
        "plates": np.array(plates),
        "plate_colors": np.array([_rgb(RING_COLOURS[ring]) for ring in ("proximal", "distal")]),
        "struts": np.stack(joints, axis=1),
        "strut_colors": np.array([_rgb(colour.fill) for colour in STRUT_COLOURS]),
        "balls": np.array([ball.center_mm for ball in scene.balls]).reshape(-1, 3),
        "ball_diameters": np.array([ball.diameter_mm for ball in scene.balls]),
        "bone": np.zeros((0, 0, 0), np.int16) if bone is None else bone.hu,
        "bone_affine": np.eye(4) if bone is None else bone.ijk_to_lps,
        "view_axes": np.array([[w.right, w.up, w.toward, w.center_mm] for w in views]),
        "view_sizes": sizes,
        "view_pixels": np.round(sizes * PIXELS_PER_MM).astype(int),
    }
