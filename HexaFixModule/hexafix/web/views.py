"""The views of the scene as the side panel asks things of them: `panel.controls.ViewControls`."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

from hexafix.web.clicks import Clicks
from hexafix.web.layouts import FOUR, STYLE, grid, over_slice, over_space
from hexafix.web.window import WindowLevel

if TYPE_CHECKING:
    from hexafix.presenter import Presenter, Snapshot

REACH_MM = 3.0
"""A click farther than this outside a ball's edge does not mean it."""

SHOWN = {"bone": "Bone", "frame": "Frame", "balls": "Balls"}
"""Groups of `SceneLogic.set_shown` that the user can hide, and their names."""

ADD_HINT = "Click the middle of the ball in a slice to add it"
POINT_HINT = "Click the point in a slice"

ENCODING = {
    "rca_encoder": "jpeg",
    "target_fps": 30.0,
    "blur_fps": 15.0,
    "interactive_quality": 60,
}
"""How pictures travel: quick while something moves, better once it stands still."""


class Views:
    """Three slice views and one 3D view of the workstation's scene.

    Parameters
    ----------
    server : trame_server.Server
        Its state holds names that begin with ``views_``.
    app : trame_slicer.core.SlicerApp
        MRML scene and view manager.
    presenter : hexafix.presenter.Presenter
        Whose values are shown; a marker added by a click goes to it.
    sync : hexafix.mrml.sync.SceneSync
        Keeps scene and presenter together.

    Attributes
    ----------
    ball_clicked : callable
        Gets the index of a ball that was clicked in a view while no point was asked for.
    act : callable
        Does a piece of work and shows its error, if it has one.
    """

    def __init__(self, server: Any, app: Any, presenter: Presenter, sync: Any) -> None:
        from trame_slicer.core import LayoutManager

        self._state, self._app, self._presenter = server.state, app, presenter
        self._sync, self._logic = sync, sync.logic
        self.ball_clicked: Callable[[int], None] = lambda _: None
        self.act: Callable[[Callable[[], Any]], Any] = lambda work: work()
        self._picked: Callable[[Sequence[float]], None] | None = None
        self._placing = self._dragging_fragment = False
        self._volume: Any = None
        self._framed = 0
        self._state.update({"views_layout": FOUR, "views_hint": "", "views_loaded": False})
        self.window = WindowLevel(server)
        register_factories(app.view_manager, server)
        self._layouts = LayoutManager(app.scene, app.view_manager, server)
        self._layouts.register_layout_dict(grid())
        self._layouts.set_layout(FOUR)
        self._clicks = [
            Clicks(view, self._clicked, self._released) for view in app.view_manager.get_views()
        ]
        for view in app.view_manager.get_threed_views():
            prepare_space(view)

    def build(self, page: Any) -> None:
        """Put the views and the bar over them into the page at the place of the call."""
        from trame.widgets import client, html

        from hexafix.web.views_bar import build_bar

        client.Style(STYLE)
        whole = "flex: 1; min-height: 0; display: flex; position: relative;"
        with html.Div(
            style="display: flex; flex-direction: column; height: 100%; width: 100%;",
            raw_attrs=['data-testid="views"', 'aria-label="Views of CT and frame"'],
        ):
            build_bar(self, self._state)
            with html.Div(style=whole, classes=("views_hint ? 'hxv-aim' : ''",)):
                self._layouts.initialize_layout_grid(page)
                html.Div(
                    "{{ views_hint }}",
                    v_show="views_hint",
                    classes="hxv-hint",
                    raw_attrs=['role="status"'],
                )
                html.Div(
                    "No CT is loaded",
                    v_if="!views_loaded",
                    classes="hxv-note",
                    raw_attrs=["role=note"],
                )

    def set_layout(self, name: str) -> None:
        """Show one of `layouts.NAMES`."""
        self._layouts.set_layout(name)
        self._state.views_layout = name

    def update(self, snapshot: Snapshot) -> None:
        """Bring the views to the presenter's values; the scene is there already."""
        from hexafix.presenter import Step

        volume = self._presenter.value(Step.LOAD)
        if volume is not self._volume:
            self._volume = volume
            self._show_volume(volume)
        values = [self._presenter.value(step) for step in (Step.MARKERS, Step.POSES)]
        framed = len([value for value in values if value is not None])
        if framed > self._framed:
            self.reset_space()
        self._framed = framed

    def drag_window(self, on: bool) -> None:
        """While on, dragging in a slice changes window and level instead of nothing."""
        node = self._app.markups_logic.interaction_node
        node.SetCurrentInteractionMode(node.AdjustWindowLevel if on else node.ViewTransform)

    def show_only(self, groups: Sequence[str]) -> None:
        """Show these of `SHOWN` and hide the others."""
        for group in SHOWN:
            self._logic.set_shown(group, group in groups)

    def reset_space(self) -> None:
        """Show all of the 3D scene, from the front."""
        for view in self._app.view_manager.get_threed_views():
            view.reset_view()

    def select_ball(self, index: int | None) -> None:
        """Mark the ball (index into the found balls) in all views and bring the slices to it."""
        from hexafix.mrml.screen import jump_to

        center = self._logic.select_ball(index)
        if center is not None:
            for view in self._app.view_manager.get_slice_views():
                jump_to(view.get_view_node(), center)

    def place_marker(self, on: bool) -> None:
        """While on, every click in a slice view adds a marker there."""
        self._placing = on
        self._hint()

    def pick_point(self, picked: Callable[[Sequence[float]], None] | None) -> None:
        """Hand the next click's point (LPS, mm, three numbers) to `picked`; None ends it."""
        self._picked = picked
        self._hint()

    def drag_fragment(self, on: bool, moving: str = "") -> None:
        """Show or hide the handles that drag the bone fragment `moving`."""
        self._dragging_fragment = on
        self._sync.drag_fragment(on, moving=moving)

    def show_playback_row(self, row: int | None) -> None:
        """Move frame and bone to a row of the schedule; None: back to what the CT shows."""
        self._sync.show_playback_row(row)

    def show_landmarks(
        self, moving: Sequence[Sequence[float]], fixed: Sequence[Sequence[float]]
    ) -> None:
        """Show landmark points (LPS, mm, n rows of 3 each)."""
        self._logic.show_landmarks(moving, fixed)

    def take_scene(self) -> Any:
        """The scene as it is now, whose ``write(path, progress=…)`` any thread may call."""
        return self._sync.take_bundle()

    def close(self) -> None:
        """Let go of the render windows."""
        self.window.let_go()
        for view in self._app.view_manager.get_views():
            view.finalize()

    def _hint(self) -> None:
        hint = POINT_HINT if self._picked else ADD_HINT if self._placing else ""
        with self._state:
            self._state.views_hint = hint

    def _balls(self) -> Sequence[Any]:
        from hexafix.presenter import Step

        found = self._presenter.value(Step.MARKERS)
        return found.balls if found is not None else ()

    def _clicked(self, view: Any, x: int, y: int) -> None:
        """A point is asked for, a marker is placed, or a ball is meant: in that order."""
        from hexafix.mrml.screen import point_under

        in_slice = view in self._app.view_manager.get_slice_views()
        if self._picked is not None and in_slice:
            picked, self._picked = self._picked, None
            self._hint()
            picked(point_under(view.get_view_node(), x, y))
        elif self._placing and in_slice:
            point = point_under(view.get_view_node(), x, y)
            self.act(lambda: self._presenter.add_marker(point))
        elif self._picked is None and not self._placing:
            index = self._ball_under(view, x, y, in_slice)
            if index is not None:
                self.ball_clicked(index)

    def _released(self) -> None:
        """What the handles were dragged to becomes the case's correction once they are let go."""
        if self._dragging_fragment:
            # Later: the handles have not seen this event yet.
            asyncio.get_running_loop().call_soon(lambda: self.act(self._sync.commit_fragment))

    def _ball_under(self, view: Any, x: int, y: int, in_slice: bool) -> int | None:
        from hexafix.mrml.screen import nearest_in_slice, nearest_in_space

        balls = self._balls()
        centers = [ball.center_mm for ball in balls]
        if not balls:
            return None
        reach = REACH_MM + balls[0].diameter_mm / 2
        if in_slice:
            return nearest_in_slice(view.get_view_node(), x, y, centers, within_mm=reach)
        return nearest_in_space(view.first_renderer(), x, y, centers, within_mm=reach)

    def _show_volume(self, volume: Any) -> None:
        """The CT in all slice views, whole, at the suggested window; or none."""
        self.window.let_go()
        with self._state:
            self._state.views_loaded = volume is not None
        if volume is None:
            return
        node: Any = self._logic.volume_node()
        from hexafix.pipeline import image_document

        shown = image_document(volume)
        self.window.follow(
            node.GetDisplayNode(), window_hu=shown["window_hu"], level_hu=shown["level_hu"]
        )
        for view in self._app.view_manager.get_slice_views():
            view.set_background_volume_id(node.GetID())
            view.reset_view()


def register_factories(view_manager: Any, server: Any) -> None:
    """Views whose pictures go to the browser.

    trame-slicer's own draw a picture at every step of their making, some 250 in all, and smooth
    edges eight times over: with software rendering that is seconds and half the speed.
    """
    from trame_slicer.rca_view import RemoteViewFactory
    from trame_slicer.views import SliceView, ThreeDView, ViewType

    for kind, view_type, over in (
        (SliceView, ViewType.SLICE_VIEW, over_slice),
        (ThreeDView, ViewType.THREE_D_VIEW, over_space),
    ):
        view_manager.register_factory(
            RemoteViewFactory(
                server,
                partial(quiet_view, kind),
                view_type,
                populate_view_ui_f=over,
                **ENCODING,
            )
        )


def quiet_view(kind: Any, **given: Any) -> Any:
    """A view that draws nothing until its pictures are asked for."""
    from trame_slicer.views.render_scheduler import NoScheduleRendering

    view = kind(scheduled_render_strategy=NoScheduleRendering(), **given)
    view.render_window().SetMultiSamples(0)
    return view


def prepare_space(view: Any) -> None:
    """A cube with patient letters and no box about the scene.

    Depth peeling of the few see-through planes would make every picture three times as slow.
    """
    import slicer

    node: Any = slicer.vtkMRMLAbstractViewNode  # type: ignore[attr-defined]
    view.renderer().SetUseDepthPeeling(False)
    view.set_orientation_marker(node.OrientationMarkerTypeCube, node.OrientationMarkerSizeSmall)
    view.set_box_visible(False)
