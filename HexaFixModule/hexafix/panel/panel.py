"""The binder: one table of bindings between the widgets of the .ui and the presenter."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from hexafix.errors import Fault, HexaFixError, InputError
from hexafix.panel import correction, export, frame, load, markers, numbering, poses, schedule
from hexafix.panel.binding import Binding
from hexafix.panel.picking import clicked
from hexafix.panel.widgets import Widgets
from hexafix.presenter import Banner, Presenter, Snapshot, Step, Table
from hexafix.presenter.notices import line_of, message_of, next_step_of
from hexafix.presenter.signal import Signal

BINDINGS: tuple[Binding, ...] = (
    *frame.BINDINGS,
    *load.BINDINGS,
    *markers.BINDINGS,
    *numbering.BINDINGS,
    *poses.BINDINGS,
    *correction.BINDINGS,
    *schedule.BINDINGS,
    *export.BINDINGS,
)
"""Every widget of ``HexaFixModule.ui`` that does or shows something."""

PLAY_S = 0.25
"""How long an adjustment is shown while playing."""

CONTENTS = ("text", "index", "checked", "value", "date")
"""Properties that the user changes; a change that was not taken over is taken back."""


class Panel:
    """The panel in any Qt: widgets on one side, the presenter on the other.

    Parameters
    ----------
    widgets : Widgets
        The toolkit's adapter.
    presenter : Presenter

    Attributes
    ----------
    ball_chosen : Signal
        Called with the index of the ball that the user chose.
    playback_moved : Signal
        Called with the row of the schedule to show, or None for the frame as the CT shows it.
    dragging_changed : Signal
        Called with whether the bone can be dragged.
    """

    def __init__(self, widgets: Widgets, presenter: Presenter) -> None:
        self.widgets, self.presenter = widgets, presenter
        self.ball_chosen, self.playback_moved = Signal(), Signal()
        self.dragging_changed = Signal()
        self._shown: dict[tuple[str, str], Any] = {}
        self._updating = False
        self._page_step = presenter.snapshot.current
        self._pictures: tuple[Any, Table, dict[str, str]] = (None, Table(()), {})
        self.playback_row = 0
        self.playing = self.dragging = False
        self.shown_pdf: bytes | None = None
        self.shown_pages: list[bytes] = []
        self.page = 0
        self.blank()
        for binding in BINDINGS:
            if binding.event:
                self.widgets.connect(binding.widget, binding.event, self._handler(binding))
        presenter.changed.connect(self.update)
        self.update(presenter.snapshot)

    def blank(self) -> None:
        """Forget what was typed for another case."""
        for name in getattr(self, "mistakes", {}):
            self.widgets.set(name, "mark", "")
        self.mistakes: dict[str, Fault] = {}
        self.notices: tuple[Banner, ...] = ()
        self._waiting: dict[str, list[list[str]]] = {}
        self.picking = ""
        self.image_folder = ""
        self.correction_form: int | None = None
        self.correction_typed = False
        self.motion_numbers: list[float] | None = None
        # Forms may hold what no case holds: they are emptied, not only filled.
        self._shown.clear()
        for binding in BINDINGS:
            if binding.event == "edited":
                self.put(binding.widget, "")

    def put(self, name: str, text: str) -> None:
        """Write into a field that is not, or not yet, the case's."""
        self._shown.pop((name, "text"), None)
        self.widgets.set(name, "text", text)

    def close(self) -> None:
        """Show nothing any more."""
        self.widgets.every(PLAY_S, None)
        self.presenter.changed.disconnect(self.update)

    # ------------------------------------------------------------ showing

    @property
    def snapshot(self) -> Snapshot:
        """What is shown."""
        return self.presenter.snapshot

    def table(self, name: str) -> Table:
        """A table of the snapshot."""
        return self.snapshot.tables.get(name) or Table(())

    def banners(self) -> tuple[Banner, ...]:
        """What is wrong in the panel, then the presenter's messages."""
        return (*self.notices, *self.snapshot.banners)

    def refresh(self) -> None:
        """Show the newest snapshot."""
        self.update(self.presenter.snapshot)

    def update(self, snapshot: Snapshot) -> None:
        """Bring every widget to the snapshot, touching only what has changed."""
        if self._updating:
            return
        self._updating = True
        try:
            self._follow(snapshot)
            for binding in BINDINGS:
                for what, fill in binding.shows:
                    self._show(binding.widget, what, fill(self, snapshot))
        finally:
            self._updating = False

    def _follow(self, snapshot: Snapshot) -> None:
        """End what belongs to the page left; open the form of the case's correction."""
        if snapshot.current != self._page_step:
            # A click meant for one page must not do another page's work.
            self._page_step, self.picking = snapshot.current, ""
            if self.playing:
                self.play(False)
            if self.dragging:
                self.drag(False)
        held = correction.kind_in_case(snapshot)
        if held in correction.KINDS and not self.correction_typed:
            place = correction.KINDS.index(held)
            if getattr(self, "_followed", None) != (snapshot.case_path, held):
                self.correction_form = place
            self._followed = (snapshot.case_path, held)
        rows = len(snapshot.tables["strut_plan"].rows) if "strut_plan" in snapshot.tables else 0
        self.playback_row = min(self.playback_row, max(0, rows - 1))

    def _show(self, name: str, what: str, value: Any) -> None:
        key = (name, what)
        if value is None or (key in self._shown and self._shown[key] == value):
            return
        self._shown[key] = value
        self.widgets.set(name, what, value)
        if what in ("text", "table") and self.mistakes.pop(name, None):
            self.widgets.set(name, "mark", "")

    def pictures(self) -> dict[str, str]:
        """The presenter's pictures, drawn again only for another plan or layout."""
        plan, layout, drawn = self._pictures
        newest = self.presenter.value(Step.SCHEDULE)
        if plan is not newest or layout != self.table("layout") or not drawn:
            drawn = self.presenter.pictures()
            self._pictures = (newest, self.table("layout"), drawn)
        return drawn

    # ------------------------------------------------------------ acting

    def _handler(self, binding: Binding) -> Any:
        def handle(value: Any) -> None:
            if not self._updating and (not binding.commits or self.commit()):
                self._do(binding, value)

        return handle

    def _do(self, binding: Binding, value: Any) -> None:
        name = binding.widget
        if binding.event == "edited" and value == self._shown.get((name, "text")):
            self._right(name)
            self.refresh()
            return
        self.notices = ()
        self._right(name)
        for what, fill in binding.shows:
            if what in CONTENTS and fill(self, self.snapshot) is None:
                # A form that is not in use: what it shows is the user's, not the case's.
                self._shown.pop((name, what), None)
        try:
            if binding.action is not None:
                binding.action(self, value)
        except HexaFixError as error:
            self._wrong(binding, error)
        else:
            self._settle(binding)
        self.refresh()

    def _settle(self, binding: Binding) -> None:
        """Take back, or mark, what the presenter did not take over."""
        self.refresh()
        for what in CONTENTS:
            key = (binding.widget, what)
            if key not in self._shown or self.widgets.get(*key) == self._shown[key]:
                continue
            if dict(binding.shows)[what](self, self.snapshot) is None:
                continue
            if binding.event != "edited":
                self.widgets.set(*key, self._shown[key])
                continue
            fault = Fault(
                "not-taken-over",
                "what was typed was not taken over",
                value=repr(self.widgets.get(*key)),
                limit=f"the case holds {self._shown[key]!r}",
                next_step="correct the field",
            )
            if not _same_number(self.widgets.get(*key), self._shown[key]):
                self._wrong(binding, InputError(fault))
            else:
                self.widgets.set(*key, self._shown[key])

    def _right(self, name: str) -> None:
        if self.mistakes.pop(name, None):
            self.widgets.set(name, "mark", "")

    def _wrong(self, binding: Binding, error: HexaFixError) -> None:
        self.notices = tuple(_banner(fault, self.snapshot.current) for fault in error.faults)
        if binding.event in ("edited", "cell"):
            self.mistakes[binding.widget] = error.faults[0]
            self.widgets.set(binding.widget, "mark", line_of(error.faults[0]))

    def commit(self) -> bool:
        """Take over everything typed; False, with a message, if something cannot be."""
        self.widgets.finish()
        for binding in BINDINGS:
            if binding.event != "edited" or binding.widget in self.mistakes:
                continue
            key = (binding.widget, "text")
            if key in self._shown and self.widgets.get(*key) != self._shown[key]:
                self._do(binding, self.widgets.get(*key))
        if self.mistakes:
            faults = tuple(self.mistakes.values())
            self.notices = tuple(_banner(fault, None) for fault in faults)
            self.refresh()
        return not self.mistakes

    def run(self, step: Step) -> None:
        """Compute a step."""
        if self._whole(step):
            self.presenter.run(step)

    def run_all(self) -> None:
        """Compute everything to the prescription."""
        if self._whole(Step.EXPORT):
            self.presenter.run_all()

    def _whole(self, step: Step) -> bool:
        """No schedule is made while a correction was typed that is not in the case."""
        other = correction.kind_in_form(self) != correction.kind_in_case(self.snapshot)
        if step in (Step.SCHEDULE, Step.EXPORT) and self.correction_typed and other:
            raise InputError.of(
                "correction-not-in-use",
                "a correction was typed that does not stand in the case",
                value=correction.kind_in_form(self),
                limit=f"the case holds {correction.kind_in_case(self.snapshot) or 'none'}",
                next_step="press “Use this correction”, or choose the kind that the case holds",
                hazard="H40",
            )
        return True

    def open_case(self, path: Path) -> bool:
        """Open a case file or a scene in place of the present case."""
        self.blank()
        return self.presenter.open_case(path)

    def waiting_rows(self, widget: str) -> list[list[str]]:
        """Rows of a typed table that are not complete."""
        return self._waiting.setdefault(widget, [])

    # ------------------------------------------------------------ views

    def pick(self, button: str) -> None:
        """Choose what a click in a view does; empty for nothing but showing the place."""
        self.picking = button

    def clicked(self, lps_mm: Sequence[float], ball: int | None = None) -> None:
        """A click in a view, at a point and, where there is one, on a ball."""
        self.notices = ()
        try:
            clicked(self, lps_mm, ball)
        except HexaFixError as error:
            self.notices = tuple(_banner(fault, None) for fault in error.faults)
        self.refresh()

    def drag(self, on: bool) -> None:
        """Let the bone be dragged in the 3D view, or end that."""
        if on:
            correction.moving(self)
        self.dragging = on
        self.dragging_changed.emit(on)

    def moving_fragment(self) -> str:
        """The fragment that moves: the open form's, or an empty text."""
        try:
            return correction.moving(self)
        except (InputError, KeyError):
            return ""

    def dragged(self, matrix_lps: Sequence[Sequence[float]]) -> None:
        """The bone was dragged to this motion, 4×4, LPS mm."""
        try:
            self.correction_typed = False
            matrix = [list(row) for row in matrix_lps]
            self.presenter.set_correction(
                {
                    "kind": "fragment-motion",
                    "moving": correction.moving(self),
                    "matrix_lps": matrix,
                }
            )
        except HexaFixError as error:
            self.notices = tuple(_banner(fault, Step.CORRECTION) for fault in error.faults)
        self.refresh()

    def show_playback(self, row: int) -> None:
        """Show the frame after a row of the schedule."""
        self.playback_row = row
        self.playback_moved.emit(row)
        self.refresh()

    def play(self, on: bool) -> None:
        """Play the schedule row after row, or stop."""
        self.playing = on
        self.widgets.every(PLAY_S, self._next_row if on else None)

    def _next_row(self) -> None:
        last = len(self.table("strut_plan").rows) - 1
        if self.playback_row >= last:
            self.play(False)
            self.refresh()
            return
        self.show_playback(self.playback_row + 1)


def _same_number(one: Any, other: Any) -> bool:
    try:
        return float(one) == float(other)
    except (TypeError, ValueError):
        return False


def _banner(fault: Fault, step: Step | None) -> Banner:
    return Banner(
        id=f"panel-{fault.code}-{fault.where or fault.what}",
        kind="error",
        code=fault.code,
        title="Not possible",
        message=message_of(fault),
        next_step=next_step_of(fault),
        hazard=fault.hazard or "",
        step=step,
    )
