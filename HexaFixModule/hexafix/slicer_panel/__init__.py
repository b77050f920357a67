"""The workflow panel inside desktop Slicer: the shared panel on PythonQt, the scene in its views.

Nothing here is needed outside Slicer, and nothing of the chain is loaded before the panel opens:
what HexaFix needs may have to be installed first, which the user is asked for.
"""

from hexafix.slicer_panel.description import describe
from hexafix.slicer_panel.requirements import install, missing
from hexafix.slicer_panel.shell import SlicerPanel

__all__ = ["SlicerPanel", "describe", "install", "missing"]
