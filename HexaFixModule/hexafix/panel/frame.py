"""What stands about the pages: case, undo, steps, messages, progress."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.panel.binding import Binding, button, idle, shown
from hexafix.panel.load import JSON_FILES
from hexafix.panel.text import escaped
from hexafix.presenter import Banner, Step, StepState

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

STEPS = tuple(Step)

SIGNS = {
    StepState.WAITING: "·",
    StepState.READY: "○",
    StepState.RUNNING: "…",
    StepState.DONE: "✓",
    StepState.STALE: "↻",
    StepState.REFUSED: "✕",
}
"""A sign for each state, so that none is told by colour alone."""

LOOKS = {
    "refused": ("#fbe3e4", "#7a0c12", "✕"),
    "error": ("#fbe3e4", "#7a0c12", "✕"),
    "warning": ("#fff3cf", "#5a4200", "⚠"),
    "info": ("#e3eefb", "#10395f", "i"),
}
"""Ground, ink and sign of a message; both colours are set, so that any theme leaves it legible."""

OPEN_FILES = "Cases and scenes (*.json *.mrb)"

SAVE, DISCARD, KEEP = "Save", "Discard", "Go on editing"


def may_leave(panel: Panel) -> bool:
    """Ask what becomes of unsaved changes; whether the case may be left."""
    if panel.commit() and not panel.snapshot.edited:
        return True
    answer = panel.widgets.ask(
        "Unsaved changes", "The case has changes that are not saved.", (SAVE, DISCARD, KEEP)
    )
    if answer == 0:
        return save(panel)
    return answer == 1


def save(panel: Panel, *, elsewhere: bool = False) -> bool:
    """Save the case where it is, or where the user says; whether it was saved."""
    if not panel.commit():
        return False
    path = panel.snapshot.case_path
    if path is None or elsewhere:
        path = panel.widgets.ask_new_file("Save the case", path or "case.json", JSON_FILES)
    return bool(path) and panel.presenter.save_case(Path(path))


def open_case(panel: Panel, _: Any = None) -> None:
    """Ask for a case file or a scene and open it."""
    path = panel.widgets.ask_file("Open a case or a scene", OPEN_FILES)
    if path and may_leave(panel):
        panel.open_case(Path(path))


def new_case(panel: Panel, _: Any = None) -> None:
    """Begin an empty case."""
    if may_leave(panel):
        panel.blank()
        panel.presenter.new_case()


def _case_text(_: Panel, snapshot: Snapshot) -> str:
    name = escaped(snapshot.case_id or "unnamed case")
    place = escaped(Path(snapshot.case_path).name) if snapshot.case_path else "not saved yet"
    return f"<b>{name}</b> – {place}" + (" – <b>changed</b>" if snapshot.edited else "")


def _step_texts(_: Panel, snapshot: Snapshot) -> tuple[str, ...]:
    return tuple(
        f"{SIGNS[view.state]}  {place}  {view.title} – {view.summary}"
        for place, view in enumerate(snapshot.steps, 1)
    )


def banner_html(banners: tuple[Banner, ...]) -> str:
    """Messages as HTML, the gravest first."""
    parts = []
    for banner in banners:
        ground, ink, sign = LOOKS[banner.kind]
        hazard = f" [{escaped(banner.hazard)}]" if banner.hazard else ""
        text = f"<b>{sign} {escaped(banner.title)}{hazard}</b><br>{escaped(banner.message)}"
        if banner.next_step:
            text += f"<br><b>Next step:</b> {escaped(banner.next_step)}"
        if banner.step is not None:
            text += f' <a href="step:{banner.step.value}" style="color:{ink}">Go there</a>'
        cell = f'<td bgcolor="{ground}" style="color:{ink}">{text}</td>'
        parts.append(f'<table width="100%" cellpadding="4" cellspacing="0"><tr>{cell}</tr></table>')
    return "".join(parts)


def _go(panel: Panel, link: str) -> None:
    name = link.removeprefix("step:")
    if name in tuple(step.value for step in STEPS):
        panel.presenter.go_to(Step(name))


def _neighbour(panel: Panel, on: int) -> None:
    place = STEPS.index(panel.snapshot.current) + on
    panel.presenter.go_to(STEPS[min(max(place, 0), len(STEPS) - 1)])


def _undo_text(word: str, label: str) -> str:
    return f"{word}: {label}" if label else f"Nothing to {word.lower()}"


def _percent(_: Panel, snapshot: Snapshot) -> int:
    return round(100 * snapshot.progress[1]) if snapshot.progress else 0


def _place(_: Panel, snapshot: Snapshot) -> int:
    return STEPS.index(snapshot.current)


def _busy(_: Panel, snapshot: Snapshot) -> bool:
    return snapshot.busy


BINDINGS: tuple[Binding, ...] = (
    button("newCaseButton", new_case, commits=False),
    button("openCaseButton", open_case, commits=False),
    button("saveCaseButton", lambda panel, _: save(panel), commits=False),
    Binding(
        "undoButton",
        "clicked",
        lambda panel, _: panel.presenter.undo(),
        (
            ("enabled", lambda _, snapshot: snapshot.can_undo),
            ("tip", lambda _, snapshot: _undo_text("Undo", snapshot.undo_label)),
        ),
    ),
    Binding(
        "redoButton",
        "clicked",
        lambda panel, _: panel.presenter.redo(),
        (
            ("enabled", lambda _, snapshot: snapshot.can_redo),
            ("tip", lambda _, snapshot: _undo_text("Redo", snapshot.redo_label)),
        ),
    ),
    shown("caseLabel", "text", _case_text),
    Binding(
        "stepList",
        "row",
        lambda panel, row: panel.presenter.go_to(STEPS[row]) if row >= 0 else None,
        (("items", _step_texts), ("index", _place)),
    ),
    Binding(
        "bannerBrowser",
        "link",
        _go,
        (
            ("html", lambda panel, _: banner_html(panel.banners())),
            ("visible", lambda panel, _: bool(panel.banners())),
        ),
    ),
    shown("stepStack", "index", _place),
    Binding(
        "progressLabel",
        shows=(
            ("text", lambda _, snapshot: snapshot.progress[0] if snapshot.progress else ""),
            ("visible", _busy),
        ),
    ),
    Binding("progressBar", shows=(("value", _percent), ("visible", _busy))),
    Binding(
        "cancelButton",
        "clicked",
        lambda panel, _: panel.presenter.cancel(),
        (("visible", _busy),),
    ),
    button(
        "backButton",
        lambda panel, _: _neighbour(panel, -1),
        enabled=lambda _, snapshot: snapshot.current != STEPS[0],
        commits=False,
    ),
    button("runStepButton", lambda panel, _: panel.run(panel.snapshot.current), enabled=idle),
    button("runAllButton", lambda panel, _: panel.run_all(), enabled=idle),
    button(
        "nextButton",
        lambda panel, _: _neighbour(panel, 1),
        enabled=lambda _, snapshot: snapshot.current != STEPS[-1],
        commits=False,
    ),
)
