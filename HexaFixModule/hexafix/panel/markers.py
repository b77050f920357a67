"""The page of the marker balls: found, not accepted, placed by hand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hexafix.errors import InputError
from hexafix.panel.binding import Binding, button, field, idle, kept, switch, table
from hexafix.panel.text import at, number_of, rounded, text_of
from hexafix.presenter import Step

if TYPE_CHECKING:
    from collections.abc import Sequence

    from hexafix.panel.panel import Panel

AXES = ("L", "P", "S")
PLACE = tuple(f"marker{axis}LineEdit" for axis in AXES)


def fill_place(panel: Panel, names: Sequence[str], lps_mm: Sequence[float]) -> None:
    """Write a clicked point into three fields."""
    for name, value in zip(names, lps_mm, strict=True):
        panel.put(name, rounded(value))


def typed_place(panel: Panel, names: Sequence[str], what: str) -> list[float]:
    """The point in three fields, LPS mm."""
    return [
        number_of(panel.widgets.get(name, "text"), f"{what}, {axis}")
        for name, axis in zip(names, AXES, strict=True)
    ]


def chosen_ball(panel: Panel) -> int:
    """Index of the chosen ball."""
    index = panel.widgets.get("ballsTable", "index")
    if not 0 <= index < len(panel.table("balls").rows):
        raise InputError.of(
            "no-ball-chosen",
            "no ball is chosen",
            next_step="click a row of the balls found, or a ball in a view",
        )
    return index


def _set_diameter(panel: Panel, text: str) -> None:
    panel.presenter.set_ball_diameter(number_of(text, "the ball diameter"))


def _add(panel: Panel, _: Any) -> None:
    panel.presenter.add_marker(typed_place(panel, PLACE, "the ball's place"))


def _move(panel: Panel, _: Any) -> None:
    panel.presenter.move_marker(
        chosen_ball(panel), typed_place(panel, PLACE, "the ball's new place")
    )


def _chosen(panel: Panel, index: int) -> None:
    rows = panel.table("balls").rows
    if 0 <= index < len(rows):
        for name, text in zip(PLACE, rows[index][2:5], strict=True):
            panel.put(name, text)
        panel.ball_chosen.emit(index)


BINDINGS: tuple[Binding, ...] = (
    field(
        "ballDiameterLineEdit",
        _set_diameter,
        lambda _, snapshot: text_of(at(snapshot.document, "markers", "ball_diameter_mm")),
    ),
    button("findBallsButton", lambda panel, _: panel.run(Step.MARKERS), enabled=idle),
    table("ballsTable", "balls", _chosen),
    button(
        "removeMarkerButton",
        lambda panel, _: panel.presenter.remove_marker(chosen_ball(panel)),
        enabled=lambda panel, _: bool(panel.table("balls").rows),
    ),
    *(kept(name) for name in PLACE),
    button("addMarkerButton", _add),
    button("moveMarkerButton", _move, enabled=lambda panel, _: bool(panel.table("balls").rows)),
    switch(
        "pickMarkerButton",
        lambda panel, on: panel.pick("pickMarkerButton" if on else ""),
        lambda panel, _: panel.picking == "pickMarkerButton",
    ),
    table("rejectedTable", "rejected"),
)
