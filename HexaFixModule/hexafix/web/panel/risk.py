"""Structures at risk: points that move with the fragment, whose path limits the fastest motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hexafix.errors import InputError
from hexafix.web.panel.context import PanelContext, number, typed_state
from hexafix.web.panel.widgets import button, icon_button, marked, note
from hexafix.web.panel.widgets import field as text_field
from hexafix.web.state import number_words

KEY = "structures_at_risk_lps_mm"
"""Key of the schedule."""

AXES = ("L", "P", "S")

EMPTY = ("", "", "")


@dataclass
class RiskState:
    """The points as texts.

    Attributes
    ----------
    points : list of list of str
        L, P and S of each point of the case.
    new : list of str
        A point that is being typed; no point of the case yet.
    picking : bool
        Whether the next click in a view gives a point.
    """

    points: list = field(default_factory=list)
    new: list = field(default_factory=lambda: [*EMPTY])
    picking: bool = False


class RiskPoints:
    """The points of the case, each an edit of its own; picked by a click or typed."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, RiskState)
        context.before_planning.append(self.require_added)

    def build(self) -> None:
        """Make the rows of points and the ways to add one."""
        from trame.widgets import html

        name = self._name
        with html.Details(classes="hxp-details", **marked("risk-editor")):
            html.Summary(
                f"Structures at risk: {{{{ {name.points}.length || 'none' }}}}",
                **marked("risk-summary"),
            )
            note(
                "Points that move with the fragment: nerve, vessel, end of the bone. None of them "
                "moves faster than the fastest motion. LPS, mm."
            )
            with html.Div(v_for=f"(point, i) in {name.points}", key="i", classes="hxp-point"):
                for k, axis in enumerate(AXES):
                    text_field(
                        self._context,
                        f"risk-{axis}",
                        axis,
                        f"point[{k}]",
                        self._commit,
                        f"i, {k}, ",
                        key=(f"'risk-' + i + '-{axis}'",),
                    )
                icon_button(
                    "mdi-delete-outline",
                    ("'Remove point ' + (i + 1)",),
                    ("'remove-risk-' + i",),
                    (self._remove, "[i]"),
                    in_row=True,
                )
            self._adding()

    def _adding(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._name
        with html.Div(classes="hxp-point"):
            for k, axis in enumerate(AXES):
                v.VTextField(
                    label=f"New {axis}",
                    v_model=(f"{name.new}[{k}]",),
                    update_modelValue=f"flushState('{name.new}')",
                    density="compact",
                    variant="outlined",
                    hide_details=True,
                    autocomplete="off",
                    **marked(f"risk-new-{axis}", label=f"New point, {axis}"),
                )
            icon_button("mdi-plus", "Add the typed point", "risk-add", self._add, in_row=True)
        button(
            (f"{name.picking} ? 'Click the point in a view' : 'Add a point by a click'",),
            "risk-pick",
            self._pick,
            icon="mdi-crosshairs-gps",
            active=(name.picking,),
        )

    def update(self, document: Mapping[str, Any]) -> None:
        """Show the document's points."""
        self._data.points = [[number_words(v) for v in point] for point in _points(document)]

    def stop(self) -> None:
        """Wait for no click any more."""
        if self._data.picking:
            self._data.picking = False
            self._context.controls.pick_point(None)

    def require_added(self) -> None:
        """Plan nothing while a point was typed that is not one of the case (H40).

        Raises
        ------
        InputError
            While one of the new point's fields holds something.
        """
        if any(text and text.strip() for text in self._data.new):
            raise InputError.of(
                "point-not-added",
                "a structure at risk was typed that does not stand in the case",
                where=f"schedule.{KEY}",
                next_step="press the plus beside it, or empty its fields",
                hazard="H40",
            )

    def _commit(self, row: int, column: int, text: str) -> None:
        def work() -> Any:
            points = _points(self._context.presenter.snapshot.document)
            where = f"schedule.{KEY}[{row}][{column}]"
            points[row][column] = number(text, where=where)
            return self._put(points)

        self._context.act(work, field=f"risk-{row}-{AXES[column]}")

    def _remove(self, row: int) -> None:
        points = _points(self._context.presenter.snapshot.document)
        del points[row]
        self._context.restore()
        self._context.act(lambda: self._put(points))

    def _add(self) -> None:
        def work() -> Any:
            row = len(_points(self._context.presenter.snapshot.document))
            point = [
                number(text, where=f"schedule.{KEY}[{row}][{column}]")
                for column, text in enumerate(self._data.new)
            ]
            return self._append(point)

        if self._context.act(work):
            self._data.new = [*EMPTY]

    def _pick(self) -> None:
        if self._data.picking:
            self.stop()
            return
        self._data.picking = True

        def picked(lps: Sequence[float]) -> None:
            from hexafix.pipeline.text import format_number

            self.stop()
            # a tenth of a millimetre is finer than a click
            point = [float(format_number(value, 1)) for value in lps]
            self._context.act(lambda: self._append(point))

        self._context.ask_point(picked)

    def _append(self, point: list[float]) -> Any:
        return self._put([*_points(self._context.presenter.snapshot.document), point])

    def _put(self, points: list[list[float]]) -> Any:
        given = dict(self._context.presenter.snapshot.document.get("schedule") or {})
        given.pop(KEY, None)
        return self._context.presenter.set_schedule({**given, KEY: points} if points else given)


def _points(document: Mapping[str, Any]) -> list[list[float]]:
    """A copy of the document's points, L, P and S in mm."""
    schedule = document.get("schedule") or {}
    return [[*point] for point in schedule.get(KEY) or ()]
