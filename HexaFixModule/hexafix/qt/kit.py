"""Qt's classes, loaded when the window is first asked for, and the few classes made from them."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from functools import cache
from types import SimpleNamespace
from typing import Any

from hexafix.errors import InputError, MissingLibrary


@cache
def kit() -> Any:
    """Qt's classes by name, from PySide6 through qtpy.

    Raises
    ------
    MissingLibrary
        If Qt, or VTK's windows for it, is not installed.
    """
    os.environ.setdefault("QT_API", "pyside6")
    try:
        from qtpy import QtCore, QtGui, QtWidgets
        from qtpy.QtUiTools import QUiLoader
    except ImportError as error:
        raise _missing("qtpy and PySide6-Essentials") from error
    found = {
        name: getattr(module, name)
        for module in (QtCore, QtGui, QtWidgets)
        for name in dir(module)
        if name.startswith("Q") and not name.startswith("Qt")
    }
    found |= {name: getattr(QtCore, name) for name in ("Qt", "Signal")}
    return SimpleNamespace(**found, QUiLoader=QUiLoader)


@cache
def views() -> Any:
    """VTK's windows for Qt: `QtInteractor` and `QVTKRenderWindowInteractor`.

    Raises
    ------
    MissingLibrary
        If pyvistaqt or VTK is not installed.
    """
    kit()
    # A window of Qt needs the window system's OpenGL, whatever a scene without one has asked for.
    os.environ.pop("VTK_DEFAULT_OPENGL_WINDOW", None)
    try:
        import pyvista
        import vtkmodules.qt

        vtkmodules.qt.PyQtImpl = "PySide6"
        import vtkmodules.vtkInteractionStyle
        import vtkmodules.vtkRenderingOpenGL2
        from pyvistaqt import QtInteractor
        from pyvistaqt.rwi import QVTKRenderWindowInteractor
    except ImportError as error:
        raise _missing("pyvista, pyvistaqt and vtk") from error
    return SimpleNamespace(
        QtInteractor=QtInteractor,
        QVTKRenderWindowInteractor=QVTKRenderWindowInteractor,
        pyvista=pyvista,
    )


def _missing(what: str) -> MissingLibrary:
    return MissingLibrary.of(
        "library-missing",
        f"the Qt workstation needs {what}, which is not installed",
        next_step="install hexafix[qt]",
    )


PROBE = """
from qtpy.QtGui import QOffscreenSurface, QOpenGLContext
from qtpy.QtWidgets import QApplication
app = QApplication([])
surface, context = QOffscreenSurface(), QOpenGLContext()
surface.create()
raise SystemExit(0 if context.create() and context.makeCurrent(surface) else 3)
"""
"""Asks for a display and its OpenGL in a process of its own, since Qt ends the one that fails."""

PROBE_S = 60.0

NO_OPENGL = 3


def need_display() -> None:
    """Say in words what would end the process: no display, or one without OpenGL.

    Raises
    ------
    InputError
        If no window can be shown.
    """
    if not sys.platform.startswith("linux"):
        return
    named = ("DISPLAY", "WAYLAND_DISPLAY", "QT_QPA_PLATFORM")
    if not any(os.environ.get(name) for name in named):
        raise no_display("no display is named by DISPLAY or WAYLAND_DISPLAY")
    try:
        code = subprocess.run(
            [sys.executable, "-c", PROBE],
            capture_output=True,
            check=False,
            stdin=subprocess.DEVNULL,
            timeout=PROBE_S,
        ).returncode
    except subprocess.TimeoutExpired:
        code = -1
    if code == NO_OPENGL:
        raise no_display("the display has no OpenGL")
    if code:
        raise no_display("Qt cannot open a window on the display, or lacks a system library")


def no_display(why: str) -> InputError:
    """The error of a machine that cannot show a window."""
    return InputError.of(
        "no-display",
        "the Qt workstation needs a display",
        value=why,
        next_step="start it on a desktop (Debian: with libxcb-cursor0 and libgl1), or use "
        "hexafix serve in a browser",
    )


@cache
def made() -> Any:
    """The classes that must inherit from Qt's."""
    q = kit()

    class Poster(q.QObject):
        """Runs callables on the thread that made it, in their order."""

        posted = q.Signal(object)

        def __init__(self) -> None:
            super().__init__()
            self.posted.connect(self._run, q.Qt.QueuedConnection)

        def post(self, work: Callable[[], Any]) -> None:
            """Run `work` soon, from any thread."""
            self.posted.emit(work)

        def _run(self, work: Callable[[], Any]) -> None:
            work()

    class Closing(q.QObject):
        """Asks before a window closes."""

        def __init__(self, window: Any, may_close: Callable[[], bool]) -> None:
            super().__init__(window)
            self._window, self._may_close = window, may_close
            window.installEventFilter(self)

        def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
            """Stop the close event where the window may not close."""
            if watched is self._window and event.type() == q.QEvent.Close:
                if self._may_close():
                    event.accept()
                    return False
                event.ignore()
                return True
            return False

    class WheelGuard(q.QObject):
        """Keeps the wheel from changing a choice that only lies under the pointer."""

        def eventFilter(self, watched: Any, event: Any) -> bool:  # noqa: N802 - Qt's name
            """Hand the wheel on to the page."""
            if event.type() == q.QEvent.Wheel and not watched.hasFocus():
                event.ignore()
                return True
            return False

    return SimpleNamespace(Poster=Poster, Closing=Closing, WheelGuard=WheelGuard)
