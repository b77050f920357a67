"""The user's edits of balls and numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hexafix.errors import InputError
from hexafix.presenter.core import action
from hexafix.presenter.editing import Document, Edits
from hexafix.presenter.results import Result
from hexafix.presenter.state import Step


class BallEdits(Edits):
    """Add, remove, drag balls; give them numbers by hand or let them be found."""

    @action
    def add_marker(self, lps: Sequence[float]) -> None:
        """Add the ball near a point of the image, LPS mm; the program settles on its centre."""
        edits = self.engine.with_ball_added(self.inputs.marker_edits, lps_mm=_point(lps))
        self.changed_document("add a ball", lambda document: _edited(document, edits))

    @action
    def remove_marker(self, ball_index: int) -> None:
        """Take a ball away, and its number."""
        ball = self._ball(ball_index)
        edits = self.engine.with_ball_removed(self.inputs.marker_edits, ball=ball)
        numbering = self._without(ball["center_mm"])

        def change(document: Document) -> Document:
            return {**_edited(document, edits), **numbering}

        self.changed_document(f"remove ball {ball_index + 1}", change)

    @action
    def move_marker(self, ball_index: int, lps: Sequence[float]) -> None:
        """Move a ball, with its number, to a point of the image, LPS mm."""
        ball, point = self._ball(ball_index), _point(lps)
        edits = self.engine.with_ball_removed(self.inputs.marker_edits, ball=ball)
        edits = self.engine.with_ball_added(edits, lps_mm=point)
        given = self._numbers() if self.version.content.get("numbering") else {}
        moved = {k: point if at == ball["center_mm"] else at for k, at in given.items()}

        def change(document: Document) -> Document:
            numbering = {"numbering": moved} if moved else {}
            return {**_edited(document, edits), **numbering}

        self.changed_document(f"move ball {ball_index + 1}", change)

    @action
    def number_automatically(self) -> None:
        """Let the numbers be found."""
        self.changed_document(
            "number automatically", lambda document: {**document, "numbering": None}
        )

    @action
    def assign_number(self, number: int, ball_index: int) -> None:
        """Give a ball a number.

        Another number that it had is free then, and so is the ball that had this number.
        """
        center = self._ball(ball_index)["center_mm"]
        kept = {key: at for key, at in self._numbers().items() if at != center}
        self._number(f"assign number {number}", {**kept, str(number): center})

    @action
    def clear_number(self, number: int) -> None:
        """Take a number from its ball."""
        kept = {key: at for key, at in self._numbers().items() if key != str(number)}
        self._number(f"clear number {number}", kept)

    @action
    def swap_numbers(self, a: int, b: int) -> None:
        """Exchange two numbers; one that stands on no ball goes to the other's."""
        before = self._numbers()
        names = {str(a): str(b), str(b): str(a)}
        if not names.keys() & before.keys():
            raise InputError.of(
                "numbers-not-assigned",
                "neither number stands on a ball",
                value=f"{a} and {b}",
                next_step="assign a number first",
            )
        self._number(f"swap numbers {a} and {b}", {names.get(k, k): at for k, at in before.items()})

    def _number(self, label: str, numbering: Mapping[str, Any]) -> None:
        ordered = {key: numbering[key] for key in sorted(numbering, key=int)}
        self.changed_document(label, lambda document: {**document, "numbering": ordered or None})

    def _balls(self) -> Result:
        found = self.result(Step.MARKERS)
        if found is None or found.value is None:
            raise InputError.of(
                "balls-out-of-date",
                "the balls shown are not those of the present image and edits",
                hazard="H40",
                next_step="find the balls again, then choose one",
            )
        return found

    def _ball(self, ball_index: int) -> dict[str, Any]:
        """The ball of a row of the table, as the pipeline's document has it."""
        balls = self._balls().document["balls"]
        if not 0 <= ball_index < len(balls):
            raise InputError.of(
                "no-such-ball",
                "there is no such ball",
                value=str(ball_index + 1),
                limit=f"1 to {len(balls)}",
                next_step="choose a ball of the table",
            )
        return balls[ball_index]

    def _numbers(self) -> dict[str, list[float]]:
        """The user's numbers at the centres of their balls, or those found as a start."""
        given = dict(self.version.content.get("numbering") or {})
        judged = self.result(Step.NUMBERING)
        if judged is None or judged.value is None:
            return given
        balls = self._balls().document["balls"]
        found = {n: list(balls[k]["center_mm"]) for n, k in judged.document["assigned"].items()}
        return {**given, **found}

    def _without(self, center: list[float]) -> dict[str, Any]:
        """The user's numbering without the ball at this centre; nothing where numbers are found."""
        if not self.version.content.get("numbering"):
            return {}
        kept = {key: at for key, at in self._numbers().items() if at != center}
        return {"numbering": kept or None}


def _edited(document: Document, edits: Mapping[str, Any]) -> Document:
    """The document with other marker edits, which version 2 knows."""
    return {**document, "schema_version": 2, "marker_edits": dict(edits)}


def _point(lps: Sequence[float]) -> list[float]:
    point = [float(value) for value in lps]
    if len(point) != 3:
        raise InputError.of("not-a-point", "a point has three coordinates", value=str(len(point)))
    return point
