"""The page of the balls' numbers and of their places on the rings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hexafix.errors import InputError
from hexafix.panel.binding import Binding, button, chooser, idle, switch, table
from hexafix.panel.rows import RowsTable
from hexafix.panel.text import at, text_of

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

KEYS = ("number", "radius_mm", "sweep_deg", "height_mm")
COLUMNS = ("Number", "Radius mm", "Angle °", "Height mm")
RINGS = ("proximal", "distal")


def numbers(snapshot: Snapshot) -> tuple[str, ...]:
    """All numbers of both rings' layouts, in order."""
    found = {
        marker["number"]
        for ring in RINGS
        for marker in at(snapshot.document, "markers", ring) or ()
        if isinstance(marker, dict) and isinstance(marker.get("number"), int)
    }
    return tuple(str(number) for number in sorted(found))


def _balls(panel: Panel, _: Snapshot) -> tuple[str, ...]:
    return tuple(row[0] for row in panel.table("balls").rows)


def chosen_number(panel: Panel, widget: str = "assignNumberComboBox") -> int:
    """The number chosen in a combo box."""
    items, index = numbers(panel.snapshot), panel.widgets.get(widget, "index")
    if not 0 <= index < len(items):
        raise InputError.of(
            "no-number-chosen",
            "no number is chosen",
            next_step="give the balls' places on both rings first, then choose a number",
        )
    return int(items[index])


def _assign(panel: Panel, _: Any) -> None:
    index = panel.widgets.get("assignBallComboBox", "index")
    if not 0 <= index < len(panel.table("balls").rows):
        raise InputError.of(
            "no-ball-chosen", "no ball is chosen", next_step="find the balls first, then choose one"
        )
    panel.presenter.assign_number(chosen_number(panel), index)


def _swap(panel: Panel, _: Any) -> None:
    panel.presenter.swap_numbers(
        chosen_number(panel, "swapFirstComboBox"), chosen_number(panel, "swapSecondComboBox")
    )


def _row_chosen(panel: Panel, index: int) -> None:
    """A row of the table chooses its number, and shows its ball."""
    rows, items = panel.table("numbering").rows, numbers(panel.snapshot)
    if 0 <= index < len(rows) and rows[index][0] in items:
        place = items.index(rows[index][0])
        panel.widgets.set("assignNumberComboBox", "index", place)
        panel.widgets.set("swapFirstComboBox", "index", place)
        balls = _balls(panel, panel.snapshot)
        if rows[index][2] in balls:
            panel.ball_chosen.emit(balls.index(rows[index][2]))


def _layout(ring: str) -> RowsTable:
    def held(_: Panel, snapshot: Snapshot) -> list[list[str]]:
        return [
            [text_of(marker.get(key)) for key in KEYS]
            for marker in at(snapshot.document, "markers", ring) or ()
        ]

    def store(panel: Panel, rows: list[list[float]]) -> None:
        panel.presenter.set_markers(ring, [dict(zip(KEYS, row, strict=True)) for row in rows])

    return RowsTable(f"{ring}MarkersTable", COLUMNS, held, store)


LAYOUTS = {ring: _layout(ring) for ring in RINGS}

BINDINGS: tuple[Binding, ...] = (
    table("numberingTable", "numbering", _row_chosen),
    button(
        "numberAutomaticallyButton",
        lambda panel, _: panel.presenter.number_automatically(),
        enabled=idle,
    ),
    chooser("assignNumberComboBox", lambda _, snapshot: numbers(snapshot)),
    chooser("assignBallComboBox", _balls),
    button("assignNumberButton", _assign),
    button(
        "clearNumberButton", lambda panel, _: panel.presenter.clear_number(chosen_number(panel))
    ),
    chooser("swapFirstComboBox", lambda _, snapshot: numbers(snapshot)),
    chooser("swapSecondComboBox", lambda _, snapshot: numbers(snapshot)),
    button("swapNumbersButton", _swap),
    switch(
        "pickNumberButton",
        lambda panel, on: panel.pick("pickNumberButton" if on else ""),
        lambda panel, _: panel.picking == "pickNumberButton",
    ),
    *LAYOUTS["proximal"].bindings("addProximalMarkerButton", "removeProximalMarkerButton"),
    *LAYOUTS["distal"].bindings("addDistalMarkerButton", "removeDistalMarkerButton"),
)
