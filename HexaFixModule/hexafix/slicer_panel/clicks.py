"""Clicks in Slicer's slice views as points of the patient."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hexafix.mrml.screen import point_under
from hexafix.panel.qt_widgets import read

STILL_PIXELS = 3
"""A mouse that went farther between press and release was dragging."""

LAYOUT_CHANGED = "layoutChanged(int)"

Point = tuple[float, float, float]


class SliceClicks:
    """Watches the slice views of a layout.

    Parameters
    ----------
    layout : qSlicerLayoutManager or None
        None where Slicer runs without its main window: then there is nothing to click.
    clicked : callable
        Called with the clicked point, LPS mm.
    released : callable
        Called at the end of any drag or click in a slice or 3D view.
    """

    def __init__(
        self, layout: Any, clicked: Callable[[Point], Any], released: Callable[[], Any]
    ) -> None:
        self._layout, self._clicked, self._released = layout, clicked, released
        self._observers: list[tuple[Any, int]] = []
        self._pressed: tuple[int, int] | None = None
        self._watching = False

    def start(self) -> None:
        """Watch the views of the present layout and of every later one."""
        self.stop()
        if self._layout is not None:
            self._layout.connect(LAYOUT_CHANGED, self._watch_all)
            self._watching = True
            self._watch_all()

    def stop(self) -> None:
        """Watch no more."""
        if self._watching:
            self._layout.disconnect(LAYOUT_CHANGED, self._watch_all)
            self._watching = False
        self._forget()

    def _forget(self) -> None:
        for interactor, tag in self._observers:
            interactor.RemoveObserver(tag)
        self._observers.clear()

    def _watch_all(self, *_: Any) -> None:
        self._forget()
        for name in self._layout.sliceViewNames():
            widget = self._layout.sliceWidget(name)
            self._watch(widget.sliceView().interactor(), widget.mrmlSliceNode())
        for index in range(int(read(self._layout, "threeDViewCount"))):
            view = self._layout.threeDWidget(index).threeDView()
            self._watch(view.interactor(), None)

    def _watch(self, interactor: Any, slice_node: Any | None) -> None:
        def press(*_: Any) -> None:
            self._pressed = tuple(interactor.GetEventPosition())

        def release(*_: Any) -> None:
            pressed, self._pressed = self._pressed, None
            place = interactor.GetEventPosition()
            still = pressed is not None and all(
                abs(now - then) <= STILL_PIXELS for now, then in zip(place, pressed, strict=True)
            )
            if still and slice_node is not None:
                self._clicked(point_under(slice_node, *place))
            self._released()

        for event, call in (("LeftButtonPressEvent", press), ("LeftButtonReleaseEvent", release)):
            self._observers.append((interactor, interactor.AddObserver(event, call)))
