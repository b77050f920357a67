"""Starts the stand-alone workstation."""

from __future__ import annotations

import signal
from pathlib import Path

from hexafix.qt.kit import kit, need_display, views


def run_desktop(case: Path | None = None) -> int:
    """Show the window, with a case if there is one, until it is closed; returns the exit code.

    Raises
    ------
    MissingLibrary
        If Qt or its views are not installed.
    InputError
        If there is no display.
    """
    q = kit()
    need_display()
    views()
    application = q.QApplication.instance() or q.QApplication(["hexafix"])
    application.setApplicationName("HexaFix")
    from hexafix.qt.window import Window

    window = Window()
    window.show()
    if case is not None:
        window.open_case(case)
    # Python looks at Ctrl-C only when it runs: the timer lets it, twice a second.
    signal.signal(signal.SIGINT, lambda *_: window.main.close())
    awake = q.QTimer()
    awake.timeout.connect(lambda: None)
    awake.start(500)
    return int(application.exec())
