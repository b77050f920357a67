"""The numbered pictures of the scene: rendered in a child process, or drawn by lines."""

from __future__ import annotations

from dataclasses import dataclass

from hexafix.report.overlay import draw_labels, draw_scene
from hexafix.report.scene import SceneGeometry, View, scene_views
from hexafix.report.svg import Canvas


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
