"""The workstation of one user: server, scene, presenter and page put together."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.web.views import Views

if TYPE_CHECKING:
    from hexafix.presenter import Presenter, Snapshot

TITLE = "HexaFix"


class Workstation:
    """What the browser shows and what it asks for.

    Built inside the running event loop, which is its only thread; the presenter's own threads
    come back by `post`.

    Parameters
    ----------
    presenter : Presenter or None
        None: a new one, with an empty case.
    server : trame_server.Server or None
        None: a new one of its own.

    Attributes
    ----------
    server, state, ctrl
        Trame's server, its shared state and its controller.
    app : trame_slicer.core.SlicerApp
        MRML scene, application logic and view manager.
    presenter : hexafix.presenter.Presenter
        The case, its steps and results.
    logic : hexafix.mrml.logic.SceneLogic
        The scene's own logic.
    sync : hexafix.mrml.sync.SceneSync
        Brings the scene to the presenter's values and drags back to the presenter.
    views : hexafix.web.views.Views
        The four views, their layouts, window and level, picking and placing.
    panel : hexafix.web.panel.Panel
        The side panel; it asks things of `views` and is told what changed.
    """

    def __init__(self, *, presenter: Presenter | None = None, server: Any = None) -> None:
        from trame.app import get_server
        from trame_slicer import module as trame_slicer_module
        from trame_slicer.core import SlicerApp

        from hexafix.mrml.logic import SceneLogic
        from hexafix.mrml.sync import SceneSync
        from hexafix.presenter import Presenter
        from hexafix.web.panel import Panel

        self._loop = asyncio.get_running_loop()
        self.server = server or get_server(f"hexafix-{id(self)}", client_type="vue3")
        self.server.enable_module(trame_slicer_module)
        self.state, self.ctrl = self.server.state, self.server.controller
        self.app = SlicerApp()
        self.presenter = presenter or Presenter(post=self.post)
        self.logic = SceneLogic(self.app.scene, app_logic=self.app.app_logic)
        self.sync = SceneSync(self.logic, self.presenter)
        self.state.trame__title = TITLE
        self.views = Views(self.server, self.app, self.presenter, self.logic)
        self.panel = Panel(self.server, self.presenter, self.views)
        self.views.ball_clicked = self.panel.ball_clicked
        self.views.act = self.panel.act
        self._build_page()
        self.presenter.changed.connect(self._show)
        self._show(self.presenter.snapshot)

    def post(self, call: Callable[[], Any]) -> None:
        """Run `call` on the event loop; any thread may ask."""
        self._loop.call_soon_threadsafe(call)

    def open_case(self, path: Path) -> None:
        """Open a case file; its image is read off the event loop, with progress in the page."""
        from hexafix.presenter import Step

        self.presenter.open_case(path)
        self.presenter.run(Step.LOAD)

    def close(self) -> None:
        """Stop the presenter's work and let go of the scene."""
        self.presenter.changed.disconnect(self._show)
        self.panel.close()
        self.presenter.close()
        self.views.close()

    def _show(self, snapshot: Snapshot) -> None:
        self.sync.update(snapshot)
        self.views.update(snapshot)
        self.panel.update(snapshot)

    def _build_page(self) -> None:
        from trame.ui.vuetify3 import VAppLayout
        from trame.widgets import html
        from trame.widgets import vuetify3 as v3

        with VAppLayout(self.server, theme="dark") as self.ui:
            with v3.VAppBar(density="compact"):
                self.panel.toolbar()
            with v3.VNavigationDrawer(permanent=True, width=470, location="left"):
                self.panel.drawer()
            with (
                v3.VMain(style="height: 100vh;"),
                html.Div(style="height: 100%; width: 100%; display: flex; flex-direction: column;"),
            ):
                self.views.build(self.ui)
            with v3.VFooter(app=True, classes="pa-0"):
                self.panel.playback()
            self.panel.dialogs()
