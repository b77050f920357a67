"""The Slicer entrance of HexaFix: names the module and hands the work to `hexafix`.

It does nothing itself. Outside Slicer the base classes are inert, so that this file imports
anywhere; its panel and scene bridge are not built yet, so Slicer does not list it.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

_HERE = str(Path(__file__).resolve().parent)
if _HERE not in sys.path:
    sys.path.insert(0, _HERE)

try:
    from slicer.ScriptedLoadableModule import (
        ScriptedLoadableModule,
        ScriptedLoadableModuleLogic,
        ScriptedLoadableModuleTest,
    )
except ImportError:
    ScriptedLoadableModule = ScriptedLoadableModuleLogic = ScriptedLoadableModuleTest = object


class HexaFixModule(ScriptedLoadableModule):  # type: ignore[misc,valid-type]
    """What Slicer shows of the module."""

    def __init__(self, parent: Any) -> None:
        if ScriptedLoadableModule is not object:
            super().__init__(parent)
        parent.title = "HexaFix"
        parent.categories = ["Orthopedics"]
        parent.dependencies = []
        parent.contributors = ["HexaFix developers"]
        parent.helpText = (
            "From a CT of a hexapod external fixator to a verified strut schedule. "
            "Research software, not a medical device."
        )
        parent.acknowledgementText = ""
        parent.hidden = True


class HexaFixModuleLogic(ScriptedLoadableModuleLogic):  # type: ignore[misc,valid-type]
    """The chain, for scripts that run inside Slicer."""

    def plan(self, case_file: str | Path, folder: str | Path) -> dict[str, Any]:
        """Plan a case file and write the export; returns the plan document."""
        from hexafix.case import load_case
        from hexafix.pipeline import plan_and_export

        return plan_and_export(load_case(Path(case_file)), Path(folder))


class HexaFixModuleTest(ScriptedLoadableModuleTest):  # type: ignore[misc,valid-type]
    """The phantom end to end, inside Slicer; raises if anything is missing."""

    def runTest(self) -> None:  # noqa: N802 - Slicer calls it so
        """Build a synthetic case, plan it and verify the export."""
        import tempfile

        from hexafix.cli.demo import run_demo
        from hexafix.progress import silent

        with tempfile.TemporaryDirectory() as folder:
            run_demo(Path(folder) / "demo", seed=1, progress=silent)
