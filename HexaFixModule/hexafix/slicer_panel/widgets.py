"""The shared adapter for Qt, in the few places where PythonQt wants something else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hexafix.panel import QtWidgets
from hexafix.paths import resources
from hexafix.slicer_panel import host


class PythonQtKit:
    """Slicer's ``qt``, where bytes are given as they are.

    PythonQt turns bytes into a QByteArray by itself, while its constructor would take them as text
    and cut a PNG off at the first zero.
    """

    def __init__(self, qt: Any) -> None:
        self._qt = qt

    def __getattr__(self, name: str) -> Any:
        return getattr(self._qt, name)

    @staticmethod
    def QByteArray(content: bytes) -> bytes:  # noqa: N802 - Qt's name
        """The bytes themselves."""
        return content


class PythonQtWidgets(QtWidgets):
    """`hexafix.panel.Widgets` over the panel as Slicer loads it."""

    def attach(self, widget: Any, signal: str, slot: Callable[..., Any]) -> None:
        """Connect a signal by its whole name: PythonQt would take the wrong one of two."""
        widget.connect(signal, slot)


def load_panel(parent: Any) -> PythonQtWidgets:
    """The panel of ``Resources/UI/HexaFixModule.ui`` inside `parent`, a widget with a layout."""
    util = host.slicer().util
    root = util.loadUI(str(resources() / "UI" / "HexaFixModule.ui"))
    parent.layout().addWidget(root)
    named = util.childWidgetVariables(root)
    return PythonQtWidgets(root, PythonQtKit(host.qt()), lambda name: getattr(named, name))
