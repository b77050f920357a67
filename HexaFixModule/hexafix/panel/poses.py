"""The pages of the ring poses and of the strut readings."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hexafix.panel.binding import Binding, button, field, idle, kept, shown, switch, table
from hexafix.panel.text import at, number_of, numbers_of, text_of
from hexafix.presenter import Step

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

STRUTS = (1, 2, 3, 4, 5, 6)
REPEATS = tuple(f"repeat{strut}LineEdit" for strut in STRUTS)


def _picture(name: str) -> Any:
    def svg(panel: Panel, snapshot: Snapshot) -> bytes | None:
        if snapshot.current != Step.POSES:
            return None
        return panel.pictures().get(name, "").encode()

    return shown("".join([*_camel(name), "Picture"]), "picture", svg)


def _camel(name: str) -> list[str]:
    first, *rest = name.split("_")
    return [first, *(word.capitalize() for word in rest)]


def reading(snapshot: Snapshot, strut: int) -> str:
    """A strut's reading in the case as text."""
    values = at(snapshot.document, "strut_readings_mm") or ()
    return text_of(values[strut - 1]) if len(values) >= strut else ""


def _reading_field(strut: int) -> Binding:
    def store(panel: Panel, text: str) -> None:
        panel.presenter.set_reading(strut, number_of(text, f"the reading of strut {strut}"))

    return field(f"reading{strut}LineEdit", store, lambda _, snapshot: reading(snapshot, strut))


def _repeat(panel: Panel, _: Any) -> None:
    typed = [panel.widgets.get(name, "text") for name in REPEATS]
    panel.presenter.repeat_readings(numbers_of(typed, "a reading of the second entry"))


def _repeat_state(_: Panel, snapshot: Snapshot) -> str:
    if not at(snapshot.document, "strut_readings_mm"):
        return "No readings yet."
    if snapshot.confirmed.get("readings"):
        return (
            "✓ Both entries agree."
            if snapshot.confirmed.get("readings_needed")
            else "✓ As given with the case file; no second entry needed."
        )
    return "⚠ The second entry is still to be typed and compared."


BINDINGS: tuple[Binding, ...] = (
    button("recogniseButton", lambda panel, _: panel.run(Step.POSES), enabled=idle),
    table("posesTable", "poses"),
    switch(
        "ringFrontCheckBox",
        lambda panel, on: panel.presenter.confirm_ring_front(on),
        lambda _, snapshot: bool(snapshot.confirmed.get("ring_front")),
    ),
    switch(
        "relaxedLayoutCheckBox",
        lambda panel, on: panel.presenter.accept_relaxed_layout(on),
        lambda _, snapshot: bool(snapshot.confirmed.get("relaxed_layout")),
    ),
    table("gatesTable", "gates"),
    table("layoutTable", "layout"),
    _picture("layout_proximal"),
    _picture("layout_distal"),
    *(_reading_field(strut) for strut in STRUTS),
    *(kept(name) for name in REPEATS),
    button("repeatReadingsButton", _repeat),
    button("weighReadingsButton", lambda panel, _: panel.run(Step.READINGS), enabled=idle),
    shown("repeatStateLabel", "text", _repeat_state),
    table("strutsTable", "struts"),
)
