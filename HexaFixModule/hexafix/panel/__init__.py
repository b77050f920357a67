"""The panel without a toolkit: which widget of ``Resources/UI/HexaFixModule.ui`` does what.

`Panel` works through `Widgets`, so that stand-alone Qt and the Qt of desktop Slicer need only an
adapter each; `QtWidgets` is what both adapters share.
"""

from hexafix.panel.panel import BINDINGS, Panel
from hexafix.panel.qt_widgets import QtWidgets
from hexafix.panel.widgets import Widgets

__all__ = ["BINDINGS", "Panel", "QtWidgets", "Widgets"]
