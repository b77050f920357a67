"""Step 3: which ball carries which number, by two clicks, with the judgement live."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.layout import LayoutEditor
from hexafix.web.panel.widgets import button, icon_button, marked, note

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

RINGS = ("proximal", "distal")


@dataclass
class NumberingState:
    """The judged numbering as tiles.

    Attributes
    ----------
    picked : str
        The number that waits for a second click; empty for none.
    rings : list of dict
        ring, words (RMS and next best), numbers (number, ball, residual).
    balls : list of dict
        name, number.
    settled : str
        How the numbering was settled.
    """

    picked: str = ""
    rings: list = field(default_factory=list)
    balls: list = field(default_factory=list)
    settled: str = ""
    automatic: bool = True
    stale: bool = False


SETTLED = {
    "layout": "settled by the layout",
    "strut-readings": "settled by the strut readings",
    "user": "given by the user",
}


class NumberingStep:
    """Numbers as tiles: click two to swap them, click one and a ball to assign it."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._layout = LayoutEditor(context)
        self.data, self.name = typed_state(context.server, NumberingState)

    def build(self) -> None:
        """Make the tiles of both rings and the strip of balls."""
        from trame.widgets import html

        name, context = self.name, self._context
        with html.Div(classes="hxp-row"):
            button(
                "Number automatically",
                "number-automatically",
                self._automatically,
                icon="mdi-auto-fix",
                primary=True,
                disabled=(f"{context.name.busy} || !{name.balls}.length",),
            )
            html.Span(f"{{{{ {name.settled} }}}}", classes="hxp-note", **marked("settled-by"))
        note(
            "Click two numbers to swap them; click a number, then a ball (here or in a view), to "
            "give that ball the number."
        )
        with html.Div(
            v_for=f"ring in {name.rings}",
            key="ring.ring",
            classes=(f"['hxp-ring', {name.stale} ? 'hxp-stale' : '']",),
            **marked(("'ring-' + ring.ring",), data_stale=(name.stale,)),
        ):
            with html.Div(classes="hxp-ring-head"):
                html.B("{{ ring.ring }} ring")
                html.Span("{{ ring.words }}", **marked(("'ring-words-' + ring.ring",)))
            with html.Div(classes="hxp-tiles"):
                self._tile()
        html.Div("Balls", classes="hxp-title", v_if=f"{name.balls}.length")
        with html.Div(classes="hxp-tiles", **marked("ball-strip")):
            html.Button(
                "{{ ball.name }}{{ ball.number ? ' = no. ' + ball.number : ' free' }}",
                v_for=f"(ball, i) in {name.balls}",
                key="i",
                type="button",
                classes="hxp-ball",
                click=(self.ball_clicked, "[i]"),
                **marked(("'ball-chip-' + i",)),
            )
        self._layout.build()

    def _tile(self) -> None:
        from trame.widgets import html

        name = self.name
        with html.Div(v_for="item in ring.numbers", key="item.number", classes="hxp-tile-box"):
            with html.Button(
                type="button",
                classes=(f"['hxp-tile', {name.picked} === item.number ? 'hxp-picked' : '']",),
                click=(self.number_clicked, "[item.number]"),
                **marked(
                    ("'number-' + item.number",),
                    label=("'Number ' + item.number + ', ' + (item.ball || 'no ball')",),
                    aria_pressed=(f"{name.picked} === item.number",),
                    data_ball=("item.ball",),
                ),
            ):
                html.Span("{{ item.number }}", classes="hxp-number")
                html.Span("{{ item.ball || 'no ball' }}")
                html.Span("{{ item.residual }}", classes="hxp-residual")
            icon_button(
                "mdi-close",
                ("'Take number ' + item.number + ' off its ball'",),
                ("'clear-number-' + item.number",),
                (self._clear, "[item.number]"),
                in_row=True,
                v_if=f"item.ball && {name.picked} === item.number",
                classes="hxp-clear",
            )

    def number_clicked(self, number: str) -> None:
        """Pick a number, let it go, or swap it with the picked one."""
        picked = self.data.picked
        if not picked:
            self.data.picked = number
        else:
            self.data.picked = ""
            if picked != number:
                presenter = self._context.presenter
                self._context.act(lambda: presenter.swap_numbers(int(picked), int(number)))

    def ball_clicked(self, index: int) -> bool:
        """Give the picked number to a ball; whether a number was picked."""
        picked = self.data.picked
        if not picked:
            self._context.controls.select_ball(index)
            return False
        self.data.picked = ""
        self._context.act(lambda: self._context.presenter.assign_number(int(picked), index))
        return True

    def update(self, snapshot: Snapshot, judged: Mapping[str, Any] | None, fresh: bool) -> None:
        """Bring the tiles to the judgement.

        Parameters
        ----------
        snapshot : Snapshot
        judged : mapping or None
            The numbering's document, as the pipeline judges it.
        fresh : bool
            Whether it is of the present inputs.
        """
        judged = judged or {"assigned": {}, "rings": {}}
        found = snapshot.tables.get("balls")
        rows = found.rows if found else ()
        residuals = _residuals(snapshot)
        taken = {index: number for number, index in judged["assigned"].items()}
        markers = snapshot.document.get("markers") or {}
        self.data.rings = [
            {
                "ring": ring,
                "words": ring_words(judged["rings"].get(ring)),
                "numbers": [
                    {
                        "number": str(site["number"]),
                        "ball": _ball(judged["assigned"].get(str(site["number"]))),
                        "residual": residuals.get(str(site["number"]), ""),
                    }
                    for site in markers.get(ring) or ()
                    if site["number"] is not None
                ],
            }
            for ring in RINGS
        ]
        self.data.balls = [
            {"name": f"Ball {row[0]}", "number": taken.get(index, "")}
            for index, row in enumerate(rows)
        ]
        self.data.settled = SETTLED.get(str(judged.get("settled_by")), "")
        self.data.automatic = snapshot.document.get("numbering") is None
        self.data.stale = not fresh and bool(judged["assigned"])
        self._layout.update(snapshot)

    def _clear(self, number: str) -> None:
        self.data.picked = ""
        self._context.act(lambda: self._context.presenter.clear_number(int(number)))

    def _automatically(self) -> None:
        self.data.picked = ""
        self._context.act(self._context.presenter.number_automatically)


def ring_words(found: Mapping[str, Any] | None) -> str:
    """How well a ring's numbers fit, and how far the next best numbering is."""
    from hexafix.pipeline.text import format_margin, format_mm

    if not found:
        return ""
    words = f"{found['assigned']} of {found['markers']} numbered"
    if found.get("rms_mm") is not None:
        words += f" · RMS {format_mm(found['rms_mm'])} mm"
    if found.get("next_best_mm") is not None:
        words += f" · next best numbering {format_margin(found['next_best_mm'])} mm"
    return words


def _residuals(snapshot: Snapshot) -> dict[str, str]:
    """Each number's residual in the words of the snapshot's table."""
    table = snapshot.tables.get("numbering")
    if table is None:
        return {}
    return {row[0]: f"{row[3]} mm" for row in table.rows if row[3] != "-"}


def _ball(index: int | None) -> str:
    return "" if index is None else f"ball {index + 1}"
