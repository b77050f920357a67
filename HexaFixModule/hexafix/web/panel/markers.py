"""Step 2: the balls that were found and those that were rejected, and the user's edits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hexafix.web.panel.context import PanelContext, number, typed_state
from hexafix.web.panel.widgets import button, field, icon_button, marked, note, table


@dataclass
class MarkersState:
    """Which ball is picked, and what the next click in a view does.

    Attributes
    ----------
    picked : int
        Row of the picked ball; -1 for none.
    mode : str
        ``add``, ``move`` or nothing.
    """

    picked: int = -1
    mode: str = ""


class MarkersStep:
    """Ball diameter, found and rejected balls; add by click, move, remove."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self.data, self.name = typed_state(context.server, MarkersState)

    def build(self) -> None:
        """Make the step's fields and tables."""
        from trame.widgets import html

        context, name = self._context, self.name
        with html.Div(classes="hxp-row"):
            field(
                context,
                "ball-diameter",
                "Ball diameter",
                f"{context.name.form}.ball_diameter",
                self._diameter,
                suffix="mm",
                style="max-width: 170px",
            )
            button(
                "Find the balls",
                "run-markers",
                self._find,
                icon="mdi-magnify-scan",
                primary=True,
                disabled=(context.name.busy,),
            )
            button(
                (f"{name.mode} === 'add' ? 'Stop adding' : 'Add by click'",),
                "add-marker",
                self._toggle_add,
                icon="mdi-plus-circle-outline",
                active=(f"{name.mode} === 'add'",),
                disabled=(f"!{context.name.table_balls}.rows.length",),
            )
        html.Div(
            f"{{{{ {name.mode} === 'add' ? 'Click on the ball in a slice view; Escape stops.'"
            " : 'Click where the ball is in a slice view; Escape stops.' }}",
            v_if=name.mode,
            classes="hxp-mode",
            **marked("marker-mode", role="status"),
        )
        table(
            context,
            "balls",
            "Balls found",
            click=(self.pick, "[i]"),
            picked=f"{name.picked} === i",
            row_end=self._row_end,
            hidden=("Sigma mm", "HU"),
            empty="No ball was searched yet.",
        )
        note("Click a ball to see it in the views; in the views it can be dragged.")
        with (
            html.Details(
                v_if=f"{context.name.table_rejected}.rows.length",
                classes="hxp-details",
                **marked("rejected"),
            ),
        ):
            html.Summary(
                f"{{{{ {context.name.table_rejected}.rows.length }}}} places were rejected",
                **marked("rejected-summary"),
            )
            table(context, "rejected", "Rejected, and why")

    def _row_end(self) -> None:
        icon_button(
            "mdi-crosshairs",
            ("'Move ball ' + row[0] + ' by a click'",),
            ("'move-ball-' + i",),
            (self._move, "[i]"),
            in_row=True,
        )
        icon_button(
            "mdi-delete-outline",
            ("'Remove ball ' + row[0]",),
            ("'remove-ball-' + i",),
            (self._remove, "[i]"),
            in_row=True,
        )

    def pick(self, index: int) -> None:
        """Pick a ball, in the table and in the views; the same again lets it go."""
        index = -1 if index == self.data.picked else index
        self.data.picked = index
        self._context.controls.select_ball(None if index < 0 else index)

    def stop(self) -> None:
        """Leave adding and moving."""
        if self.data.mode == "add":
            self._context.controls.place_marker(False)
        elif self.data.mode == "move":
            self._context.controls.pick_point(None)
        self.data.mode = ""

    def _diameter(self, text: str) -> None:
        context = self._context
        context.act(
            lambda: context.presenter.set_ball_diameter(
                number(text, where="markers.ball_diameter_mm")
            ),
            field="ball-diameter",
        )

    def _find(self) -> None:
        from hexafix.presenter import Step

        self._context.act(lambda: self._context.presenter.run(Step.MARKERS))

    def _toggle_add(self) -> None:
        adding = self.data.mode == "add"
        self.stop()
        if not adding:
            self.data.mode = "add"
            self._context.controls.place_marker(True)

    def _move(self, index: int) -> None:
        self.stop()
        self.data.mode = "move"
        self.data.picked = index
        self._context.controls.select_ball(index)

        def picked(lps: Sequence[float]) -> None:
            self.stop()
            self._context.act(lambda: self._context.presenter.move_marker(index, lps))

        self._context.ask_point(picked)

    def _remove(self, index: int) -> None:
        self._context.act(lambda: self._context.presenter.remove_marker(index))
