"""The scene as a file for 3D Slicer: where to, whether to replace, saved or why not."""

from __future__ import annotations

import asyncio
import os
import threading
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from hexafix.errors import Cancelled, HexaFixError
from hexafix.progress import Progress
from hexafix.web.files import SCENE_SUFFIXES
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.controls import TakenScene
from hexafix.web.panel.widgets import button, icon_button, marked

PROPOSED = f"scene{SCENE_SUFFIXES[0]}"

SHOWN_S = 0.1
"""Time for the browser to say that the scene is being saved: MRML's nodes belong to this thread,
which answers nothing until it has taken them."""

TOLD_PERCENT = 5
"""Progress is told when it grew by this much."""


@dataclass
class SceneState:
    """What is told of the scene's file.

    Attributes
    ----------
    asking : bool
        Whether the user is asked before a file is replaced.
    path : str
        Where the scene goes.
    saving : bool
    percent : int
        How much is written.
    saved : str
        Where the scene was saved last; empty once that was read.
    """

    asking: bool = False
    path: str = ""
    saving: bool = False
    percent: int = 0
    saved: str = ""


class SceneFile:
    """Saves the scene where the user says."""

    def __init__(self, context: PanelContext, chooser: Chooser) -> None:
        self._context, self._chooser = context, chooser
        self._data, self._name = typed_state(context.server, SceneState)
        self._ended = threading.Event()
        self.task: asyncio.Task[None] | None = None

    def build(self) -> None:
        """Make the button, inside the bar on top."""
        icon_button(
            "mdi-cube-send",
            "Save the scene for 3D Slicer",
            "save-scene",
            self.ask,
            disabled=(f"{self._context.name.busy} || {self._name.saving}",),
        )

    def build_line(self) -> None:
        """Make the line that says that the scene is being saved, or was."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._name
        shown = f"{name.saving} || {name.saved}"
        with (
            html.Div(v_if=shown, classes="hxp-banners"),
            html.Div(
                classes="hxp-banner hxp-banner-info",
                **marked("scene-line", role="status", data_saving=(name.saving,)),
            ),
        ):
            v.VIcon(icon="mdi-information", size="small", color="info")
            with html.Div(classes="hxp-banner-text"):
                html.Span(
                    f"The scene is being saved … {{{{ {name.percent} }}}} %", v_if=name.saving
                )
                html.Span(
                    f"The scene is saved: {{{{ {name.saved} }}}}",
                    v_else=True,
                    **marked("scene-saved"),
                )
            icon_button(
                "mdi-close",
                "Close this message",
                "close-scene-line",
                self._close_line,
                v_if=f"!{name.saving}",
            )

    def build_dialog(self) -> None:
        """Make the question before a file is replaced."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._name
        with (
            v.VDialog(v_model=(name.asking,), max_width=520),
            v.VCard(**marked("ask-replace", label="The file is there already")),
        ):
            v.VCardTitle("The file is there already", classes="text-subtitle-1 font-weight-bold")
            with v.VCardText():
                html.Span(f"{{{{ {name.path} }}}}", classes="hxp-path")
                html.Div("If you go on, this scene takes its place.")
            with v.VCardActions():
                v.VSpacer()
                button("Keep the file", "replace-keep", self._keep)
                button("Replace it", "replace-go-on", self._replace, primary=True)

    def ask(self) -> None:
        """Ask where the scene goes."""
        self._chooser.ask(
            "Save the scene for 3D Slicer",
            "Save",
            self.take,
            suffixes=SCENE_SUFFIXES,
            name=PROPOSED,
            hint="One file (.mrb) with CT, balls, frame, bone, schedule and case; no patient name.",
        )

    def take(self, path: Path) -> None:
        """Save the scene at a path; where there is a file, only after a question."""
        path = scene_path(path)
        self._data.path = str(path)
        if os.path.lexists(path):
            self._data.asking = True
        else:
            self._begin()

    def _keep(self) -> None:
        self._data.asking = False

    def _replace(self) -> None:
        self._data.asking = False
        self._begin()

    def _begin(self) -> None:
        if not self._data.saving:
            self._data.saving, self._data.percent, self._data.saved = True, 0, ""
            self.task = asyncio.get_running_loop().create_task(self._save(self._data.path))

    async def _save(self, path: str) -> None:
        await asyncio.sleep(SHOWN_S)
        context, loop = self._context, asyncio.get_running_loop()
        taken: list[TakenScene] = []
        try:
            context.plan(lambda: taken.append(context.controls.take_scene()))
            volume = context.presenter.value("load")
            for scene in taken:
                told = self._teller(loop)
                await loop.run_in_executor(None, partial(scene.write, Path(path), progress=told))
                context.presenter.scene_written(Path(path), volume)
                with context.server.state:
                    self._data.saved = path
        except HexaFixError as error:
            with context.server.state:
                context.tell(error)
        finally:
            with context.server.state:
                self._data.saving = False

    def _teller(self, loop: asyncio.AbstractEventLoop) -> Progress:
        """What the writing thread reports to; it stops it when the workstation ends."""
        shown = 0

        def told(step: str, fraction: float) -> None:
            nonlocal shown
            if self._ended.is_set():
                raise Cancelled.of(
                    "cancelled", "the scene was not saved", next_step="save it again"
                )
            percent = round(100 * fraction)
            if percent >= shown + TOLD_PERCENT:
                shown = percent
                loop.call_soon_threadsafe(self._show, percent)

        return told

    def _show(self, percent: int) -> None:
        with self._context.server.state:
            self._data.percent = percent

    def _close_line(self) -> None:
        self._data.saved = ""

    def close(self) -> None:
        """Stop saving; an older file stays."""
        self._ended.set()
        if self.task is not None:
            self.task.cancel()


def scene_path(path: Path) -> Path:
    """Where a scene goes: into a folder under its proposed name, else with its own ending."""
    if os.path.isdir(path):  # noqa: PTH112 - a name that is no name is no folder
        return path / PROPOSED
    ending = SCENE_SUFFIXES[0]
    return path if path.name.lower().endswith(ending) else path.with_name(path.name + ending)
