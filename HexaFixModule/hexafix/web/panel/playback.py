"""The correction day by day: slider, play, strut values with their turns, curves."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.prescription import data_address
from hexafix.web.panel.struts import badge
from hexafix.web.panel.widgets import icon_button, marked, picture

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

STEP_S = 0.35
"""Time between two adjustments while playing."""


TODAY = {"turn": "", "way": "today", "arrow": ""}
"""What stands beside a reading of today: nothing is turned yet."""


@dataclass
class PlaybackState:
    """One row of the schedule as it is shown.

    Attributes
    ----------
    row, last : int
        The shown row and the last one; row 0 is today.
    struts : list of dict
        value, turn, way (``longer``, ``shorter``, ``no turn`` or ``today``), arrow.
    curves : str
        Curves of all struts with the shown row marked, as a data address.
    """

    shown: bool = False
    fresh: bool = True
    row: int = 0
    last: int = 0
    playing: bool = False
    when: str = ""
    struts: list = field(default_factory=list)
    curves: str = ""


class Playback:
    """Moves frame and bone through the plan."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, PlaybackState)
        self._playback: Any = None
        self._rows: tuple[tuple[str, ...], ...] = ()
        self._document: Any = None
        self._task: asyncio.Task | None = None

    def build(self) -> None:
        """Make the bar under the views."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._name
        with html.Div(
            v_if=name.shown,
            classes=(f"['hxp-playback', {name.fresh} ? '' : 'hxp-stale']",),
            **marked("playback", label="Playback of the correction", data_row=(name.row,)),
        ):
            with html.Div(classes="hxp-row hxp-playback-bar"):
                icon_button("mdi-skip-backward", "Today", "play-first", (self._go, "[0]"))
                icon_button("mdi-chevron-left", "Adjustment before", "play-back", self._back)
                icon_button(
                    (f"{name.playing} ? 'mdi-pause' : 'mdi-play'",),
                    (f"{name.playing} ? 'Pause' : 'Play'",),
                    "play",
                    self._toggle,
                )
                icon_button("mdi-chevron-right", "Next adjustment", "play-next", self._next)
                v.VSlider(
                    model_value=(name.row,),
                    update_modelValue=(self._go, "[$event]"),
                    min=0,
                    max=(name.last,),
                    step=1,
                    density="compact",
                    hide_details=True,
                    color="primary",
                    classes="hxp-slider",
                    **marked("play-slider", label="Adjustment of the plan"),
                )
                html.Span(
                    f"{{{{ {name.when} }}}}{{{{ {name.fresh} ? '' : ' · out of date' }}}}",
                    classes="hxp-when",
                    **marked("play-when", role="status"),
                )
            with (
                html.Div(classes="hxp-cells"),
                html.Div(
                    v_for=f"(strut, i) in {name.struts}",
                    key="i",
                    classes="hxp-cell",
                    **marked(("'play-strut-' + (i + 1)",)),
                ),
            ):
                badge("i")
                html.Span(
                    "{{ strut.value }}", classes="hxp-value", **marked(("'play-value-' + (i + 1)",))
                )
                html.Span("mm", classes="hxp-unit")
                html.Span(
                    "{{ strut.arrow }} {{ strut.turn }} {{ strut.way }}",
                    classes="hxp-turn",
                    **marked(("'play-turn-' + (i + 1)",)),
                )

    def build_curves(self) -> None:
        """Make the curves of all struts with the shown row marked."""
        picture(self._name.curves, "Scale value of each strut over the days", "strut-curves")

    def take(self, snapshot: Snapshot, playback: Any, plan: Any) -> None:
        """Take another plan, shown from today on.

        Parameters
        ----------
        snapshot : Snapshot
        playback : Playback or None
            The pipeline's rows with their poses.
        plan : Plan or None
        """
        table = snapshot.tables.get("strut_plan")
        self._stop()
        self._playback = playback
        self._rows = table.rows if table and playback else ()
        self._document = None
        if plan is not None:
            from hexafix.pipeline import plan_document_of

            self._document = plan_document_of(plan)
        self._data.shown = bool(self._rows)
        self._data.last = max(len(self._rows) - 1, 0)
        if self._rows:
            self._show(0, views=False)
        self._context.controls.show_playback_row(None)

    def update(self, fresh: bool) -> None:
        """Grey the playback of a plan that is not of the present inputs."""
        self._data.fresh = fresh

    def close(self) -> None:
        """Stop playing."""
        self._stop()

    def _show(self, row: int, *, views: bool = True) -> None:
        from hexafix.pipeline import strut_curves_at
        from hexafix.pipeline.text import format_change

        words = self._rows[row][3:]
        before = self._rows[max(row - 1, 0)][3:]
        turned = self._playback.rows[row].turned_mm
        self._data.row = row
        self._data.when = when_words(self._rows[row], self._rows[-1][0])
        self._data.struts = [
            {"value": value, **(turn_words(float(by), change) if row else TODAY)}
            for value, by, change in zip(words, turned, format_change(before, words), strict=True)
        ]
        self._data.curves = data_address(strut_curves_at(self._document, row), "image/svg+xml")
        if views:
            self._context.controls.show_playback_row(row)

    def _go(self, row: float) -> None:
        if self._rows and 0 <= row <= self._data.last:
            self._show(int(row))

    def _next(self) -> None:
        self._go(self._data.row + 1)

    def _back(self) -> None:
        self._go(self._data.row - 1)

    def _toggle(self) -> None:
        if self._data.playing:
            self._stop()
            return
        if self._data.row == self._data.last:
            self._show(0)
        self._data.playing = True
        self._task = asyncio.get_running_loop().create_task(self._play())

    async def _play(self) -> None:
        state, clock = self._context.server.state, asyncio.get_running_loop().time
        while self._data.row < self._data.last:
            due = clock() + STEP_S
            await asyncio.sleep(STEP_S)
            # a machine that is late drawing gets as much time again, so that clicks come through
            await asyncio.sleep(max(0.0, clock() - due))
            with state:
                self._next()
        with state:
            self._data.playing = False

    def _stop(self) -> None:
        if self._task is not None:
            self._task.cancel()
            self._task = None
        self._data.playing = False


def when_words(row: tuple[str, ...], days: str) -> str:
    """Day, date and adjustment of a row of the schedule."""
    day, date, adjustment = row[:3]
    if day == "0":
        return f"today: the readings, before day 1 ({date})"
    return f"day {day} of {days} · {date} · adjustment {adjustment}"


def turn_words(turned: float, change: str) -> dict[str, str]:
    """How a strut is turned, in a word and an arrow beside the amount (H42).

    Parameters
    ----------
    turned : float
        Its sign alone is read.
    change : str
        The amount without sign.
    """
    if turned > 0:
        return {"turn": change, "way": "longer", "arrow": "▲"}
    if turned < 0:
        return {"turn": change, "way": "shorter", "arrow": "▼"}
    return {"turn": "", "way": "no turn", "arrow": ""}
