"""The workstation of one user: server, scene, presenter and page put together."""

from __future__ import annotations

import asyncio
import os
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.web.ahead import link_libraries
from hexafix.web.views import Views

if TYPE_CHECKING:
    from hexafix.presenter import Presenter, Snapshot
    from hexafix.web.starting import FirstPicture

TITLE = "HexaFix"

BEFORE_VTK = (
    *("hexafix.pipeline", "hexafix.web.panel", "trame.app", "trame.ui.vuetify3"),
    *("trame.widgets.vuetify3", "trame_rca.encoders", "pydicom"),
)
"""What a workstation imports that does not import VTK; trame_slicer needs pydicom."""


def start_workstation(case: Path | None, *, first: FirstPicture | None = None) -> Workstation:
    """A workstation as fast as it can be had: what can go side by side does.

    The CT is read on a thread of its own; what is done meanwhile leaves it the interpreter's lock.

    Parameters
    ----------
    case : Path or None
        Case file, or scene, to open.
    first : FirstPicture or None
        Is told where the CT is to be had.
    """
    from hexafix.presenter import Step

    presenter = started_presenter()
    if first is not None:
        first.volume = lambda: presenter.value(Step.LOAD)
    try:
        if case is not None and presenter.open_case(case):
            presenter.run(Step.LOAD)
        for name in BEFORE_VTK:
            import_module(name)
        link_libraries()
        return Workstation(presenter=presenter)
    except BaseException:
        presenter.close()
        raise


def started_presenter() -> Presenter:
    """A presenter whose threads come back to the running event loop."""
    # Here, and not on the presenter's thread when a scene is opened: two threads that import parts
    # of one package at the same time can fail.
    from hexafix.mrml.scene_file import read_scene
    from hexafix.presenter import Presenter

    post = asyncio.get_running_loop().call_soon_threadsafe
    return Presenter(post=post, read_scene=read_scene)


def quiet_vtk() -> None:
    """Keep VTK's own words off the terminal: they can quote paths (H51)."""
    from vtkmodules.vtkCommonCore import vtkObject

    if not os.environ.get("HEXAFIX_DEBUG"):
        vtkObject.GlobalWarningDisplayOff()


@contextmanager
def rendered_once() -> Iterator[None]:
    """Let trame render the page when it is whole.

    It renders a container with all that is in it whenever its ``with`` ends, each widget some ten
    times over: most of a second for our page.
    """
    from trame_client.widgets.core import HTML_CTX, AbstractElement

    def leave(element: Any, *_: Any) -> None:
        HTML_CTX.exit(element)

    own = AbstractElement.__exit__
    AbstractElement.__exit__ = leave  # type: ignore[method-assign]
    try:
        yield
    finally:
        AbstractElement.__exit__ = own


class Workstation:
    """What the browser shows and what it asks for.

    Built inside the running event loop, which is its only thread.

    Parameters
    ----------
    presenter : Presenter or None
        Of `started_presenter`; None: a new one, with an empty case.
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
        from hexafix.web.panel import Panel

        self.server: Any = server or get_server(f"hexafix-{id(self)}", client_type="vue3")
        self.server.enable_module(trame_slicer_module)
        self.state, self.ctrl = self.server.state, self.server.controller
        quiet_vtk()
        self.app = SlicerApp()
        self.presenter = presenter or started_presenter()
        self.logic = SceneLogic(self.app.scene, app_logic=self.app.app_logic)
        self.sync = SceneSync(self.logic, self.presenter)
        self.state.trame__title = TITLE
        self.views = Views(self.server, self.app, self.presenter, self.sync)
        self.panel = Panel(self.server, self.presenter, self.views)
        self.views.ball_clicked = self.panel.ball_clicked
        self.views.act = self.panel.act
        self._build_page()
        self.presenter.changed.connect(self._show)
        self._show(self.presenter.snapshot)

    def close(self) -> None:
        """Stop the presenter's work and let go of the scene."""
        self.presenter.changed.disconnect(self._show)
        self.panel.close()
        self.presenter.close()
        self.sync.close()
        self.views.close()

    def _show(self, snapshot: Snapshot) -> None:
        try:
            self.sync.update(snapshot)
            self.views.update(snapshot)
        finally:
            # what is stale and what blocks the export is told even where the scene fails
            self.panel.update(snapshot)

    def _build_page(self) -> None:
        from trame.ui.vuetify3 import VAppLayout
        from trame.widgets import html
        from trame.widgets import vuetify3 as v3

        with rendered_once(), VAppLayout(self.server, theme="dark") as self.ui:
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
