"""The module's own test: a synthetic patient through a volume node, held against its truth."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hexafix import export
from hexafix.errors import Fault, HexaFixError
from hexafix.mrml.app import HeadlessMrmlApp
from hexafix.mrml.logic import SceneLogic
from hexafix.mrml.nodes import find, slicer_core
from hexafix.phantom import Phantom, PhantomSpec, make_phantom
from hexafix.phantom.compare import errors_against_truth
from hexafix.verify import verify_export

SPEC = PhantomSpec(
    seed=1,
    size_ijk=(280, 300, 220),
    spacing_mm=(1.0, 0.95, 1.3),
    image_angles_rad=(0.08, -0.06, 0.11),
    noise_hu=20.0,
    correction="fragment-motion",
)
"""Oblique, anisotropic and off-origin, and coarse enough to be quick."""

SHOWN = (
    *("markups/proximal", "markups/distal"),
    *("model/ring/proximal/plate", "model/ring/distal/plate"),
    *(f"model/strut/{strut}" for strut in range(1, 7)),
    *("model/bone/proximal", "model/bone/distal"),
    *("transform/ring/proximal", "transform/ring/distal", "transform/target/fragment"),
    *("table/struts", "parameters"),
)
"""Roles of the nodes that a plan leaves in the scene."""

LARGEST = {"ball_worst_mm": 0.1, "recognised_mm": 0.2, "struts_mm": 0.5, "end_mm": 1.0}
"""How far the chain may be off the truth; it is better by far, and a fault is worse by far."""

PlanNode = Callable[..., Any]
"""Plans: called with volume node, case file and the export's folder."""


@contextmanager
def scene_for_test() -> Iterator[Any]:
    """Slicer's scene, emptied, or one of slicer-core where there is no Slicer."""
    scene = getattr(slicer_core(), "mrmlScene", None)
    if scene is not None:
        scene.Clear(0)
        yield scene
        return
    with HeadlessMrmlApp() as app:
        yield app.scene


def check_on_phantom(plan: PlanNode, scene: Any, *, phantom: Phantom | None = None) -> None:
    """Plan a phantom and look at everything that must come of it.

    Parameters
    ----------
    plan : callable
        Plans a volume node and a case file, shows the plan in `scene` and writes the export.
    scene : vtkMRMLScene
    phantom : Phantom, optional
        A small one is made if none is given.

    Raises
    ------
    HexaFixError
        With everything that is missing or wrong.
    """
    phantom = phantom or make_phantom(SPEC)
    with tempfile.TemporaryDirectory(prefix="hexafix-test-") as name:
        folder = Path(name)
        # The image is the volume node: no file of it is needed.
        (folder / "case.json").write_text(json.dumps(phantom.case), encoding="utf-8")
        node = SceneLogic(scene).add_volume(phantom.volume, "Phantom")
        out = folder / "export"
        document = plan(node, folder / "case.json", out)
        faults = _missing_files(out)
        if not faults and not verify_export(out)["verified"]:
            faults.append(_fault("the export does not verify"))
    faults += [_fault(f"no node {role}") for role in SHOWN if find(scene, role) is None]
    found = errors_against_truth(document, phantom.truth)
    if found["balls_found"] != found["balls"]:
        faults.append(
            _fault("balls were not found", f"{found['balls_found']}", f"{found['balls']}")
        )
    for key, limit in LARGEST.items():
        if not found[key] <= limit:
            faults.append(_fault(f"{key} is off the truth", f"{found[key]:.3f} mm", f"{limit} mm"))
    if faults:
        raise HexaFixError(*faults)


def _missing_files(out: Path) -> list[Fault]:
    held = {path.name for path in out.iterdir()} if out.is_dir() else set()
    wanted = {*export.FILES, export.MANIFEST}
    return [_fault(f"the export lacks {name}") for name in sorted(wanted - held)]


def _fault(what: str, value: str | None = None, limit: str | None = None) -> Fault:
    step = "report this; do not use this installation"
    return Fault("module-test", what, value=value, limit=limit, next_step=step)
