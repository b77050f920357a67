"""Faults as banners, and what the workstation itself asks and refuses."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from types import MappingProxyType

from hexafix.errors import Fault
from hexafix.presenter.places import place_words, plain_text
from hexafix.presenter.state import TITLES, Banner, Kind, Step

_GRAVEST: tuple[Kind, ...] = ("refused", "error", "warning", "info")

_WORDS: dict[Kind, str] = {
    "refused": "refused",
    "error": "not possible",
    "warning": "look at this",
    "info": "note",
}

NEXT_STEPS = MappingProxyType(
    {
        "layout-relaxed": "move a marker, or accept the relaxed rule for this frame",
        "target-not-an-export": "choose another folder",
        "target-holds-other-files": "move the files away or choose another folder",
        "export-not-written": "free disk space or choose another folder; older results are "
        "unchanged",
    }
)
"""Next steps in the workstation's words, where the command line's would name its options."""

_WHOLE_STEP = {
    Step.NUMBERING: "numbering",
    Step.READINGS: "strut_readings_mm",
    Step.CORRECTION: "correction",
    Step.SCHEDULE: "schedule",
}
"""Places that tell no more than the name of their step."""

SIDE_ASKED = Fault(
    "side-to-confirm",
    "say the side of the limb a second time",
    hazard="H37",
    where="limb.side",
    next_step="look at the patient or the request, not at this screen, and say the side",
)
READINGS_ASKED = Fault(
    "readings-to-repeat",
    "enter the six strut readings a second time",
    hazard="H24",
    where="strut_readings_mm",
    next_step="read all six struts on the frame again and enter the values",
)
FRONT_ASKED = Fault(
    "ring-front-to-confirm",
    "say that the front of both rings is where the picture shows it",
    hazard="H22",
    where="ring_front_confirmed",
    next_step="compare the rings' front marks with the picture, then confirm",
)


def banner(fault: Fault, *, kind: Kind, step: Step | None = None) -> Banner:
    """A fault as a banner; its id follows from its content."""
    text = message_of(fault, step=step)
    name = f"{kind} {step} {fault.code} {fault.where} {text}"
    words = _WORDS[kind]
    return Banner(
        id=hashlib.sha256(name.encode()).hexdigest()[:12],
        kind=kind,
        code=fault.code,
        title=words.capitalize() if step is None else f"{TITLES[step]}: {words}",
        message=text,
        next_step=next_step_of(fault),
        hazard=fault.hazard or "",
        step=step,
    )


def message_of(fault: Fault, *, step: Step | None = None) -> str:
    """What is wrong, the value, the limit and the place, as every door shows it.

    Parameters
    ----------
    fault : Fault
    step : Step or None
        The step that is named beside the message: its own name is not said again.
    """
    given = (("value", fault.value), ("limit", fault.limit))
    numbers = ", ".join(f"{word} {plain_text(text)}" for word, text in given if text)
    text = plain_text(fault.what) + (f" ({numbers})" if numbers else "")
    place = _place(fault.where, step)
    return text if place in text else f"{text}, at: {place}"


def next_step_of(fault: Fault) -> str:
    """What the user can do, in the workstation's words."""
    return plain_text(NEXT_STEPS.get(fault.code) or fault.next_step or "")


def line_of(fault: Fault) -> str:
    """A whole fault in one line."""
    step = next_step_of(fault)
    return message_of(fault) + (f". Next step: {step}" if step else "")


def _place(where: str | None, step: Step | None) -> str:
    words = place_words(where)
    whole = "" if step is None else place_words(_WHOLE_STEP.get(step))
    return words.removeprefix(whole).removeprefix(", ") if whole else words


def sorted_banners(banners: Iterable[Banner]) -> tuple[Banner, ...]:
    """The gravest first, each once."""
    once = {item.id: item for item in banners}
    return tuple(sorted(once.values(), key=lambda item: _GRAVEST.index(item.kind)))


def side_conflict(answer: str, side: str | None) -> Fault:
    """H37: the side said the second time is not the case's."""
    return Fault(
        "side-not-confirmed",
        "the side said the second time is not the side in the case",
        value=answer,
        limit=side or "none",
        hazard="H37",
        where="limb.side",
        next_step="look at the patient or the request; then correct the case or say it again",
    )


def reading_differs(strut: int, first: float | None, second: float | None) -> Fault:
    """H24: the second reading of a strut is not the first."""
    return Fault(
        "reading-not-repeated",
        f"the two readings of strut {strut} differ",
        value=_reading(second),
        limit=_reading(first),
        hazard="H24",
        where=f"strut_readings_mm[{strut - 1}]",
        next_step=f"read strut {strut} on the frame once more and correct the wrong entry",
    )


def read_again(strut: int, difference_mm: float) -> Fault:
    """H24: a reading that no gate refuses and that is yet doubtful."""
    return Fault(
        "reading-doubtful",
        f"strut {strut} by the CT differs from its reading",
        value=_reading(difference_mm),
        hazard="H24",
        where=f"strut_readings_mm[{strut - 1}]",
        next_step=f"read strut {strut} again",
    )


def _reading(value: object) -> str:
    from hexafix.pipeline import format_mm

    return f"{format_mm(value)} mm" if isinstance(value, int | float) else "none"
