"""Tables that are typed into: complete rows stand in the case, the others wait in the panel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from hexafix.errors import InputError
from hexafix.panel.binding import Binding, Fill, button
from hexafix.panel.text import number_of, whole_of
from hexafix.presenter import Table

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

WAITS = "not in the case yet"


@dataclass(frozen=True, slots=True)
class RowsTable:
    """A table whose rows are typed.

    Attributes
    ----------
    widget : str
    columns : tuple of str
        Heads with units; one that is called "Number" takes whole numbers.
    held : callable
        The rows that stand in the case, as texts.
    store : callable
        Puts all complete rows, as numbers, into the case.
    """

    widget: str
    columns: tuple[str, ...]
    held: Callable[[Panel, Snapshot], list[list[str]]]
    store: Callable[[Panel, list[list[float]]], Any]

    def bindings(self, add: str, remove: str) -> tuple[Binding, ...]:
        """The table with its two buttons."""
        shows: tuple[tuple[str, Fill], ...] = (("table", self.content),)
        return (
            Binding(self.widget, "cell", lambda panel, _: self.typed(panel), shows),
            button(add, lambda panel, _: self.add(panel)),
            button(remove, lambda panel, _: self.remove(panel)),
        )

    def content(self, panel: Panel, snapshot: Snapshot) -> Table:
        """The rows of the case, then those that wait."""
        held, waiting = self.held(panel, snapshot), panel.waiting_rows(self.widget)
        rows = tuple(tuple(row) for row in (*held, *waiting))
        alerts = (*("" for _ in held), *(WAITS for _ in waiting))
        return Table(self.columns, rows, alerts)

    def typed(self, panel: Panel) -> None:
        """Take over what stands in the table now."""
        rows = panel.widgets.get(self.widget, "table")
        whole = [row for row in rows if all(cell.strip() for cell in row)]
        numbers = [self.numbers(row) for row in whole]
        for row in rows:
            for cell, column in zip(row, self.columns, strict=True):
                if cell.strip():
                    self._number(cell, column)
        if whole != self.held(panel, panel.snapshot):
            self.store(panel, numbers)
        stored = len(self.held(panel, panel.snapshot)) == len(whole)
        waiting = [list(row) for row in rows if not (stored and row in whole)]
        panel.waiting_rows(self.widget)[:] = waiting

    def settle(self, panel: Panel) -> None:
        """Complete rows went into the case: only the others wait."""
        waiting = panel.waiting_rows(self.widget)
        waiting[:] = [row for row in waiting if not all(cell.strip() for cell in row)]

    def complete(self, panel: Panel) -> list[list[float]]:
        """The complete rows of the table as numbers."""
        rows = panel.widgets.get(self.widget, "table")
        return [self.numbers(row) for row in rows if all(cell.strip() for cell in row)]

    def numbers(self, row: Sequence[str]) -> list[float]:
        """A row as numbers."""
        return [self._number(cell, column) for cell, column in zip(row, self.columns, strict=True)]

    def add(self, panel: Panel, row: Sequence[str] = ()) -> None:
        """One more row, empty but for what is given."""
        cells = [*row, *("" for _ in self.columns)][: len(self.columns)]
        panel.waiting_rows(self.widget).append(cells)

    def fill(self, panel: Panel, cells: Sequence[str]) -> None:
        """Write a point into the last waiting row where all its cells are empty, or a new one.

        A point that was begun by typing is left alone: its axes would be mixed up.
        """
        waiting, size = panel.waiting_rows(self.widget), len(cells)
        row = waiting[-1] if waiting else []
        starts = (k for k in range(0, len(row), size) if not any(row[k : k + size]))
        start = next(starts, None)
        if start is None:
            self.add(panel)
            row, start = waiting[-1], 0
        row[start : start + size] = cells
        panel.refresh()
        self.typed(panel)

    def remove(self, panel: Panel) -> None:
        """Take the chosen row away."""
        rows = [list(row) for row in panel.widgets.get(self.widget, "table")]
        chosen = panel.widgets.get(self.widget, "index")
        if not 0 <= chosen < len(rows):
            raise InputError.of(
                "no-row-chosen", "no row is chosen", next_step="click a cell of the row first"
            )
        held = self.held(panel, panel.snapshot)
        if chosen >= len(held):
            del panel.waiting_rows(self.widget)[chosen - len(held)]
        else:
            del held[chosen]
            self.store(panel, [self.numbers(row) for row in held])

    @staticmethod
    def _number(cell: str, column: str) -> float:
        return whole_of(cell, column) if column == "Number" else number_of(cell, column)
