"""The snapshot of the presenter's state: every text made ready here."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hexafix.errors import Fault
from hexafix.presenter import notices, tables
from hexafix.presenter.inputs import ORDER
from hexafix.presenter.results import Result
from hexafix.presenter.state import TITLES, Banner, Snapshot, Step, StepState, StepView, Table

if TYPE_CHECKING:
    from hexafix.presenter.core import Core

SUMMARIES = {
    StepState.WAITING: "something is still missing",
    StepState.READY: "ready to run",
    StepState.RUNNING: "running",
    StepState.DONE: "done",
    StepState.STALE: "shows a result of older inputs: run it again",
    StepState.REFUSED: "refused",
}


def snapshot_of(core: Core) -> Snapshot:
    """Everything a door shows now."""
    version, history = core.version, core.history
    steps = tuple(_step(core, step) for step in ORDER)
    confirmed = confirmations(core)
    blocked = export_blocked_by(core, steps, confirmed)
    exported = core.exported
    case_id = version.content.get("case_id")
    return Snapshot(
        case_id=case_id if isinstance(case_id, str) else "",
        case_path=None if core.case_path is None else str(core.case_path),
        edited=version.raw != core.saved if core.saved is not None else bool(history.undo_label),
        can_undo=bool(history.undo_label),
        undo_label=history.undo_label,
        can_redo=bool(history.redo_label),
        redo_label=history.redo_label,
        steps=steps,
        current=core.current,
        busy=core.job is not None,
        progress=core.progress,
        banners=_banners(core, steps),
        document=MappingProxyType(copy.deepcopy(dict(version.content))),
        tables=MappingProxyType(_tables(core)),
        can_export=not blocked,
        export_blocked_by=blocked,
        export_folder=exported[1] if exported and exported[0] == core.key(Step.EXPORT) else None,
        confirmed=MappingProxyType(confirmed),
    )


def _step(core: Core, step: Step) -> StepView:
    found = core.result(step)
    missing = core.inputs.faults_before(step)
    faults = core.inputs.faults_shown_at(step)
    state = StepState.READY
    if core.running == step:
        state = StepState.RUNNING
    elif found is not None and found.faults:
        state, faults = StepState.REFUSED, (*faults, *found.faults)
    elif core.is_done(step):
        state = StepState.DONE
    elif core.results.shown(step) is not None and found is None:
        state = StepState.STALE
    elif missing or found is not None:
        state = StepState.WAITING
    summary = SUMMARIES[state]
    if state in (StepState.REFUSED, StepState.WAITING) and (faults or missing):
        summary = (faults or missing)[0].message
    return StepView(step, TITLES[step], state, summary, faults)


def confirmations(core: Core) -> dict[str, bool]:
    """What the user has confirmed, and what this case asks for."""
    content = core.version.content
    limb = content.get("limb")
    side = limb.get("side") if isinstance(limb, Mapping) else None
    readings = content.get("strut_readings_mm")
    needed = readings is not None and readings != core.readings_given
    front = content.get("ring_front_confirmed")
    return {
        "side": side is not None and core.side_confirmed == side,
        "readings": readings is not None and (not needed or core.readings_repeated == readings),
        "readings_needed": needed,
        "ring_front": front is True,
        "ring_front_needed": front is not None,
        "relaxed_layout": core.version.relaxed,
    }


def export_blocked_by(
    core: Core, steps: tuple[StepView, ...], confirmed: Mapping[str, bool]
) -> str:
    """Why there can be no export now, with the next step; empty if there can."""
    if core.job is not None:
        return "work is under way: wait until it is done"
    for view in steps:
        if view.state == StepState.STALE:
            return f"{view.title}: the result is of older inputs; run this step again"
        if view.state == StepState.REFUSED:
            return f"{view.title}: refused; see the message"
        if view.state != StepState.DONE:
            return f"{view.title}: not done; {view.summary}"
    if not confirmed["side"]:
        return "confirm the side of the limb a second time"
    if not confirmed["readings"]:
        return "read all six struts a second time and enter the values again"
    if confirmed["ring_front_needed"] and not confirmed["ring_front"]:
        return "confirm in the picture that the front of both rings is where the case says"
    return ""


def _banners(core: Core, steps: tuple[StepView, ...]) -> tuple[Banner, ...]:
    found = list(core.notices)
    for view in steps:
        result = core.result(view.step)
        if result is not None:
            kind = "error" if result.kind == "error" else "refused"
            found += [notices.banner(fault, kind=kind, step=view.step) for fault in result.faults]
            found += [
                notices.banner(Fault("warning", text), kind="warning", step=view.step)
                for text in result.document.get("warnings", ())
            ]
    return notices.sorted_banners(found)


def _tables(core: Core) -> dict[str, Table]:
    made: dict[str, Table] = {}
    if core.series is not None:
        made["series"] = tables.series(core.series)
    for step in ORDER:
        result = core.results.shown(step)
        if result is not None:
            stale = not core.is_fresh(step)
            for name, table in _tables_of(core, result).items():
                made[name] = Table(table.columns, table.rows, table.alerts, stale)
    return made


def _tables_of(core: Core, result: Result) -> dict[str, Table]:
    document: Any = result.document
    match result.step:
        case Step.LOAD:
            return {"image": tables.image(document)}
        case Step.MARKERS:
            judged = core.results.shown(Step.NUMBERING)
            assigned = (
                judged.document["assigned"] if judged and core.is_fresh(Step.NUMBERING) else {}
            )
            numbers = {ball: number for number, ball in assigned.items()}
            return {
                "balls": tables.balls(document, numbers),
                "rejected": tables.rejected(document),
            }
        case Step.NUMBERING:
            return {"numbering": tables.numbering(document)}
        case Step.POSES:
            return {"poses": tables.poses(document), "gates": tables.gates(document["gates"])}
        case Step.SCHEDULE:
            return {
                "schedule": tables.schedule(document),
                "strut_plan": tables.strut_plan(document),
            }
    return {}
