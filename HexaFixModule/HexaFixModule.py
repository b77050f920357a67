"""The Slicer entrance of HexaFix: names the module and hands the work to `hexafix`.

It does nothing itself. Outside Slicer the base classes are inert, so that this file imports
anywhere; logic and test then work on any MRML scene, such as one of slicer-core.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

_HERE = str(Path(__file__).resolve().parent)
if _HERE not in sys.path:
    sys.path.insert(0, _HERE)

try:
    from slicer.ScriptedLoadableModule import (  # pyright: ignore[reportMissingImports]
        ScriptedLoadableModule,
        ScriptedLoadableModuleLogic,
        ScriptedLoadableModuleTest,
        ScriptedLoadableModuleWidget,
    )
except ImportError:

    class _Inert:
        """Base class outside Slicer."""

        def __init__(self, parent: Any = None) -> None:
            self.parent = parent

    ScriptedLoadableModule = ScriptedLoadableModuleWidget = _Inert
    ScriptedLoadableModuleLogic = ScriptedLoadableModuleTest = _Inert


def _slicer() -> Any:
    """The module ``slicer`` of the running application."""
    import slicer

    return slicer


class HexaFixModule(ScriptedLoadableModule):  # type: ignore[misc,valid-type]
    """What Slicer shows of the module."""

    def __init__(self, parent: Any) -> None:
        from hexafix.slicer_panel import describe

        super().__init__(parent)
        describe(parent)


class HexaFixModuleWidget(ScriptedLoadableModuleWidget):  # type: ignore[misc,valid-type]
    """The panel's place in Slicer; the panel itself is `hexafix.slicer_panel.SlicerPanel`."""

    def setup(self) -> None:
        """Open the panel."""
        from hexafix.slicer_panel import SlicerPanel

        super().setup()
        application = _slicer()
        app_logic = application.app.applicationLogic()
        self.panel = SlicerPanel(self.parent, application.mrmlScene, app_logic=app_logic)

    def enter(self) -> None:
        """The user comes to the module."""
        self.panel.enter()

    def exit(self) -> None:
        """The user goes to another module."""
        self.panel.exit()

    def cleanup(self) -> None:
        """Slicer closes, or the module is loaded anew."""
        self.panel.close()


class HexaFixModuleLogic(ScriptedLoadableModuleLogic):  # type: ignore[misc,valid-type]
    """The chain on a scene, for scripts: volume node in, nodes and export out.

    Parameters
    ----------
    parent : qSlicerScriptedLoadableModule, optional
    scene : vtkMRMLScene, optional
        Slicer's own if not given.
    """

    def __init__(self, parent: Any = None, scene: Any = None) -> None:
        super().__init__(parent)
        self.scene = _slicer().mrmlScene if scene is None else scene

    def plan(
        self, volumeNode: Any, caseFile: str | Path, folder: str | Path, **options: Any
    ) -> dict[str, Any]:
        """Plan a case file on a volume node, show the plan in the scene and write the export.

        `options` are those of `hexafix.mrml.SceneLogic.plan`, such as ``accept_relaxed_layout``;
        returns the plan document, as ``plan.json`` holds it.
        """
        from hexafix.case import load_case
        from hexafix.mrml import SceneLogic

        case = load_case(Path(caseFile), needs_image=False)
        return SceneLogic(self.scene).plan(volumeNode, case, Path(folder), **options)


class HexaFixModuleTest(ScriptedLoadableModuleTest):  # type: ignore[misc,valid-type]
    """A synthetic patient from volume node to prescription; raises if anything is missing."""

    def runTest(self, **_: Any) -> None:  # noqa: N802 - Slicer calls it so
        """Plan the phantom by the logic and check scene, export and error against its truth."""
        from hexafix.mrml.phantom_check import check_on_phantom, scene_for_test

        with scene_for_test() as scene:
            check_on_phantom(HexaFixModuleLogic(scene=scene).plan, scene)
