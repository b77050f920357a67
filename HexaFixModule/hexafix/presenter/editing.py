"""The user's edits: each one version of the case document, with a label."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

from hexafix.errors import InputError
from hexafix.presenter import notices
from hexafix.presenter.core import Core, action
from hexafix.presenter.history import document_bytes
from hexafix.presenter.state import Step

Document = dict[str, Any]


class Edits(Core):
    """Edits, undo and redo, and what is asked a second time."""

    def _edit(self, label: str, change: Callable[[Document], Document | None]) -> None:
        document = self.version.copy()
        made = change(document)
        document = document if made is None else made
        if document == self.version.content:
            return
        try:
            raw = document_bytes(document)
        except (TypeError, ValueError) as error:
            raise InputError.of(
                "not-json",
                "the value cannot stand in a case file",
                hazard="H55",
                next_step="give finite numbers and plain texts",
            ) from error
        self._keep(replace(self.version, raw=raw, label=label))

    def _keep(self, version: Any) -> None:
        self.history.edit(version)
        self._after_change()

    def _after_change(self) -> None:
        """Stop work whose inputs are not the case's any more."""

    @action
    def edit(self, label: str, function: Callable[[Document], Document | None]) -> None:
        """Any edit: `function` gets a copy of the document and returns what it shall be."""
        self._edit(label, function)

    @action
    def undo(self) -> None:
        """Take the last edit back."""
        if self.history.undo():
            self._after_change()

    @action
    def redo(self) -> None:
        """Bring back the edit that was undone last."""
        if self.history.redo():
            self._after_change()

    @action
    def go_to(self, step: Step | str) -> None:
        """Look at another step."""
        self.current = Step(step)

    # ------------------------------------------------------------ the case

    @action
    def set_case_id(self, case_id: str) -> None:
        """Name the case."""
        self._edit("name the case", lambda document: {**document, "case_id": case_id})

    @action
    def set_limb(self, *, side: str | None = None, bone: str | None = None) -> None:
        """Set the limb's side or bone; None leaves it as it is."""
        given = {key: value for key, value in (("side", side), ("bone", bone)) if value is not None}

        def change(document: Document) -> None:
            document["limb"] = {**(document.get("limb") or {}), **given}

        self._edit("set the limb", change)

    @action
    def set_fixator(self, id_or_document: str | Mapping[str, Any]) -> None:
        """Choose the fixator: a shipped id, a path, or its definition."""
        given = id_or_document if isinstance(id_or_document, str) else dict(id_or_document)
        self._edit("choose the fixator", lambda document: {**document, "fixator": given})

    @action
    def set_ball_diameter(self, mm: float) -> None:
        """Set the diameter of the marker balls, mm."""

        def change(document: Document) -> None:
            document["markers"] = {**(document.get("markers") or {}), "ball_diameter_mm": mm}

        self._edit("set the ball diameter", change)

    @action
    def set_markers(self, ring: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Set a ring's layout: number, radius_mm, sweep_deg, height_mm of each marker."""
        if ring not in ("proximal", "distal"):
            raise InputError.of("unknown-ring", "a ring is proximal or distal", where="markers")

        def change(document: Document) -> None:
            markers = {**(document.get("markers") or {}), ring: [dict(row) for row in rows]}
            document["markers"] = markers

        self._edit(f"set the {ring} layout", change)

    # ------------------------------------------------------------ balls and numbers

    @action
    def add_marker(self, lps: Sequence[float]) -> None:
        """Add a ball near a point of the image, LPS mm."""

        def change(document: Document) -> None:
            edits = _marker_edits(document)
            edits["added_lps_mm"].append([float(value) for value in lps])

        self._edit("add a ball", change)

    @action
    def remove_marker(self, ball_index: int) -> None:
        """Take a ball away."""
        center = self._center(ball_index)

        def change(document: Document) -> None:
            _marker_edits(document)["removed_lps_mm"].append(center)

        self._edit(f"remove ball {ball_index + 1}", change)

    @action
    def move_marker(self, ball_index: int, lps: Sequence[float]) -> None:
        """Move a ball to a point of the image, LPS mm; it settles on the ball there."""
        center = self._center(ball_index)

        def change(document: Document) -> None:
            edits = _marker_edits(document)
            edits["removed_lps_mm"].append(center)
            edits["added_lps_mm"].append([float(value) for value in lps])

        self._edit(f"move ball {ball_index + 1}", change)

    @action
    def number_automatically(self) -> None:
        """Let the numbers be found."""
        self._edit("number automatically", lambda document: {**document, "numbering": None})

    @action
    def assign_number(self, number: int, ball_index: int) -> None:
        """Give a ball a number; one that it had, and the ball that had this one, lose theirs."""
        center = self._center(ball_index)
        before = self._numbers()

        def change(document: Document) -> None:
            kept = {key: at for key, at in before.items() if at != center}
            document["numbering"] = _in_order({**kept, str(number): center})

        self._edit(f"assign number {number}", change)

    @action
    def clear_number(self, number: int) -> None:
        """Take a number from its ball."""
        before = self._numbers()

        def change(document: Document) -> None:
            document["numbering"] = {k: at for k, at in before.items() if k != str(number)}

        self._edit(f"clear number {number}", change)

    @action
    def swap_numbers(self, a: int, b: int) -> None:
        """Exchange two numbers."""
        before = self._numbers()
        if str(a) not in before or str(b) not in before:
            raise InputError.of(
                "number-missing",
                "both numbers must stand on a ball to be exchanged",
                value=f"{a} and {b}",
                hazard="H19",
                next_step="assign both numbers first",
            )

        def change(document: Document) -> None:
            swapped = {**before, str(a): before[str(b)], str(b): before[str(a)]}
            document["numbering"] = _in_order(swapped)

        self._edit(f"swap numbers {a} and {b}", change)

    def _center(self, ball_index: int) -> list[float]:
        found = self.result(Step.MARKERS)
        balls = found.document["balls"] if found is not None and found.value is not None else None
        if balls is None:
            raise InputError.of(
                "balls-out-of-date",
                "the balls shown are not those of the present image and edits",
                hazard="H40",
                next_step="find the balls again",
            )
        if not 0 <= ball_index < len(balls):
            raise InputError.of("no-such-ball", "there is no such ball", value=str(ball_index + 1))
        return list(balls[ball_index]["center_mm"])

    def _numbers(self) -> dict[str, list[float]]:
        """The user's numbers, or those found, as a start of the user's."""
        given = self.version.content.get("numbering")
        if given is not None:
            return dict(given)
        judged = self.result(Step.NUMBERING)
        if judged is None or judged.value is None:
            return {}
        return {number: self._center(ball) for number, ball in judged.document["assigned"].items()}

    # ------------------------------------------------------------ readings, correction, schedule

    @action
    def set_reading(self, strut: int, mm: float) -> None:
        """Set the reading of one strut, 1 to 6, mm."""
        if strut not in range(1, 7):
            raise InputError.of("no-such-strut", "struts are 1 to 6", value=str(strut))

        def change(document: Document) -> None:
            readings = list(document.get("strut_readings_mm") or [None] * 6)
            readings[strut - 1] = mm
            document["strut_readings_mm"] = readings

        self._edit(f"set the reading of strut {strut}", change)

    @action
    def set_readings(self, values: Sequence[float]) -> None:
        """Set all six readings, mm."""
        self._edit("set the readings", lambda doc: {**doc, "strut_readings_mm": list(values)})

    @action
    def set_correction(self, correction: Mapping[str, Any] | None) -> None:
        """Set the correction, of any of the four kinds, as the case file has it."""
        given = None if correction is None else dict(correction)
        self._edit("set the correction", lambda document: {**document, "correction": given})

    @action
    def set_schedule(self, schedule: Mapping[str, Any] | None) -> None:
        """Set the schedule's rules as the case file has them."""
        given = None if schedule is None else dict(schedule)
        self._edit("set the schedule", lambda document: {**document, "schedule": given})

    @action
    def accept_relaxed_layout(self, accepted: bool = True) -> None:
        """Accept a layout that keeps only the relaxed angle rule (H17), or take that back."""
        if accepted != self.version.relaxed:
            label = "accept the relaxed layout" if accepted else "do not accept the relaxed layout"
            self._keep(replace(self.version, relaxed=accepted, label=label))

    @action
    def confirm_ring_front(self, confirmed: bool = True) -> None:
        """Say that the front of both rings was compared with the picture (H22)."""

        def change(document: Document) -> None:
            document["schema_version"] = max(2, document.get("schema_version", 2))
            document["ring_front_confirmed"] = confirmed

        self._edit("confirm the rings' front", change)

    # ------------------------------------------------------------ asked a second time

    @action
    def confirm_side(self, side: str) -> None:
        """The limb's side, asked a second time (H37)."""
        limb = self.version.content.get("limb")
        given = limb.get("side") if isinstance(limb, Mapping) else None
        self.side_confirmed = side if side == given else None
        if side != given:
            self.tell(notices.side_conflict(str(side), str(given)), kind="refused", step=Step.LOAD)

    @action
    def repeat_readings(self, values: Sequence[float]) -> None:
        """The six readings, read and typed a second time (H24)."""
        first = list(self.version.content.get("strut_readings_mm") or [])
        second = list(values)
        self.readings_repeated = second
        for strut, (one, other) in enumerate(zip(first, second, strict=False), 1):
            if one != other:
                fault = notices.reading_differs(strut, str(one), str(other))
                self.tell(fault, kind="refused", step=Step.READINGS)


def _marker_edits(document: Document) -> dict[str, list[Any]]:
    """The marker edits of a document, made where there are none."""
    document["schema_version"] = 2
    edits = document.setdefault("marker_edits", {})
    for key in ("added_lps_mm", "removed_lps_mm"):
        edits.setdefault(key, [])
    return edits


def _in_order(numbering: Mapping[str, Any]) -> dict[str, Any]:
    return {number: numbering[number] for number in sorted(numbering, key=int)}
