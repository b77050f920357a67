"""One line of the binder's table: a widget, what it does and what it shows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hexafix.presenter import Table

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

Fill = Callable[["Panel", "Snapshot"], Any]
Action = Callable[["Panel", Any], Any]


@dataclass(frozen=True, slots=True)
class Binding:
    """A widget's place in the workflow.

    Attributes
    ----------
    widget : str
        Object name in ``HexaFixModule.ui``.
    event : str
        Event of `hexafix.panel.widgets.Widgets`; empty for a widget that only shows.
    action : callable or None
        What the event does, called with the panel and the event's value.
    shows : tuple of (str, callable)
        Properties and how a snapshot fills them.
    commits : bool
        Whether the action needs everything typed before it to stand in the case.
    """

    widget: str
    event: str = ""
    action: Action | None = None
    shows: tuple[tuple[str, Fill], ...] = ()
    commits: bool = False


def button(
    widget: str, action: Action, *, enabled: Fill | None = None, commits: bool = True
) -> Binding:
    """A button; it first takes over what was typed."""
    return Binding(
        widget, "clicked", action, (("enabled", enabled),) if enabled else (), commits=commits
    )


def switch(widget: str, action: Action, checked: Fill, *, enabled: Fill | None = None) -> Binding:
    """A check box or a button that stays pressed."""
    shows = (("checked", checked), *((("enabled", enabled),) if enabled else ()))
    return Binding(widget, "checked", action, shows)


def field(widget: str, action: Action, text: Fill, *, enabled: Fill | None = None) -> Binding:
    """A line edit whose text goes into the case."""
    shows = (("text", text), *((("enabled", enabled),) if enabled else ()))
    return Binding(widget, "edited", action, shows)


def kept(widget: str) -> Binding:
    """A line edit whose text is read when a button is pressed."""
    return Binding(widget, "edited", lambda panel, _: panel.refresh())


def choice(widget: str, action: Action, index: Fill, *, items: Fill | None = None) -> Binding:
    """A combo box."""
    shows = (("index", index),) if items is None else (("items", items), ("index", index))
    return Binding(widget, "picked", action, shows)


def chooser(widget: str, items: Fill) -> Binding:
    """A combo box whose choice is read when a button is pressed."""
    return Binding(widget, "picked", lambda panel, _: panel.refresh(), (("items", items),))


def table(widget: str, name: str, action: Action | None = None) -> Binding:
    """A table of the snapshot."""

    def rows(_: Panel, snapshot: Snapshot) -> Any:
        return snapshot.tables.get(name) or Table(())

    return Binding(widget, "row" if action else "", action, (("table", rows),))


def shown(widget: str, what: str, fill: Fill) -> Binding:
    """A widget that only shows."""
    return Binding(widget, shows=((what, fill),))


def idle(_: Panel, snapshot: Snapshot) -> bool:
    """Whether no work is under way."""
    return not snapshot.busy
