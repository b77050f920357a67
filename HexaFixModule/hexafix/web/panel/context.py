"""What every part of the side panel works with: the presenter, the typed state, the views."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypeVar, cast

from hexafix.errors import HexaFixError, InputError
from hexafix.panel.text import NUMBER
from hexafix.presenter.notices import message_of, next_step_of
from hexafix.presenter.places import place_words
from hexafix.web.panel.controls import ViewControls
from hexafix.web.state import NAMESPACE

if TYPE_CHECKING:
    from hexafix.presenter import Presenter
    from hexafix.web.state import PanelState

State = TypeVar("State")


@dataclass(frozen=True)
class PanelContext:
    """Presenter, state and views, and the one way to act on the presenter.

    Attributes
    ----------
    server : trame server
    presenter : Presenter
    controls : ViewControls
    data : PanelState
        The state's values; setting one sends it to the browser.
    name : PanelState
        The state's names, for templates.
    before_planning : list of callable
        Each raises while what it watches forbids a plan.
    """

    server: Any
    presenter: Presenter
    controls: ViewControls
    data: PanelState
    name: PanelState
    before_planning: list[Callable[[], None]] = field(default_factory=list)

    def plan(self, work: Callable[[], Any]) -> bool:
        """Do `work` that plans, unless something on screen is not what the case holds."""

        def checked() -> Any:
            self.require_taken()
            for require in self.before_planning:
                require()
            return work()

        return self.act(checked)

    def act(self, work: Callable[[], Any], *, field: str | None = None) -> bool:
        """Do `work`; an error is shown at `field`, or as a notice. Whether it was taken.

        The presenter's own actions tell their errors as banners and return False.
        """
        with self.server.state:
            try:
                if work() is False:
                    self._mark_refused(field)
                    return False
            except HexaFixError as error:
                self.tell(error, field=field)
                return False
            self.forgive(field)
            return True

    def _mark_refused(self, field: str | None) -> None:
        self.data.notice = {}
        if field is not None:
            banners = self.presenter.snapshot.banners
            words = f"not taken: {banners[0].message}" if banners else "not taken"
            self.data.field_errors = {**self.data.field_errors, field: words}

    def ask_point(self, picked: Callable[[Sequence[float]], None]) -> None:
        """Hand the next point that is clicked in a view (LPS, mm) to `picked`."""

        def taken(lps: Sequence[float]) -> None:
            with self.server.state:
                picked(lps)

        self.controls.pick_point(taken)

    def tell(self, error: HexaFixError, *, field: str | None = None) -> None:
        """Show an error: the text of a field stays, marked as not taken."""
        fault = error.faults[0]
        if field is not None:
            words = f"not taken: {fault.what}"
            if fault.limit:
                words += f" ({fault.limit})"
            self.data.field_errors = {**self.data.field_errors, field: words}
            return
        self.data.notice = {
            "message": "; ".join(message_of(fault) for fault in error.faults[:3]),
            "next_step": next_step_of(fault),
            "hazard": fault.hazard or "",
            "code": fault.code,
        }

    def forgive(self, field: str | None = None) -> None:
        """Take back the notice, and the mark of `field`, whose text was taken now."""
        self.data.notice = {}
        if field in self.data.field_errors:
            errors = dict(self.data.field_errors)
            del errors[field]
            self.data.field_errors = errors

    def restore(self) -> None:
        """Build every marked field anew, so that it shows the document's value again."""
        keys = dict(self.data.field_keys)
        for name in self.data.field_errors:
            keys[name] = keys.get(name, 0) + 1
        self.data.field_keys, self.data.field_errors = keys, {}

    def require_taken(self) -> None:
        """Plan nothing while a field shows a text that the case does not hold.

        Raises
        ------
        InputError
            While a field is marked as not taken.
        """
        if self.data.field_errors:
            raise InputError.of(
                "field-not-taken",
                "the text of a field was not taken: "
                + ", ".join(field_words(name) for name in self.data.field_errors),
                next_step="correct the marked field, or undo to see the case's values again",
                hazard="H26",
            )


FIELDS = {
    "case-id": "case_id",
    "limb-side": "limb.side",
    "limb-bone": "limb.bone",
    "ball-diameter": "markers.ball_diameter_mm",
}
"""Names of single fields and their places in the case."""


def field_words(name: str) -> str:
    """What the screen calls a field: ``schedule-start_date`` is the schedule's first day."""
    top, _, rest = name.partition("-")
    row, _, key = rest.partition("-")
    if top in ("reading", "again"):
        return f"strut {rest}" + (" again" if top == "again" else "")
    if top in ("proximal", "distal"):
        return place_words(f"markers.{top}[{row}].{key}")
    if top == "risk":
        return place_words(f"schedule.structures_at_risk_lps_mm[{row}][{'LPS'.index(key)}]")
    return place_words(f"schedule.{rest}" if top == "schedule" else FIELDS.get(name, name))


def typed_state(server: Any, kind: type[State]) -> tuple[State, State]:
    """Values and names of a part's own state; setting a value sends it to the browser."""
    from trame_server.utils.typed_state import TypedState

    typed = TypedState(server.state, kind, namespace=NAMESPACE)
    return cast(State, typed.data), cast(State, typed.name)


def number(text: Any, *, where: str) -> float:
    """The number that a field holds: a decimal point, no comma, no unit, no sign but + or -.

    Raises
    ------
    InputError
        If the text is not a plain number (H26).
    """
    text = str("" if text is None else text).strip().replace("−", "-")
    if not NUMBER.fullmatch(text):
        raise InputError.of(
            "not-a-number",
            "this is not a plain number",
            value=text[:20] or "nothing",
            limit="digits with a decimal point, e.g. 182.5",
            where=where,
            hazard="H26",
            next_step="write it with a decimal point and without a unit",
        )
    return float(text)


def whole_number(text: Any, *, where: str) -> int:
    """The whole number that a field holds.

    Raises
    ------
    InputError
        If the text is not digits alone.
    """
    text = str("" if text is None else text).strip()
    if not (text.isascii() and text.isdigit() and len(text) < 5):
        raise InputError.of(
            "not-a-whole-number",
            "this is not a whole number",
            value=text[:20] or "nothing",
            limit="digits alone",
            where=where,
            next_step="write digits alone",
        )
    return int(text)
