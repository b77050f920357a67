"""A small file chooser over the server's own folders."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from hexafix.web.files import listing, start_folder
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.widgets import button, icon_button, marked, note


@dataclass
class ChooserState:
    """What the chooser shows.

    Attributes
    ----------
    entries : list of dict
        name, path, kind (``folder`` or ``file``).
    picked : str
        The path that would be taken.
    """

    shown: bool = False
    title: str = ""
    action: str = ""
    hint: str = ""
    folder: str = ""
    parent: str = ""
    entries: list = field(default_factory=list)
    left_out: int = 0
    cut: bool = False
    picked: str = ""
    fault: str = ""


class Chooser:
    """Asks for a path on the server and hands it to who asked."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, ChooserState)
        self._suffixes: tuple[str, ...] = ()
        self._take: Callable[[Path], Any] = lambda _: None

    def ask(
        self,
        title: str,
        action: str,
        take: Callable[[Path], Any],
        *,
        suffixes: tuple[str, ...] = (),
        name: str = "",
        hint: str = "",
    ) -> None:
        """Open the chooser; `take` gets the chosen path.

        Parameters
        ----------
        title, action : str
            Head, and word on the button.
        take : callable
        suffixes : tuple of str
            Files to show; folders are always shown.
        name : str
            A file's name proposed for saving.
        hint : str
            What to choose, in one line.
        """
        self._take, self._suffixes = take, suffixes
        self._data.title, self._data.action, self._data.hint = title, action, hint
        folder = start_folder(self._context.presenter.snapshot.case_path)
        self._open(str(folder))
        if name:
            self._data.picked = str(folder / name)
        self._data.shown = True

    def _open(self, folder: str) -> None:
        from hexafix.errors import InputError

        try:
            found: dict[str, Any] = listing(Path(folder), self._suffixes)
        except InputError as error:
            self._data.fault = error.faults[0].what
            return
        self._data.fault = ""
        self._data.folder = found["folder"]
        self._data.parent = found["parent"]
        self._data.entries = found["entries"]
        self._data.left_out = found["left_out"]
        self._data.cut = found["cut"]
        self._data.picked = found["folder"]

    def _click(self, path: str, kind: str) -> None:
        if kind == "folder":
            self._open(path)
        else:
            self._data.picked = path

    def _accept(self) -> None:
        path = self._data.picked.strip()
        if not path:
            self._data.fault = "choose or write a path first"
            return
        self._data.shown = False
        self._take(Path(path).expanduser())

    def _close(self) -> None:
        self._data.shown = False

    def build(self) -> None:
        """Make the dialog."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._name
        with (
            v.VDialog(v_model=(name.shown,), max_width=640, scrollable=True),
            v.VCard(**marked("chooser", label=(name.title,))),
        ):
            with v.VCardTitle(classes="text-subtitle-1 font-weight-bold"):
                html.Span(f"{{{{ {name.title} }}}}")
            with v.VCardText(classes="py-2"):
                note(f"{{{{ {name.hint} }}}}", v_if=name.hint)
                with html.Div(classes="hxp-row"):
                    icon_button(
                        "mdi-arrow-up",
                        "Up one folder",
                        "chooser-up",
                        (self._open, f"[{name.parent}]"),
                    )
                    html.Span(f"{{{{ {name.folder} }}}}", classes="hxp-path")
                self._entries()
                html.Div(
                    f"{{{{ {name.left_out} }}}} other files are not listed",
                    v_if=name.left_out,
                    classes="hxp-note",
                )
                html.Div("the folder holds more; write the path", v_if=name.cut, classes="hxp-note")
                v.VTextField(
                    label="Path",
                    v_model=(name.picked,),
                    density="compact",
                    variant="outlined",
                    error_messages=(name.fault,),
                    hide_details="auto",
                    classes="mt-2",
                    keydown_enter=self._accept,
                    **marked("chooser-path", label="Path"),
                )
            with v.VCardActions():
                v.VSpacer()
                button("Cancel", "chooser-cancel", self._close)
                button(f"{{{{ {name.action} }}}}", "chooser-accept", self._accept, primary=True)

    def _entries(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._name
        with (
            html.Div(classes="hxp-entries"),
            v.VList(density="compact", **marked("chooser-entries", label="Folders and files")),
            v.VListItem(
                v_for=f"entry in {name.entries}",
                key="entry.path",
                title=("entry.name",),
                prepend_icon=("entry.kind === 'folder' ? 'mdi-folder' : 'mdi-file-outline'",),
                active=(f"entry.path === {name.picked}",),
                click=(self._click, "[entry.path, entry.kind]"),
                **marked(("'entry-' + entry.name",)),
            ),
        ):
            pass
