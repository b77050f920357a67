"""The scene as a file for 3D Slicer: where to, whether to replace, saved or why not."""

from __future__ import annotations

import asyncio
import os
from dataclasses import dataclass
from pathlib import Path

from hexafix.web.files import SCENE_SUFFIXES
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.widgets import button, icon_button, marked

PROPOSED = f"scene{SCENE_SUFFIXES[0]}"

SHOWN_S = 0.1
"""Time for the browser to say that the scene is being saved: MRML's nodes belong to this thread,
which then answers nothing until the file is whole."""


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
    saved : str
        Where the scene was saved last; empty once that was read.
    """

    asking: bool = False
    path: str = ""
    saving: bool = False
    saved: str = ""


class SceneFile:
    """Saves the scene where the user says."""

    def __init__(self, context: PanelContext, chooser: Chooser) -> None:
        self._context, self._chooser = context, chooser
        self._data, self._name = typed_state(context.server, SceneState)
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
                html.Span("The scene is being saved …", v_if=name.saving)
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
            self._data.saving, self._data.saved = True, ""
            self.task = asyncio.get_running_loop().create_task(self._save(self._data.path))

    async def _save(self, path: str) -> None:
        await asyncio.sleep(SHOWN_S)
        with self._context.server.state:
            try:
                if self._context.plan(lambda: self._context.controls.save_scene(Path(path))):
                    self._data.saved = path
            finally:
                self._data.saving = False

    def _close_line(self) -> None:
        self._data.saved = ""

    def close(self) -> None:
        """Begin no more saving."""
        if self.task is not None:
            self.task.cancel()


def scene_path(path: Path) -> Path:
    """Where a scene goes: into a folder under its proposed name, else with its own ending."""
    if os.path.isdir(path):  # noqa: PTH112 - a name that is no name is no folder
        return path / PROPOSED
    ending = SCENE_SUFFIXES[0]
    return path if path.name.lower().endswith(ending) else path.with_name(path.name + ending)
