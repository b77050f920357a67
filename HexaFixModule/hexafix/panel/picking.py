"""What a click in a view does, by the button that is pressed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from hexafix.errors import InputError
from hexafix.panel import correction, numbering, schedule
from hexafix.panel.markers import PLACE, fill_place
from hexafix.panel.text import rounded

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel


def clicked(panel: Panel, lps_mm: Sequence[float], ball: int | None) -> None:
    """Act on a click at a point in LPS mm and, where there is one, on a ball by its index."""
    action = ACTIONS.get(panel.picking)
    if action is not None:
        action(panel, lps_mm, ball)
        return
    fill_place(panel, PLACE, lps_mm)
    if ball is not None:
        panel.widgets.set("ballsTable", "index", ball)
        panel.widgets.set("assignBallComboBox", "index", ball)
        panel.ball_chosen.emit(ball)


def _add_ball(panel: Panel, lps_mm: Sequence[float], _: int | None) -> None:
    panel.presenter.add_marker(list(lps_mm))


def _give_number(panel: Panel, _: Sequence[float], ball: int | None) -> None:
    if ball is None:
        raise InputError.of(
            "no-ball-there", "there is no ball at this place", next_step="click on a ball"
        )
    panel.presenter.assign_number(numbering.chosen_number(panel), ball)


def _landmark(panel: Panel, lps_mm: Sequence[float], _: int | None) -> None:
    correction.LANDMARKS.fill(panel, [rounded(value) for value in lps_mm])


def _origin(panel: Panel, lps_mm: Sequence[float], _: int | None) -> None:
    fill_place(panel, correction.ORIGIN, lps_mm)
    correction.live(panel)


def _risk(panel: Panel, lps_mm: Sequence[float], _: int | None) -> None:
    schedule.RISKS.fill(panel, [rounded(value) for value in lps_mm])


ACTIONS: dict[str, Callable[[Panel, Sequence[float], int | None], None]] = {
    "pickMarkerButton": _add_ball,
    "pickNumberButton": _give_number,
    "pickLandmarkButton": _landmark,
    "pickOriginButton": _origin,
    "pickRiskPointButton": _risk,
}
