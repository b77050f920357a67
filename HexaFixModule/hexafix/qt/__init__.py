"""The stand-alone workstation in Qt: the shared panel beside four views.

Qt and VTK are loaded when the window is first asked for.
"""

from hexafix.qt.app import run_desktop
from hexafix.qt.window import Window

__all__ = ["Window", "run_desktop"]
