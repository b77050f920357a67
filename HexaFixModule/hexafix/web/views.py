"""The views of the scene: layouts, window and level, picking a ball, placing one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot
    from hexafix.web.app import Workstation


class Views:
    """Three slice views and one 3D view of the workstation's scene."""

    def __init__(self, workstation: Workstation) -> None:
        from trame_slicer.core import LayoutManager
        from trame_slicer.rca_view import register_rca_factories

        self._workstation = workstation
        app = workstation.app
        register_rca_factories(app.view_manager, workstation.server)
        self._layouts = LayoutManager(app.scene, app.view_manager, workstation.server)
        self._layouts.register_layout_dict(LayoutManager.default_grid_configuration())
        self._layouts.set_layout("Quad View")

    def build(self, page: Any) -> None:
        """Put the views into the page at the place of the call."""
        self._layouts.initialize_layout_grid(page)

    def update(self, snapshot: Snapshot) -> None:
        """Bring the views to the presenter's values."""

    def select_ball(self, index: int | None) -> None:
        """Mark the ball (index into the found balls) in all views and bring the slices to it."""

    def place_marker(self, on: bool) -> None:
        """While on, the next click in a slice view adds a marker there."""

    def pick_point(self, picked: Callable[[Sequence[float]], None] | None) -> None:
        """Hand the next click's point (LPS, mm, three numbers) to `picked`; None ends it."""

    def drag_fragment(self, on: bool) -> None:
        """Show or hide the handles that drag the moving bone fragment."""

    def show_playback_row(self, row: int | None) -> None:
        """Move frame and bone to a row of the schedule; None: back to what the CT shows."""

    def show_landmarks(
        self, moving: Sequence[Sequence[float]], fixed: Sequence[Sequence[float]]
    ) -> None:
        """Show landmark points (LPS, mm, n rows of 3 each)."""

    def close(self) -> None:
        """Let go of the render windows."""
        for view in self._workstation.app.view_manager.get_views():
            view.finalize()
