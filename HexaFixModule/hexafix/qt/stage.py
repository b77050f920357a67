"""The four views together: what they show of the presenter, and what a click in them does."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

from hexafix.panel import Panel
from hexafix.presenter import Presenter, Snapshot, Step
from hexafix.qt.kit import kit
from hexafix.qt.shown import (
    Outline,
    frame_meshes,
    labels_of,
    rejected,
    ring_outlines,
    scene_of_case,
    shown_balls,
)
from hexafix.qt.slice_view import SlicePane
from hexafix.qt.view3d import View3D
from hexafix.surfaces import (
    BONE_COLOUR,
    SLICE_VIEWS,
    STALE_COLOUR,
    ball_at,
    balls_middle_mm,
    bone_surface,
    middle_mm,
    slice_image,
)

TARGET_COLOUR = (0.15, 0.65, 0.35)
"""The moving fragment where the correction takes it."""

WINDOWS = (("Bone and metal", None), ("Bone", (2000.0, 500.0)), ("Soft tissue", (400.0, 40.0)))
"""Grey windows: name, and window and level in HU; the first is the image's own."""

Point = tuple[float, float, float]


class Stage:
    """The views of the workstation.

    Parameters
    ----------
    panel : Panel
    presenter : Presenter
    post : callable
        Runs a callable on the window's thread.
    """

    def __init__(
        self, panel: Panel, presenter: Presenter, post: Callable[[Callable[[], Any]], Any]
    ) -> None:
        from vtkmodules.vtkRenderingCore import vtkImageProperty

        self.panel, self.presenter, self._post = panel, presenter, post
        self._seen: dict[str, Any] = {}
        self._scene: Any = None
        self._frame: dict[str, Outline] = {}
        self._bones: dict[str, Outline] = {}
        self._balls: Any = None
        self._rejected: Outline | None = None
        self._ball_meshes: dict[str, Outline] = {}
        self._derived: dict[Any, Outline] = {}
        self._row: int | None = None
        self.point: Point = (0.0, 0.0, 0.0)
        self._worker = ThreadPoolExecutor(1, thread_name_prefix="hexafix-surface")
        self._cutting: Future[None] | None = None
        self._closed = False
        self.grey = vtkImageProperty()
        self.grey.SetInterpolationTypeToLinear()
        self.view3d = View3D(ball_clicked=self._clicked_name, dragged=self._dragged)
        self.slices = tuple(
            SlicePane(view, clicked=self.clicked, shared=self.grey, regrey=self.render_slices)
            for view in SLICE_VIEWS
        )
        panel.ball_chosen.connect(self.show_ball)
        panel.playback_moved.connect(self.show_row)
        panel.dragging_changed.connect(self._drag)
        self.widget = self._four_up()

    def _four_up(self) -> Any:
        q = kit()
        upper, lower, whole = (
            q.QSplitter(q.Qt.Horizontal),
            q.QSplitter(q.Qt.Horizontal),
            q.QSplitter(q.Qt.Vertical),
        )
        axial, coronal, sagittal = (pane.frame for pane in self.slices)
        for splitter, widgets in (
            (upper, (self.view3d.frame, axial)),
            (lower, (coronal, sagittal)),
            (whole, (upper, lower)),
        ):
            for place, widget in enumerate(widgets):
                splitter.addWidget(widget)
                splitter.setStretchFactor(place, 1)
            splitter.setSizes([1000, 1000])
            splitter.setChildrenCollapsible(False)
        whole.setObjectName("fourUpViews")
        return whole

    # ------------------------------------------------------------ following the presenter

    def _new(self, what: str, *values: Any) -> bool:
        """Whether these values, by identity or as plain words, are others than last time."""
        before = self._seen.get(what)
        same = before is not None and all(
            old is new or (isinstance(new, bool | str | int) and old == new)
            for old, new in zip(before, values, strict=True)
        )
        self._seen[what] = values
        return not same

    def update(self, snapshot: Snapshot) -> None:
        """Bring the views to the presenter's values; touches only what has changed."""
        if self._closed:
            return
        changed = self._volume(snapshot)
        changed |= self._found(snapshot)
        changed |= self._poses(snapshot)
        changed |= self._target(snapshot)
        if changed:
            self._draw()

    def _volume(self, snapshot: Snapshot) -> bool:
        volume = self.presenter.value(Step.LOAD)
        if not self._new("volume", volume):
            return False
        if volume is None:
            for pane in self.slices:
                pane.clear()
            return True
        image, matrix = slice_image(volume)
        self.set_window(0)
        self.point = middle_mm(volume)
        for pane in self.slices:
            pane.show_volume(volume, image, matrix)
            pane.go_to(self.point)
            pane.fit()
        return True

    def set_window(self, choice: int) -> None:
        """Choose one of `WINDOWS`."""
        from hexafix.pipeline import image_document

        values = WINDOWS[choice][1]
        volume = self.presenter.value(Step.LOAD)
        if values is None and volume is not None:
            if self._new("grey", volume):
                document = image_document(volume)
                self._own_grey = (float(document["window_hu"]), float(document["level_hu"]))
            values = self._own_grey
        if values is not None:
            self.grey.SetColorWindow(values[0])
            self.grey.SetColorLevel(values[1])
            self.render_slices()

    def _found(self, snapshot: Snapshot) -> bool:
        table = snapshot.tables.get("balls")
        numbers = "" if table is None else repr((table.rows, table.stale))
        value = self.presenter.value(Step.MARKERS)
        fresh_image = self._new("found", value)
        if not self._new("balls", value, numbers):
            return False
        self._balls = shown_balls(self.presenter, snapshot)
        self._rejected = rejected(self.presenter)
        if self._balls is not None and fresh_image:
            middle = balls_middle_mm(self._balls.centers_mm)
            if middle is not None:
                self._go(middle)
        return True

    def _poses(self, snapshot: Snapshot) -> bool:
        recognised = self.presenter.value(Step.POSES)
        stale = not self.presenter.is_fresh(Step.POSES)
        if not self._new("poses", recognised, stale):
            return False
        if recognised is None:
            self._scene, self._frame, self._bones = None, {}, {}
        else:
            self._scene = self._scene if stale else scene_of_case(self.presenter) or self._scene
            self._frame = (
                {} if self._scene is None else dict(frame_meshes(self._scene, stale=stale))
            )
            self._row = None
            if self._new("bones", recognised, self.presenter.split_fraction == 0.5):
                self._bones = {}
                self._make_bones(recognised, self.presenter.split_fraction)
        return True

    def _make_bones(self, recognised: Any, fraction: float) -> None:
        """Cut the bone's surface beside the window's thread."""
        from hexafix.pipeline import bone_fragments

        def work() -> None:
            samples = bone_fragments(recognised, split_fraction=fraction)
            made = {
                f"bone-{ring}": Outline(bone_surface(sample), BONE_COLOUR)
                for ring, sample in samples.items()
            }
            if not self._closed:
                self._post(lambda: self._bones_made(recognised, made))

        self._cutting = self._worker.submit(work)

    @property
    def working(self) -> bool:
        """Whether the bone's surface is being cut."""
        return self._cutting is not None and not self._cutting.done()

    def _bones_made(self, recognised: Any, made: dict[str, Outline]) -> None:
        if not self._closed and self.presenter.value(Step.POSES) is recognised:
            self._bones = made
            self._derived.clear()
            self.view3d.refit()
            self._draw()

    def _target(self, snapshot: Snapshot) -> bool:
        preview = self.presenter.value(Step.CORRECTION)
        return self._new(
            "target", preview, self.presenter.is_fresh(Step.CORRECTION), snapshot.current.value
        )

    # ------------------------------------------------------------ drawing

    def _draw(self) -> None:
        """Show the frame as the CT has it, or as the row of the playback has it."""
        meshes: dict[str, Outline] = {}
        labels: list[tuple[str, Point]] = []
        row = self._played()
        stale = not self.presenter.is_fresh(Step.POSES)
        if row is not None:
            from hexafix.pipeline import scene_at

            scene = scene_at(self._scene, row, self._moving())
            meshes |= frame_meshes(scene, stale=not self.presenter.is_fresh(Step.SCHEDULE))
            labels += labels_of(scene)
        elif self._scene is not None:
            meshes |= self._frame
            labels += labels_of(self._scene)
        elif self._balls is not None:
            meshes["balls"] = self._outline(self._balls.mesh, self._balls.colour)
            labels += zip(self._balls.labels, self._balls.centers_mm, strict=True)
        current = self.presenter.snapshot.current
        if self._rejected is not None and current == Step.MARKERS:
            meshes["rejected"] = self._rejected
        for name, bone in self._bones.items():
            meshes[name] = self._outline(bone.mesh, STALE_COLOUR) if stale else bone
        motion = self._target_motion() if row is None else None
        if motion is not None:
            ghost = self._bones.get(f"bone-{motion[1]}")
            if ghost is not None:
                meshes["target"] = self._outline(ghost.mesh, TARGET_COLOUR, 0.45)
        self.view3d.show(meshes)
        for name in self._bones:
            moved = row is not None and name == f"bone-{self._moving()}"
            self.view3d.move(name, row.fragment_lps if moved and row else None)
        if motion is not None:
            self.view3d.move("target", motion[0])
        self.view3d.write(labels)
        self._drag(self.panel.dragging)
        self._title(row)
        for pane in self.slices:
            pane.show_balls(self._balls)
            pane.show_outlines(ring_outlines(self._frame))
            pane.go_to(self.point)
        self.render()

    def _outline(self, mesh: Any, colour: Any, opacity: float = 1.0) -> Outline:
        """The same outline for the same mesh, so that the view keeps its actor."""
        key = (id(mesh), colour, opacity)
        kept = self._derived.get(key)
        if kept is None or kept.mesh is not mesh:
            kept = self._derived[key] = Outline(mesh, colour, opacity)
        return kept

    def _title(self, row: Any) -> None:
        text = "as the CT shows it"
        if row is not None:
            text = f"day {row.day}, {row.date.isoformat()}, adjustment {row.adjustment}"
        if self._scene is not None and not self.presenter.is_fresh(Step.POSES):
            text += " – out of date"
        self.view3d.title.setText(f"<b>Frame</b> {text}")

    def _target_motion(self) -> tuple[Any, str] | None:
        preview = self.presenter.value(Step.CORRECTION)
        shown = (Step.CORRECTION, Step.SCHEDULE)
        if preview is None or self.presenter.snapshot.current not in shown:
            return None
        # What is asked for, not what the frame makes of it: the user drags this very motion.
        asked = preview.get("asked_lps") or preview.get("fragment_lps")
        if asked is None or not self.presenter.is_fresh(Step.CORRECTION):
            return None
        return asked, str(preview["moving"])

    def render(self) -> None:
        """Draw all views now."""
        self.view3d.render()
        self.render_slices()

    def render_slices(self) -> None:
        """Draw the slices now."""
        for pane in self.slices:
            pane.render()

    # ------------------------------------------------------------ playback, dragging, clicks

    def _played(self) -> Any:
        """The row shown, on the page of the schedule once the user has moved there."""
        playback = self.presenter.playback() if self._row is not None else None
        on_page = self.presenter.snapshot.current == Step.SCHEDULE
        if self._row is None or playback is None or self._scene is None or not on_page:
            return None
        return playback.rows[min(self._row, len(playback.rows) - 1)]

    def _moving(self) -> str:
        return str(self.presenter.playback().moving)

    def show_row(self, row: int) -> None:
        """Show the frame after a row of the schedule."""
        self._row = row
        self._draw()

    def _drag(self, on: bool) -> None:
        wanted = on and self.presenter.snapshot.current == Step.CORRECTION
        ghost = (
            "target" if "target" in self.view3d.names else f"bone-{self.panel.moving_fragment()}"
        )
        self.view3d.drag(ghost if wanted else None)

    def _dragged(self, matrix_lps: list[list[float]]) -> None:
        # Later: the handles are still at work, and what follows takes them away.
        self._post(lambda: self.panel.dragged(matrix_lps))

    def show_ball(self, index: int) -> None:
        """Go to a ball in all slices."""
        if self._balls is not None and 0 <= index < len(self._balls.centers_mm):
            self._go(self._balls.centers_mm[index])
            self.render_slices()

    def _go(self, point: Point) -> None:
        self.point = point
        for pane in self.slices:
            pane.go_to(point)

    def clicked(self, point: Point) -> None:
        """A click in a slice: go there, and act on the ball there."""
        ball = None
        if self._balls is not None:
            ball = ball_at(self._balls.centers_mm, point_mm=point, reach_mm=self._balls.diameter_mm)
        self._go(point)
        self.render_slices()
        self.panel.clicked(point, ball)

    def _clicked_name(self, name: str) -> None:
        number = name.removeprefix("ball-")
        if self._balls is not None and number in self._balls.labels:
            index = self._balls.labels.index(number)
            point = self._balls.centers_mm[index]
            self._go(point)
            self.render_slices()
            self.panel.clicked(point, index)

    def close(self) -> None:
        """End the work beside the window and free the views."""
        self._closed = True
        self._worker.shutdown(wait=True, cancel_futures=True)
        self.view3d.close()
        for pane in self.slices:
            pane.close()
