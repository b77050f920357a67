"""What Slicer's list of modules and its help pane say of HexaFix."""

from __future__ import annotations

from typing import Any

from hexafix import __version__
from hexafix.paths import resources
from hexafix.slicer_panel import host

HELP = f"""
<p>HexaFix {__version__} plans the correction by a hexapod external fixator: from a CT with marker
balls on both rings to the day by day setting of six struts, checked by a second computation and
printed as a prescription.</p>
<p>Go through the steps from above: load case and CT, find the balls, number them, recognise the
ring poses, enter the strut readings, choose the correction, compute the schedule, export. Every
edit can be undone; what is out of date is grey and cannot be exported.</p>
<p><b>Research software, not a medical device.</b> Every prescription must be checked by a surgeon
before anybody turns a strut.</p>
"""

ACKNOWLEDGEMENT = """
<p>Built on 3D Slicer, VTK, SimpleITK, pydicom, NumPy, SciPy, pydantic, typst and pdfium. The method
of pose recognition and each departure from it are told in the documents <i>method.md</i> and
<i>method-departures.md</i> that come with HexaFix.</p>
"""

CORE_MODULES = ["Markups", "Models", "SubjectHierarchy", "Tables", "Transforms", "Volumes"]
"""Modules of Slicer whose nodes the scene holds; Slicer loads them first."""


def describe(parent: Any) -> None:
    """Fill in what Slicer shows of the module.

    Parameters
    ----------
    parent : qSlicerScriptedLoadableModule
    """
    parent.title = "HexaFix"
    parent.categories = ["Orthopedics"]
    parent.dependencies = list(CORE_MODULES)
    parent.contributors = ["HexaFix developers"]
    parent.helpText = HELP
    parent.acknowledgementText = ACKNOWLEDGEMENT
    parent.icon = host.qt().QIcon(str(resources() / "Icons" / "HexaFixModule.png"))
