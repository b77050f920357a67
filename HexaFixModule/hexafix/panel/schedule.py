"""The page of the schedule and its playback."""

from __future__ import annotations

import datetime
from typing import TYPE_CHECKING, Any

from hexafix.panel.binding import Binding, Fill, button, idle, shown, switch, table
from hexafix.panel.rows import RowsTable
from hexafix.panel.text import at, maybe_number_of, text_of
from hexafix.presenter import Step

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

COMPENSATIONS = ("fused", "additive", "none")

FIELDS = {
    "strutStepLineEdit": ("strut_step_mm", "the strut step"),
    "maxRateLineEdit": ("max_rate_mm_per_day", "the rate"),
    "maxTurnLineEdit": ("max_rate_deg_per_day", "the rotation a day"),
}

RISK = "structures_at_risk_lps_mm"


def _held(snapshot: Snapshot) -> dict[str, Any] | None:
    return at(snapshot.document, "schedule")


def form(panel: Panel) -> dict[str, Any]:
    """The schedule that the form holds; what is left empty is the case file's default."""
    get = panel.widgets.get
    found: dict[str, Any] = {
        "start_date": get("startDateEdit", "date"),
        "adjustments_per_day": get("adjustmentsSpinBox", "value"),
        "compensation": COMPENSATIONS[max(0, get("compensationComboBox", "index"))],
    }
    for name, (key, what) in FIELDS.items():
        value = maybe_number_of(get(name, "text"), what)
        if value is not None:
            found[key] = value
    points = RISKS.complete(panel)
    if points:
        found[RISK] = points
    return found


def use(panel: Panel, _: Any) -> None:
    """Put the form's schedule into the case."""
    if panel.presenter.set_schedule(form(panel)):
        RISKS.settle(panel)


def _put(key: str, panel: Panel, value: Any) -> None:
    held = _held(panel.snapshot)
    if held is not None:
        kept = {name: old for name, old in held.items() if name != key}
        panel.presenter.set_schedule(kept if value is None else {**held, key: value})


def _shown(key: str, default: Any) -> Fill:
    def fill(_: Panel, snapshot: Snapshot) -> Any:
        held = _held(snapshot)
        return None if held is None else held.get(key, default)

    return fill


def _number_field(name: str) -> Binding:
    key, what = FIELDS[name]

    def text(_: Panel, snapshot: Snapshot) -> str | None:
        held = _held(snapshot)
        return None if held is None else text_of(held.get(key))

    return Binding(
        name,
        "edited",
        lambda panel, typed: _put(key, panel, maybe_number_of(typed, what)),
        (("text", text),),
    )


def _date(_: Panel, snapshot: Snapshot) -> str:
    given = str(at(snapshot.document, "schedule", "start_date") or "")
    try:
        return datetime.date.fromisoformat(given).isoformat()
    except ValueError:
        return datetime.date.today().isoformat()


def _compensation(_: Panel, snapshot: Snapshot) -> int | None:
    held = _held(snapshot)
    given = held.get("compensation", "fused") if held else None
    return COMPENSATIONS.index(given) if given in COMPENSATIONS else None


RISKS = RowsTable(
    "riskPointsTable",
    ("L mm", "P mm", "S mm"),
    lambda _, snapshot: [
        [text_of(value) for value in point]
        for point in at(snapshot.document, "schedule", RISK) or ()
    ],
    lambda panel, rows: _put(RISK, panel, rows or None),
)


def state(_: Panel, snapshot: Snapshot) -> str:
    """Whether a schedule stands in the case."""
    if _held(snapshot) is None:
        return "⚠ No schedule stands in the case. Fill the form, then press “Use this schedule”."
    return "✓ In use. What you change here goes into the case at once."


def _curves(panel: Panel, snapshot: Snapshot) -> bytes | None:
    if snapshot.current != Step.SCHEDULE:
        return None
    return panel.pictures().get("strut_curves", "").encode()


def _playback_text(panel: Panel, snapshot: Snapshot) -> str:
    plan = snapshot.tables.get("strut_plan")
    if plan is None or not plan.rows:
        return "Compute the schedule to see it day by day."
    row = plan.rows[min(panel.playback_row, len(plan.rows) - 1)]
    named = zip(plan.columns, row, strict=True)
    text = " · ".join(f"{column.removesuffix(' mm')} {cell}" for column, cell in named)
    return f"{text} mm" + (" — out of date" if plan.stale else "")


def _last_row(panel: Panel, snapshot: Snapshot) -> int:
    return max(0, len(panel.table("strut_plan").rows) - 1)


def _has_rows(panel: Panel, _: Snapshot) -> bool:
    return bool(panel.table("strut_plan").rows)


def _plan_row(panel: Panel, index: int) -> None:
    if index >= 0:
        panel.show_playback(index)


BINDINGS: tuple[Binding, ...] = (
    Binding(
        "startDateEdit",
        "dated",
        lambda panel, date: _put("start_date", panel, date),
        (("date", _date),),
    ),
    Binding(
        "adjustmentsSpinBox",
        "moved",
        lambda panel, value: _put("adjustments_per_day", panel, value),
        (("value", _shown("adjustments_per_day", 4)),),
    ),
    *(_number_field(name) for name in FIELDS),
    Binding(
        "compensationComboBox",
        "picked",
        lambda panel, index: _put("compensation", panel, COMPENSATIONS[index]),
        (("index", _compensation),),
    ),
    button(
        "useScheduleButton",
        use,
        enabled=lambda _, snapshot: _held(snapshot) is None,
    ),
    button("planButton", lambda panel, _: panel.run(Step.SCHEDULE), enabled=idle),
    shown("scheduleStateLabel", "text", state),
    table("strutPlanTable", "strut_plan", _plan_row),
    table("scheduleTable", "schedule"),
    shown("strutCurvesPicture", "picture", _curves),
    *RISKS.bindings("addRiskPointButton", "removeRiskPointButton"),
    switch(
        "pickRiskPointButton",
        lambda panel, on: panel.pick("pickRiskPointButton" if on else ""),
        lambda panel, _: panel.picking == "pickRiskPointButton",
    ),
    switch(
        "playButton",
        lambda panel, on: panel.play(on),
        lambda panel, _: panel.playing,
        enabled=_has_rows,
    ),
    Binding(
        "playbackSlider",
        "moved",
        lambda panel, row: panel.show_playback(row),
        (
            ("maximum", _last_row),
            ("value", lambda panel, _: panel.playback_row),
            ("enabled", _has_rows),
        ),
    ),
    shown("playbackLabel", "text", _playback_text),
)
