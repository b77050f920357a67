"""The snapshot of the presenter's state: every text made ready here."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hexafix.errors import Fault
from hexafix.presenter import notices, tables
from hexafix.presenter.compute import defect
from hexafix.presenter.inputs import ORDER, is_missing
from hexafix.presenter.places import plain_text
from hexafix.presenter.results import Result
from hexafix.presenter.state import TITLES, Banner, Snapshot, Step, StepState, StepView, Table

if TYPE_CHECKING:
    from hexafix.presenter.core import Core

SUMMARIES = {
    StepState.WAITING: "something is still missing",
    StepState.READY: "ready to run",
    StepState.RUNNING: "running",
    StepState.DONE: "done",
    StepState.STALE: "what is shown is of older inputs: run this step again",
    StepState.REFUSED: "refused",
}

TABLES = (
    *("series", "image", "balls", "rejected", "numbering", "poses", "gates", "layout"),
    *("struts", "target", "schedule", "strut_plan"),
)
"""Names of the snapshot's tables; one without content is empty."""


def snapshot_of(core: Core) -> Snapshot:
    """Everything a door shows now."""
    history, content = core.history, core.version.content
    steps = tuple(_step(core, step) for step in ORDER)
    blocked = export_blocked_by(core)
    exported, case_id = core.exported, content.get("case_id")
    return Snapshot(
        case_id=case_id if isinstance(case_id, str) else "",
        case_path=None if core.case_path is None else str(core.case_path),
        edited=core.edited,
        can_undo=history.can_undo,
        undo_label=history.undo_label,
        can_redo=history.can_redo,
        redo_label=history.redo_label,
        steps=steps,
        current=core.current,
        busy=core.job is not None,
        progress=core.progress if core.job is not None else None,
        banners=notices.sorted_banners(_banners(core)),
        document=MappingProxyType(core.inputs.document),
        tables=MappingProxyType(_tables(core)),
        can_export=not blocked,
        export_blocked_by=blocked,
        export_folder=exported[1] if exported and exported[0] == core.key(Step.EXPORT) else None,
        confirmed=MappingProxyType(confirmations(core)),
    )


def without_content(before: Snapshot, error: Exception, *, busy: bool) -> Snapshot:
    """What is shown where a defect keeps the present state from being shown: no export of it."""
    fault = defect(error)
    return replace(
        before,
        busy=busy,
        progress=None,
        banners=(notices.banner(fault, kind="error"),),
        tables=MappingProxyType(dict.fromkeys(TABLES, Table(()))),
        can_export=False,
        export_blocked_by=fault.what,
        export_folder=None,
    )


# ---------------------------------------------------------------- steps


def _step(core: Core, step: Step) -> StepView:
    found = core.result(step)
    missing = core.inputs.faults_before(step)
    faults = core.inputs.faults_shown_at(step)
    state = _state(core, step, found, missing)
    if found is not None:
        faults = (*faults, *found.faults)
    summary = SUMMARIES[state]
    if state == StepState.DONE and found is not None:
        summary = tables.summary(step, found.document)
    if state in (StepState.REFUSED, StepState.WAITING):
        wrong = found.faults if found is not None else ()
        summary = _first_words([*wrong, *(f for f in missing if f in faults), *missing]) or summary
    return StepView(step, TITLES[step], state, summary, faults)


def _first_words(faults: list[Fault]) -> str:
    """What is wrong first, or what is to be done where something is only missing."""
    if not faults:
        return ""
    first = faults[0]
    return plain_text(first.next_step if is_missing(first) and first.next_step else first.what)


def _state(core: Core, step: Step, found: Result | None, missing: tuple[Fault, ...]) -> StepState:
    if core.job is not None and core.running == step:
        return StepState.RUNNING
    if found is not None:
        if not all(is_missing(fault) for fault in found.faults):
            return StepState.REFUSED
        return StepState.DONE if found.done else StepState.WAITING
    if core.results.shown(step) is not None:
        return StepState.STALE
    return StepState.WAITING if missing else StepState.READY


# ---------------------------------------------------------------- what is asked of the user


def confirmations(core: Core) -> dict[str, bool]:
    """What the user has confirmed, and what this case asks for."""
    content, side = core.version.content, core.side
    readings = content.get("strut_readings_mm")
    needed = readings is not None and readings != core.readings_opened
    front = content.get("ring_front_confirmed")
    return {
        "side": side is not None and core.side_answer == (side, core.side_image),
        "readings": readings is not None and (not needed or core.readings_repeated == readings),
        "readings_needed": needed,
        "ring_front": front is True,
        "ring_front_needed": front is not None,
        "relaxed_layout": core.version.relaxed,
    }


def export_blocked_by(core: Core) -> str:
    """Why there can be no export now, with the next step; empty if there can."""
    if core.job is not None:
        return "work is under way: wait until it is done"
    for step in ORDER:
        if not core.is_done(step):
            view = _step(core, step)
            return f"{view.title}: {view.summary}"
    asked = _unanswered(core)
    return asked[0].what if asked else ""


def _unanswered(core: Core) -> list[Fault]:
    """What the user has still to confirm before an export."""
    confirmed, found = confirmations(core), []
    if not confirmed["side"]:
        found.append(notices.SIDE_ASKED)
    if not confirmed["readings"]:
        found.append(notices.READINGS_ASKED)
    if confirmed["ring_front_needed"] and not confirmed["ring_front"]:
        found.append(notices.FRONT_ASKED)
    return found


# ---------------------------------------------------------------- banners


def _banners(core: Core) -> Iterator[Banner]:
    yield from core.notices
    yield from _contradictions(core)
    for step in ORDER:
        for fault in core.inputs.faults_shown_at(step):
            if not is_missing(fault):
                yield notices.banner(fault, kind="error", step=step)
        result = core.result(step)
        if result is None:
            continue
        for fault in result.faults:
            kind = "info" if is_missing(fault) else result.kind
            yield notices.banner(fault, kind=kind, step=step)
        for text in result.document.get("warnings", ()):
            yield notices.banner(Fault("warning", text), kind="warning", step=step)
    weighed = core.result(Step.READINGS)
    for strut in weighed.document.get("struts", ()) if weighed is not None else ():
        if strut["verdict"] == "read-again":
            fault = notices.read_again(strut["strut"], strut["difference_mm"])
            yield notices.banner(fault, kind="warning", step=Step.READINGS)
    if core.job is None and core.is_done(Step.EXPORT):
        for fault in _unanswered(core):
            yield notices.banner(fault, kind="info", step=Step.EXPORT)


def _contradictions(core: Core) -> Iterator[Banner]:
    """Second answers that are not the first (H24, H37)."""
    side, answer = core.side, core.side_answer
    if answer is not None and answer[1] == core.side_image and answer[0] != side:
        yield notices.banner(notices.side_conflict(answer[0], side), kind="refused", step=Step.LOAD)
    confirmed = confirmations(core)
    first, second = core.version.content.get("strut_readings_mm"), core.readings_repeated
    asked = confirmed["readings_needed"] and not confirmed["readings"]
    if asked and isinstance(first, list) and second is not None:
        for strut, (one, other) in enumerate(zip(first, second, strict=False), 1):
            if one != other:
                yield notices.banner(
                    notices.reading_differs(strut, one, other), kind="refused", step=Step.READINGS
                )


# ---------------------------------------------------------------- tables


def _tables(core: Core) -> dict[str, Table]:
    made = dict.fromkeys(TABLES, Table(()))
    if core.series is not None:
        made["series"] = tables.series(core.series)
    if core.layout[1] is not None:
        made["layout"] = tables.layout(core.layout[1])
    cache, kept = core.tables, {}
    for step in ORDER:
        result = core.results.shown(step)
        if result is None:
            continue
        numbers = _numbers(core) if step == Step.MARKERS else {}
        name = (result, tuple(numbers.items()))
        kept[name] = cache[name] if name in cache else _tables_of(result, numbers)
        stale = core.result(step) is not result
        made |= {key: replace(table, stale=stale) for key, table in kept[name].items()}
    core.tables = kept
    return made


def _numbers(core: Core) -> dict[int, str]:
    """The number of each ball, by its index; empty while they are not judged."""
    judged = core.result(Step.NUMBERING)
    if judged is None or judged.value is None:
        return {}
    return {ball: number for number, ball in judged.document["assigned"].items()}


def _tables_of(result: Result, numbers: Mapping[int, str]) -> dict[str, Table]:
    document: Any = result.document
    match result.step:
        case Step.LOAD:
            return {"image": tables.image(document)}
        case Step.MARKERS:
            return {
                "balls": tables.balls(document, numbers),
                "rejected": tables.rejected(document),
            }
        case Step.NUMBERING:
            return {"numbering": tables.numbering(document)}
        case Step.POSES:
            return {"poses": tables.poses(document), "gates": tables.gates(document["gates"])}
        case Step.READINGS:
            return {"struts": tables.struts(document)}
        case Step.CORRECTION:
            return {"target": tables.target(document)}
        case Step.SCHEDULE:
            return {
                "gates": tables.gates(document["gates"]),
                "schedule": tables.schedule(document),
                "strut_plan": tables.strut_plan(document),
            }
    return {"gates": tables.gates(document["gates"])}
