"""The user's edits: each makes one version of the case document, with a label."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from hexafix.errors import InputError
from hexafix.presenter.casefile import path_in
from hexafix.presenter.core import Core, action
from hexafix.presenter.history import Version, document_bytes
from hexafix.presenter.state import Step

Document = dict[str, Any]
Change = Callable[[Document], Document | None]

SIX = 6

DRAG = "dragging the fragment"
"""Label of a movement that goes on."""


class Edits(Core):
    """Edits of the case but for its balls, undo and redo, and what is asked a second time."""

    def changed_document(self, label: str, change: Change, *, joined: bool = False) -> None:
        """One edit: `change` alters its copy of the document, or returns another one.

        An edit that changes nothing is none. One that is joined becomes part of the edit before.
        """
        document = self.version.copy()
        made = change(document)
        document = document if made is None else made
        if document == self.version.content:
            if joined:
                self.history.replace(replace(self.version, label=label))
            return
        try:
            raw = document_bytes(document)
        except (TypeError, ValueError) as error:
            raise InputError.of(
                "not-json",
                "this value cannot stand in a case",
                hazard="H55",
                next_step="give finite numbers and plain texts",
            ) from error
        self.keep(replace(self.version, raw=raw, label=label), joined=joined)

    def keep(self, version: Version, *, joined: bool = False) -> None:
        """Make a version the present one."""
        self.history.edit(version, joined=joined)
        self.new_version()

    @action
    def edit(self, label: str, function: Change) -> None:
        """Any edit: `function` alters its copy of the document, or returns another one."""
        self.changed_document(label, function)

    @action
    def undo(self) -> None:
        """Take the last edit back."""
        if self.history.undo():
            self.new_version()

    @action
    def redo(self) -> None:
        """Bring back the edit that was undone last."""
        if self.history.redo():
            self.new_version()

    @action
    def go_to(self, step: Step | str) -> None:
        """Look at another step."""
        self.current = Step(step)

    # ------------------------------------------------------------ the case

    @action
    def set_case_id(self, case_id: str) -> None:
        """Name the case."""
        self._set("case_id", case_id, "name the case")

    @action
    def set_limb(self, *, side: str | None = None, bone: str | None = None) -> None:
        """Set the limb's side or bone; None leaves it as it is."""
        given = {key: value for key, value in (("side", side), ("bone", bone)) if value is not None}
        self._set("limb", {**_part(self.version.copy(), "limb"), **given}, "set the limb")

    @action
    def set_fixator(self, id_or_document: str | Mapping[str, Any]) -> None:
        """Choose the fixator: a shipped id, the path of a definition, or the definition."""
        given: Any = id_or_document
        if not isinstance(given, str):
            given = dict(given)
        elif Path(given).is_file():
            given = path_in(self.version.folder, Path(given).resolve())
        self._set("fixator", given, "choose the fixator")

    @action
    def set_ball_diameter(self, mm: float) -> None:
        """Set the diameter of the marker balls, mm."""
        self._set_marker_part("ball_diameter_mm", mm, "set the ball diameter")

    @action
    def set_markers(self, ring: str, rows: Sequence[Mapping[str, Any]]) -> None:
        """Set a ring's layout: number, radius_mm, sweep_deg, height_mm of each marker."""
        if ring not in ("proximal", "distal"):
            raise InputError.of("unknown-ring", "a ring is proximal or distal", where="markers")
        self._set_marker_part(ring, [dict(row) for row in rows], f"set the {ring} layout")

    def _set_marker_part(self, key: str, value: Any, label: str) -> None:
        self._set("markers", {**_part(self.version.copy(), "markers"), key: value}, label)

    def _set(self, key: str, value: Any, label: str, *, joined: bool = False) -> None:
        self.changed_document(label, lambda document: {**document, key: value}, joined=joined)

    # ------------------------------------------------------------ readings, correction, schedule

    @action
    def set_reading(self, strut: int, mm: float | None) -> None:
        """Set the reading of one strut, 1 to 6, mm; None: not read yet."""
        if strut not in range(1, SIX + 1):
            raise InputError.of("no-such-strut", "struts are 1 to 6", value=str(strut))
        given = self.version.copy().get("strut_readings_mm")
        readings: list[float | None] = given if isinstance(given, list) else []
        readings += [None] * (SIX - len(readings))
        readings[strut - 1] = mm
        value = None if all(reading is None for reading in readings) else readings
        self._set("strut_readings_mm", value, f"set the reading of strut {strut}")

    @action
    def set_readings(self, values: Sequence[float | None] | None) -> None:
        """Set all six readings, mm."""
        given = None if values is None else list(values)
        self._set("strut_readings_mm", given, "set the readings")

    @action
    def set_correction(
        self, correction: Mapping[str, Any] | None, *, dragging: bool = False
    ) -> None:
        """Set the correction, of any of the four kinds, as the case file has it.

        Parameters
        ----------
        correction : mapping or None
        dragging : bool
            Whether more of the same movement will follow: all of it is one undo step. The last
            call of a movement is made without.
        """
        given = None if correction is None else dict(correction)
        going_on = self.version.label == DRAG
        label = DRAG if dragging else "drag the fragment" if going_on else "set the correction"
        self._set("correction", given, label, joined=going_on)

    @action
    def set_schedule(self, schedule: Mapping[str, Any] | None) -> None:
        """Set the schedule's rules as the case file has them."""
        given = None if schedule is None else dict(schedule)
        self._set("schedule", given, "set the schedule")

    @action
    def accept_relaxed_layout(self, accepted: bool = True) -> None:
        """Accept a layout that keeps only the relaxed angle rule (H17), or take that back."""
        if bool(accepted) != self.version.relaxed:
            label = "accept the relaxed layout" if accepted else "do not accept the relaxed layout"
            self.keep(replace(self.version, relaxed=bool(accepted), label=label))

    @action
    def confirm_ring_front(self, confirmed: bool = True) -> None:
        """Say that the front of both rings was compared with the picture (H22)."""
        version = {"schema_version": 2, "ring_front_confirmed": bool(confirmed)}
        label = "confirm the rings' front" if confirmed else "take back the rings' front"
        self.changed_document(label, lambda document: {**document, **version})

    # ------------------------------------------------------------ asked a second time

    @action
    def confirm_side(self, side: str) -> None:
        """The limb's side, said a second time (H37); another CT is asked for anew."""
        if side not in ("left", "right"):
            raise InputError.of("unknown-side", "a side is left or right", where="limb.side")
        self.side_answer = (side, self.side_image)

    @action
    def repeat_readings(self, values: Sequence[float | None]) -> None:
        """The six readings, read and entered a second time (H24)."""
        if len(values) != SIX:
            raise InputError.of(
                "six-readings",
                "six readings are needed",
                value=str(len(values)),
                where="strut_readings_mm",
                hazard="H24",
                next_step="read all six struts again",
            )
        self.readings_repeated = list(values)


def _part(document: Document, key: str) -> Document:
    """An object of the document; empty where it is missing or something else."""
    part = document.get(key)
    return part if isinstance(part, dict) else {}
