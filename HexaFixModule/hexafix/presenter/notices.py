"""Faults as banners, and the sentences of the workstation's own checks."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable

from hexafix.errors import Fault
from hexafix.presenter.state import TITLES, Banner, Kind, Step

_ORDER: tuple[Kind, ...] = ("refused", "error", "warning", "info")

_TITLES: dict[Kind, str] = {
    "refused": "Refused",
    "error": "Not possible",
    "warning": "Look at this",
    "info": "Note",
}


def banner(fault: Fault, *, kind: Kind, step: Step | None = None, title: str = "") -> Banner:
    """A fault as a banner; its id follows from its content."""
    text = f"{fault.where}: {fault.what}" if fault.where else fault.what
    if fault.value is not None:
        text += f" (value {fault.value}" + (f", limit {fault.limit})" if fault.limit else ")")
    elif fault.limit is not None:
        text += f" (limit {fault.limit})"
    name = f"{kind} {step} {fault.code} {text}"
    head = title or (_TITLES[kind] if step is None else f"{TITLES[step]}: {_TITLES[kind].lower()}")
    return Banner(
        id=hashlib.sha256(name.encode()).hexdigest()[:12],
        kind=kind,
        code=fault.code,
        title=head,
        message=text,
        next_step=fault.next_step or "",
        hazard=fault.hazard or "",
        step=step,
    )


def sorted_banners(banners: Iterable[Banner]) -> tuple[Banner, ...]:
    """The gravest first, each once."""
    once = {item.id: item for item in banners}
    return tuple(sorted(once.values(), key=lambda item: _ORDER.index(item.kind)))


def side_conflict(asked: str, given: str) -> Fault:
    """H37: the side given the second time is not the case's."""
    return Fault(
        "side-not-confirmed",
        "the side given the second time is not the side of the case",
        value=asked,
        limit=given,
        hazard="H37",
        where="limb.side",
        next_step="look at the patient's own frame, then correct the case or the answer",
    )


def reading_differs(strut: int, first: str, second: str) -> Fault:
    """H24: the second reading of a strut is not the first."""
    return Fault(
        "reading-not-repeated",
        f"the two readings of strut {strut} differ",
        value=f"{second} mm",
        limit=f"{first} mm",
        hazard="H24",
        where=f"strut_readings_mm[{strut - 1}]",
        next_step=f"read strut {strut} once more on the frame and enter it twice",
    )
