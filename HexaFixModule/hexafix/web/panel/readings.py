"""Step 5: the six strut readings, entered twice and compared with the CT."""

from __future__ import annotations

from dataclasses import dataclass, field

from hexafix.web.panel.context import PanelContext, number, typed_state
from hexafix.web.panel.struts import badge
from hexafix.web.panel.widgets import field as text_field
from hexafix.web.panel.widgets import marked, note, table


@dataclass
class ReadingsState:
    """The second entry, as it is written.

    Attributes
    ----------
    again : list of str
        Six texts.
    """

    again: list = field(default_factory=lambda: [""] * 6)


class ReadingsStep:
    """Readings, second entry, comparison with the CT."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, ReadingsState)

    def build(self) -> None:
        """Make the step's fields and table."""
        from trame.widgets import html

        context, form = self._context, self._context.name.form
        note("The value on each strut's scale today, in mm.")
        with (
            html.Div(classes="hxp-readings", **marked("readings")),
            html.Div(v_for=f"(reading, i) in {form}.readings", key="i", classes="hxp-reading"),
        ):
            badge("i")
            text_field(
                context,
                "reading",
                ("'Strut ' + (i + 1)",),
                "reading",
                self._set,
                "i, ",
                key=("'reading-' + (i + 1)",),
                suffix="mm",
            )
            text_field(
                context,
                "again",
                ("'Strut ' + (i + 1) + ' again'",),
                f"{self._name.again}[i]",
                self._repeat,
                "i, ",
                key=("'again-' + (i + 1)",),
                suffix="mm",
                v_if=f"{context.name.confirmed}.readings_needed",
            )
        with html.Div(v_if=f"{context.name.confirmed}.readings_needed", classes="hxp-note"):
            html.Span("Readings typed here are read from the frame a second time. ")
            html.B(
                f"{{{{ {context.name.confirmed}.readings ? 'Both entries agree.'"
                " : 'The second entry is missing or differs.' }}",
                **marked("readings-agree", data_agree=(f"{context.name.confirmed}.readings",)),
            )
        table(
            context,
            "struts",
            "Readings against the CT",
            empty="They are compared with the CT once the ring poses are known.",
        )

    def clear(self) -> None:
        """Forget the second entry: the first has changed."""
        self._data.again = [""] * 6

    def _set(self, index: int, text: str) -> None:
        context, where = self._context, f"strut_readings_mm[{index}]"
        name = f"reading-{index + 1}"
        context.act(
            lambda: context.presenter.set_reading(index + 1, number(text, where=where)), field=name
        )

    def _repeat(self, index: int, text: str) -> None:
        again = list(self._data.again)
        again[index] = text.strip()
        self._data.again = again
        if not all(again):
            return
        name = f"again-{index + 1}"

        def work() -> None:
            values = [
                number(words, where=f"second entry of strut {i}")
                for i, words in enumerate(again, start=1)
            ]
            self._context.presenter.repeat_readings(values)

        self._context.act(work, field=name)
