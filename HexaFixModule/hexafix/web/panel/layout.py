"""The marker layout t, φ, h of both rings as fields."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hexafix.web.panel.context import PanelContext, number, typed_state, whole_number
from hexafix.web.panel.widgets import button, icon_button, marked
from hexafix.web.panel.widgets import field as text_field
from hexafix.web.state import number_words

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

KEYS = (
    ("number", "No."),
    ("radius_mm", "radius t, mm"),
    ("sweep_deg", "sweep φ, deg"),
    ("height_mm", "height h, mm"),
)
"""A marker's installation parameters as the paper names them."""


@dataclass
class LayoutState:
    """Both rings' rows as texts: number, radius, sweep, height."""

    proximal: list = field(default_factory=list)
    distal: list = field(default_factory=list)


class LayoutEditor:
    """Installation parameters of the markers, ring by ring."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, LayoutState)

    def build(self) -> None:
        """Make both rings' tables of fields."""
        from trame.widgets import html

        with html.Details(classes="hxp-details", **marked("layout-editor")):
            html.Summary("Marker layout of both rings", **marked("layout-summary"))
            for ring in ("proximal", "distal"):
                html.Div(f"{ring.capitalize()} ring", classes="hxp-title")
                self._ring(ring, getattr(self._name, ring))

    def _ring(self, ring: str, rows: str) -> None:
        from trame.widgets import html

        with html.Div(v_for=f"(marker, i) in {rows}", key="i", classes="hxp-marker"):
            for column, (key, label) in enumerate(KEYS):
                text_field(
                    self._context,
                    f"{ring}-{key}",
                    label,
                    f"marker[{column}]",
                    self._commit,
                    f"'{ring}', i, {column}, ",
                    key=(f"'{ring}-' + i + '-{key}'",),
                )
            icon_button(
                "mdi-delete-outline",
                (f"'Remove marker ' + marker[0] + ' of the {ring} ring'",),
                (f"'remove-{ring}-' + i",),
                (self._remove, f"['{ring}', i]"),
                in_row=True,
            )
        button("Add a marker", f"add-{ring}", (self._add, f"['{ring}']"), icon="mdi-plus")

    def update(self, snapshot: Snapshot) -> None:
        """Show the document's layout."""
        markers = snapshot.document.get("markers") or {}
        for ring in ("proximal", "distal"):
            rows = [
                [number_words(site.get(key)) for key, _ in KEYS] for site in markers.get(ring) or ()
            ]
            setattr(self._data, ring, rows)

    def _rows(self, ring: str) -> list[dict[str, Any]]:
        markers = self._context.presenter.snapshot.document.get("markers") or {}
        return [dict(site) for site in markers.get(ring) or ()]

    def _commit(self, ring: str, row: int, column: int, text: str) -> None:
        key = KEYS[column][0]
        where = f"markers.{ring}[{row}].{key}"

        def work() -> Any:
            rows = self._rows(ring)
            read = whole_number if key == "number" else number
            rows[row][key] = read(text, where=where)
            return self._context.presenter.set_markers(ring, rows)

        self._context.act(work, field=f"{ring}-{row}-{key}")

    def _remove(self, ring: str, row: int) -> None:
        rows = self._rows(ring)
        del rows[row]
        self._context.act(lambda: self._context.presenter.set_markers(ring, rows))

    def _add(self, ring: str) -> None:
        """A new row repeats the last one's radius and height; its number is the next free one."""
        taken = {site["number"] for name in ("proximal", "distal") for site in self._rows(name)}
        free = next(n for n in range(1, 100) if n not in taken)
        rows = self._rows(ring)
        last = rows[-1] if rows else {"radius_mm": 100.0, "sweep_deg": 0.0, "height_mm": 20.0}
        rows.append({**last, "number": free})
        self._context.act(lambda: self._context.presenter.set_markers(ring, rows))
