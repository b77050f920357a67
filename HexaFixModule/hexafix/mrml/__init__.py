"""The bridge to MRML, the scene of 3D Slicer: the only place of the program where RAS stands.

The scene is always an argument: the same code serves slicer-core alone (`HeadlessMrmlApp`),
trame-slicer's ``SlicerApp`` and desktop Slicer. Everything above and below this room is LPS, mm;
nodes hold RAS, and the files that MRML writes of them hold LPS again. slicer-core and VTK are
loaded when first used.
"""

from hexafix.mrml.app import HeadlessMrmlApp
from hexafix.mrml.bundle import open_bundle, save_bundle
from hexafix.mrml.logic import SceneLogic
from hexafix.mrml.sync import SceneSync

__all__ = ["HeadlessMrmlApp", "SceneLogic", "SceneSync", "open_bundle", "save_bundle"]
