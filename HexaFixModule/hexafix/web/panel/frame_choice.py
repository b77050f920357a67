"""Which frame: one of those that come with HexaFix, or the definition that the case brought."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.panel.load import own_title, shipped_titles
from hexafix.strict_json import read_json_object
from hexafix.web.files import CASE_SUFFIXES, start_folder
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.widgets import button, choice

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

OWN = "own definition"
"""Stands in the list for the definition that is not one of HexaFix."""


@dataclass
class FrameState:
    """The list of frames.

    Attributes
    ----------
    frames : list of dict
        title and value, as the browser's list takes them.
    chosen : str or None
        The value of the case's frame.
    """

    frames: list = field(default_factory=list)
    chosen: str | None = None


class FrameChoice:
    """A list of the shipped definitions and of the case's own one, if it came with one."""

    def __init__(self, context: PanelContext, chooser: Chooser) -> None:
        self._context, self._chooser = context, chooser
        self._data, self._name = typed_state(context.server, FrameState)
        self._own: Any = None
        self._case: str | None = None

    def build(self) -> None:
        """Make the list."""
        name = self._name
        choice(self._context, "fixator", "Frame", f"{name.chosen}", (name.frames,), self._choose)

    def build_file(self) -> None:
        """Make the button that reads a definition from a file."""
        button("Frame from a file", "fixator-file", self._ask)

    def update(self, snapshot: Snapshot) -> None:
        """Bring the list to the case; its own definition stays on it as long as the case is open.

        Parameters
        ----------
        snapshot : Snapshot
        """
        shipped, given = shipped_titles(), snapshot.document.get("fixator")
        if snapshot.case_path != self._case:
            self._own, self._case = None, snapshot.case_path
        if given and not is_shipped(given, shipped):
            self._own = given
        self._data.frames = frame_items(shipped, self._own)
        self._data.chosen = given if is_shipped(given, shipped) else OWN if given else None

    def _choose(self, value: str) -> None:
        if value != self._data.chosen:
            self._set(self._own_definition() if value == OWN else value)

    def _own_definition(self) -> Any:
        """The case's own definition; a file by its whole path, which names it everywhere."""
        if not isinstance(self._own, str):
            return self._own
        path = start_folder(self._case) / self._own
        return str(path) if path.is_file() else self._own

    def _set(self, given: str | Mapping[str, Any]) -> None:
        self._context.act(lambda: self._context.presenter.set_fixator(given), field="fixator")

    def _ask(self) -> None:
        self._chooser.ask(
            "Choose the frame's definition",
            "Choose",
            self._read,
            suffixes=CASE_SUFFIXES,
            hint="A fixator's definition (.json); it becomes part of the case.",
        )

    def _read(self, path: Path) -> None:
        def take() -> Any:
            _, definition = read_json_object(path, what="fixator definition")
            return self._context.presenter.set_fixator(definition)

        self._context.act(take, field="fixator")


def is_shipped(given: Any, shipped: Mapping[str, str]) -> bool:
    """Whether a case's fixator is one that comes with HexaFix."""
    return isinstance(given, str) and given in shipped


def frame_items(shipped: Mapping[str, str], own: Any) -> list[dict[str, str]]:
    """The list's entries: the shipped definitions by name, then the case's own one.

    Parameters
    ----------
    shipped : mapping of str to str
        `shipped_titles`.
    own : str, mapping or None
        Path of a definition, a definition, or none.
    """
    items = [{"title": title, "value": known} for known, title in shipped.items()]
    if own:
        items.append({"title": own_title(own), "value": OWN})
    return items
