"""Step 7: the rules of the schedule, the planned struts and their curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from hexafix.web.panel.context import PanelContext, number, whole_number
from hexafix.web.panel.risk import RiskPoints
from hexafix.web.panel.widgets import button, choice, field, marked, note, table
from hexafix.web.state import NUMBERS_OF_SCHEDULE

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

LABELS = {
    "adjustments_per_day": ("Adjustments a day", ""),
    "strut_step_mm": ("Smallest strut step", "mm"),
    "max_rate_mm_per_day": ("Fastest motion", "mm/day"),
    "max_rate_deg_per_day": ("Fastest rotation", "deg/day"),
}

COMPENSATION = (
    "[{title: 'fused: CT and struts weighed', value: 'fused'}, "
    "{title: 'additive: paper, Eq. 32', value: 'additive'}, {title: 'none', value: 'none'}]",
)


class ScheduleStep:
    """How fast and in which steps the patient turns; the plan.

    Parameters
    ----------
    context : PanelContext
    curves : callable
        Makes the picture of the struts' curves.
    """

    def __init__(self, context: PanelContext, curves: Callable[[], None]) -> None:
        self._context, self._curves = context, curves
        self._risk = RiskPoints(context)

    def build(self) -> None:
        """Make the step's fields, tables and curves."""
        from trame.widgets import html

        context, form = self._context, f"{self._context.name.form}.schedule"
        with html.Div(classes="hxp-grid-2"):
            field(
                context,
                "schedule-start_date",
                "First day (YYYY-MM-DD)",
                f"{form}.start_date",
                self._set,
                "'start_date', ",
            )
            for key in NUMBERS_OF_SCHEDULE:
                label, unit = LABELS[key]
                field(
                    context,
                    f"schedule-{key}",
                    label,
                    f"{form}.{key}",
                    self._set,
                    f"'{key}', ",
                    suffix=unit,
                )
            with html.Div(classes="hxp-whole"):
                choice(
                    context,
                    "schedule-compensation",
                    "Compensation",
                    f"{form}.compensation",
                    COMPENSATION,
                    self._compensation,
                )
        note(
            "The fastest motion is that of the structures at risk, where the case names them, "
            "else of the moving ring."
        )
        self._risk.build()
        button(
            "Plan",
            "run-schedule",
            self._run,
            icon="mdi-calendar-check",
            primary=True,
            disabled=(context.name.busy,),
        )
        table(context, "schedule", "The plan", empty="Nothing is planned yet.")
        self._curves()
        with html.Details(
            v_if=f"{context.name.table_strut_plan}.rows.length",
            classes="hxp-details",
            **marked("schedule-details"),
        ):
            html.Summary(
                f"Schedule, all {{{{ {context.name.table_strut_plan}.rows.length }}}} rows",
                **marked("schedule-summary"),
            )
            table(context, "strut_plan", "Scale values to set, mm")

    def update(self, snapshot: Snapshot) -> None:
        """Show the document's structures at risk."""
        self._risk.update(snapshot.document)

    def stop(self) -> None:
        """Wait for no click any more."""
        self._risk.stop()

    def _set(self, key: str, text: str) -> None:
        where, name = f"schedule.{key}", f"schedule-{key}"

        def work() -> None:
            if key == "start_date":
                value: Any = text.strip()
            elif key == "adjustments_per_day":
                value = whole_number(text, where=where)
            else:
                value = number(text, where=where)
            self._edit({key: value})

        self._context.act(work, field=name)

    def _compensation(self, value: str) -> None:
        self._context.act(
            lambda: self._edit({"compensation": value}), field="schedule-compensation"
        )

    def _edit(self, change: Mapping[str, Any]) -> None:
        given = self._context.presenter.snapshot.document.get("schedule") or {}
        self._context.presenter.set_schedule({**given, **change})

    def _run(self) -> None:
        from hexafix.presenter import Step

        self._context.plan(lambda: self._context.presenter.run(Step.SCHEDULE))
