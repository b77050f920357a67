"""Landmark pairs, each point picked by a click in a view."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from hexafix.errors import InputError
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.widgets import button, icon_button, marked, note

LEAST_PAIRS = 3


@dataclass
class LandmarksState:
    """The pairs as texts.

    Attributes
    ----------
    pairs : list of dict
        ``moving`` and ``fixed``: the point's words, empty until it is picked.
    picking : str
        ``0-moving`` while that point is waited for; empty for none.
    """

    pairs: list = field(default_factory=list)
    picking: str = ""


class Landmarks:
    """At least three pairs: a point of the moving fragment and where it belongs.

    Parameters
    ----------
    context : PanelContext
    edited : callable
        Called after each edit of the pairs.
    """

    def __init__(self, context: PanelContext, edited: Callable[[], Any]) -> None:
        self._context, self._edited = context, edited
        self._data, self._name = typed_state(context.server, LandmarksState)
        self._points: list[dict[str, list[float] | None]] = []
        self._held: list[dict[str, list[float] | None]] = []

    @property
    def picking(self) -> bool:
        """Whether a click in a view is waited for."""
        return bool(self._data.picking)

    @property
    def changed(self) -> bool:
        """Whether the pairs are not those of the case."""
        return self._points != self._held

    def build(self, moving: str) -> None:
        """Make the table of pairs.

        Parameters
        ----------
        moving : str
            Template expression of the moving fragment's name.
        """
        from trame.widgets import html

        name = self._name
        note("Each row: a point of the moving fragment, and where it belongs on the other.")
        with html.Table(classes="hxp-table", **marked("landmark-table")):
            with html.Thead(), html.Tr():
                html.Th("Pair", scope="col")
                html.Th(f"{{{{ {moving} }}}} fragment, L P S mm", scope="col")
                html.Th("Belongs at, L P S mm", scope="col")
                html.Th(raw_attrs=['aria-label="actions"'])
            with (
                html.Tbody(),
                html.Tr(v_for=f"(pair, i) in {name.pairs}", key="i"),
            ):
                html.Td("{{ i + 1 }}")
                for which in ("moving", "fixed"):
                    with html.Td():
                        html.Button(
                            f"{{{{ {name.picking} === i + '-{which}' ? 'click in a view …' : "
                            f"(pair.{which} || 'pick') }}}}",
                            type="button",
                            classes="hxp-ball",
                            click=(self._pick, f"[i, '{which}']"),
                            **marked((f"'pick-' + i + '-{which}'",)),
                        )
                with html.Td(classes="hxp-end"):
                    icon_button(
                        "mdi-delete-outline",
                        ("'Remove pair ' + (i + 1)",),
                        ("'remove-pair-' + i",),
                        (self._remove, "[i]"),
                        in_row=True,
                    )
        button("Add a pair", "add-pair", self._add, icon="mdi-plus")

    def take(self, correction: Mapping[str, Any] | None) -> None:
        """Show a correction of the document, if it is one by landmarks."""
        if correction is None or correction["kind"] != "landmarks":
            self._held = []
            return
        pairs = zip(
            correction["moving_points_lps_mm"], correction["fixed_points_lps_mm"], strict=True
        )
        self._points = [{"moving": [*moving], "fixed": [*fixed]} for moving, fixed in pairs]
        self._held = [dict(pair) for pair in self._points]
        self._show()

    def to_document(self, moving: str) -> dict[str, Any]:
        """The correction that the pairs say.

        Raises
        ------
        InputError
            If a point is missing or there are fewer than three pairs.
        """
        whole = [pair for pair in self._points if pair["moving"] and pair["fixed"]]
        if len(whole) < LEAST_PAIRS or len(whole) < len(self._points):
            raise InputError.of(
                "landmarks-missing",
                "landmark points are missing",
                value=f"{len(whole)} whole pairs of {len(self._points)}",
                limit=f"at least {LEAST_PAIRS} and no half one",
                where="correction",
                next_step="pick the missing points in the views or remove the row",
            )
        return {
            "kind": "landmarks",
            "moving": moving,
            "moving_points_lps_mm": [pair["moving"] for pair in whole],
            "fixed_points_lps_mm": [pair["fixed"] for pair in whole],
        }

    def hold(self) -> None:
        """Take the pairs as those of the case."""
        self._held = [dict(pair) for pair in self._points]

    def clear(self) -> None:
        """Forget the pairs."""
        self.stop()
        self._points, self._held = [], []
        self._show()

    def stop(self) -> None:
        """Wait for no click any more."""
        self._data.picking = ""

    def _show(self) -> None:
        self._data.pairs = [
            {which: _words(pair[which]) for which in ("moving", "fixed")} for pair in self._points
        ]
        self._context.controls.show_landmarks(
            [pair["moving"] for pair in self._points if pair["moving"]],
            [pair["fixed"] for pair in self._points if pair["fixed"]],
        )
        self._edited()

    def _add(self) -> None:
        self._points.append({"moving": None, "fixed": None})
        self._show()

    def _remove(self, row: int) -> None:
        self.stop()
        self._context.controls.pick_point(None)
        del self._points[row]
        self._show()

    def _pick(self, row: int, which: str) -> None:
        if self._data.picking == f"{row}-{which}":
            self.stop()
            self._context.controls.pick_point(None)
            return
        self._data.picking = f"{row}-{which}"

        def picked(lps: Sequence[float]) -> None:
            self._points[row][which] = [*lps]
            self.stop()
            self._context.controls.pick_point(None)
            self._show()

        self._context.ask_point(picked)


def _words(point: Sequence[float] | None) -> str:
    from hexafix.pipeline.text import format_number

    return "" if point is None else " ".join(format_number(value, 1) for value in point)
