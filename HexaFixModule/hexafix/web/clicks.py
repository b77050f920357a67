"""Clicks in a view, told apart from drags."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

STILL_PX = 4
"""A button that goes up within so many pixels of where it went down was a click."""

BEFORE_MRML = 100.0
"""Priority of the observers: they look before MRML's own widgets may swallow an event."""


class Clicks:
    """Calls `clicked(view, x, y)` for every click of the left button in a view.

    Parameters
    ----------
    view : trame_slicer.views.AbstractView
        The view to watch.
    clicked : callable
        Gets the view and the pixel from its lower left corner.
    released : callable
        Called when the button goes up, after a click or a drag.
    """

    def __init__(
        self,
        view: Any,
        clicked: Callable[[Any, int, int], None],
        released: Callable[[], None],
    ) -> None:
        self._view = view
        self._clicked, self._was_released = clicked, released
        self._down: tuple[int, int] | None = None
        interactor = view.interactor()
        interactor.AddObserver("LeftButtonPressEvent", self._press, BEFORE_MRML)
        interactor.AddObserver("LeftButtonReleaseEvent", self._release, BEFORE_MRML)

    def _press(self, interactor: Any, _event: str) -> None:
        self._down = interactor.GetEventPosition()

    def _release(self, interactor: Any, _event: str) -> None:
        down, self._down = self._down, None
        x, y = interactor.GetEventPosition()
        if down and abs(x - down[0]) <= STILL_PX and abs(y - down[1]) <= STILL_PX:
            self._clicked(self._view, x, y)
        self._was_released()
