"""What the panel asks of a toolkit: a few properties and events of named widgets, and dialogs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol


class Widgets(Protocol):
    """The widgets of ``HexaFixModule.ui`` by object name.

    Properties of `get` and `set`, by the widget's class:

    ============  ===============================  ================================================
    property      widgets                          value
    ============  ===============================  ================================================
    ``text``      label, line edit, combo, button  str
    ``items``     combo, list                      sequence of str
    ``index``     combo, list, stack, table        int; the chosen row of a table, −1 for none
    ``table``     table                            `hexafix.presenter.Table`; `get` gives its rows
    ``checked``   check box, checkable button      bool
    ``value``     slider, spin box, progress bar   int
    ``maximum``   slider                           int
    ``date``      date edit                        str, ISO
    ``html``      text browser                     str
    ``picture``   label                            bytes of an SVG or PNG, empty for none
    ``mark``      line edit, table                 str: what is wrong with the content, or empty
    ``tip``       all                              str
    ``enabled``   all                              bool
    ``visible``   all                              bool
    ============  ===============================  ================================================

    Events of `connect` and what the callback gets: ``clicked`` None, ``checked`` bool, ``edited``
    the text once the user is done with it, ``picked`` the index, ``row`` the index, ``cell`` None,
    ``moved`` int, ``dated`` ISO text, ``link`` str. Only what the user does is an event: `set`
    causes none.
    """

    def get(self, name: str, what: str) -> Any:
        """A property of a widget."""
        ...

    def set(self, name: str, what: str, value: Any) -> None:
        """Set a property of a widget without causing an event."""
        ...

    def connect(self, name: str, event: str, callback: Callable[[Any], None]) -> None:
        """Call back at an event of a widget."""
        ...

    def finish(self) -> None:
        """End what is being typed, so that an open cell editor hands over its text."""
        ...

    def every(self, seconds: float, callback: Callable[[], None] | None) -> None:
        """Call back again and again from now on; None ends it."""
        ...

    def ask_file(self, title: str, kinds: str) -> str:
        """A file that exists, or an empty text; `kinds` as Qt's file filter."""
        ...

    def ask_folder(self, title: str) -> str:
        """A folder that exists, or an empty text."""
        ...

    def ask_new_file(self, title: str, name: str, kinds: str) -> str:
        """Where to save, or an empty text."""
        ...

    def ask(self, title: str, question: str, answers: Sequence[str]) -> int:
        """Which of the answers; the last one where the question was closed."""
        ...
