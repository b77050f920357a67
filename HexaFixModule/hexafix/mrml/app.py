"""A whole MRML world without Slicer's application: scene, module logics, storage, no window.

Without it slicer-core's scene keeps no markups in a ``.mrb`` (their storage class is not known to
it) and reads none (there is no cache folder).
"""

from __future__ import annotations

import os
import sys
import tempfile
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from hexafix.mrml.nodes import slicer_core

LOGICS = {
    **{name: f"{name}Logic" for name in ("Markups", "Volumes", "Tables", "Models", "Texts")},
    **{name: f"{name}ModuleLogic" for name in ("Segmentations", "SubjectHierarchy", "Data")},
    "Transforms": "TransformLogic",
}
"""Module name and what follows ``vtkSlicer`` in its logic's class."""


class HeadlessMrmlApp:
    """Scene and application logic of a program without Slicer's main window.

    Parameters
    ----------
    cache_folder : Path, optional
        Where files of a scene are unpacked; by default a temporary folder that `close` removes.

    Attributes
    ----------
    scene : vtkMRMLScene
    app_logic : vtkSlicerApplicationLogic
    logics : dict of str
        Module logics by Slicer's module name.
    """

    def __init__(self, cache_folder: Path | None = None) -> None:
        if sys.platform.startswith("linux"):
            # Read when VTK is loaded; a window of its own would need a screen.
            os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")
        slicer = slicer_core()
        self.scene: Any = slicer.vtkMRMLScene()
        self.app_logic: Any = slicer.vtkSlicerApplicationLogic()
        self._temporary = (
            tempfile.TemporaryDirectory(prefix="hexafix-") if not cache_folder else None
        )
        folder = str(cache_folder) if cache_folder else self._temporary.name  # type: ignore[union-attr]
        self._start_logics(slicer, folder)
        self._start_file_access(slicer, folder)
        slicer.vtkMRMLSliceNode.AddDefaultSliceOrientationPresets(self.scene, True)
        crosshair = slicer.vtkMRMLCrosshairNode()
        crosshair.SetCrosshairName("default")
        self.scene.AddNode(crosshair)

    def _start_logics(self, slicer: Any, folder: str) -> None:
        from vtkmodules.vtkCommonCore import vtkCollection

        logic = self.app_logic
        logic.SetMRMLScene(self.scene)
        logic.SetTemporaryPath(folder)
        logic.SetSliceLogics(vtkCollection())
        logic.SetViewLogics(vtkCollection())
        logic.GetColorLogic().SetMRMLScene(self.scene)
        self.logics: dict[str, Any] = {}
        for name, suffix in LOGICS.items():
            module = getattr(slicer, f"vtkSlicer{suffix}")()
            module.SetMRMLScene(self.scene)
            module.SetMRMLApplicationLogic(logic)
            logic.SetModuleLogic(name, module)
            self.logics[name] = module
        logic.GetColorLogic().AddDefaultColorNodes()

    def _start_file_access(self, slicer: Any, folder: str) -> None:
        """What reads a scene's files; nothing is ever fetched over a network."""
        self._remote = slicer.vtkMRMLRemoteIOLogic()
        self._data = slicer.vtkDataIOManagerLogic()
        for access in (self._remote, self._data):
            access.SetMRMLScene(self.scene)
            access.SetMRMLApplicationLogic(self.app_logic)
        self._remote.GetCacheManager().SetRemoteCacheDirectory(folder)
        self._data.SetAndObserveDataIOManager(self._remote.GetDataIOManager())
        self._remote.AddDataIOToScene()

    def close(self) -> None:
        """Empty the scene and remove the temporary folder."""
        self.scene.Clear(True)
        if self._temporary is not None:
            self._temporary.cleanup()
            self._temporary = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()
