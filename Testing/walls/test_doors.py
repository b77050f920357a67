"""No door computes: presenter, panels and entrance reach the mathematics by the pipeline alone."""

import ast
import re
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule" / "hexafix"

DOORS = ("presenter", "panel", "web", "qt", "slicer_panel")
"""Rooms that people look at or click on."""

MAY_REACH = {"errors", "progress", "paths", "strict_json", "threads", "libraries"} | {
    "case", "export", "pipeline", "surfaces", "presenter", "mrml", "panel",
}  # fmt: skip
"""What a door may import of the package: no room that holds arithmetic but the pipeline."""

ARITHMETIC = {"numpy", "scipy", "math", "cmath", "statistics", "decimal", "fractions", "numbers"}
"""Libraries that a door has no use for."""


def door_files():
    files = [path for door in DOORS for path in sorted((PACKAGE / door).rglob("*.py"))]
    return [*files, PACKAGE.parent / "HexaFixModule.py"]


def imported(path):
    """Every module that a file names in an import, wherever it stands."""
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            yield node.module
            if node.module == "hexafix":
                yield from (f"hexafix.{alias.name}" for alias in node.names)


def test_every_door_is_there():
    assert {door for door in DOORS if any((PACKAGE / door).glob("*.py"))} == set(DOORS)


@pytest.mark.parametrize("path", door_files(), ids=lambda p: str(p.relative_to(PACKAGE.parent)))
def test_a_door_imports_no_arithmetic_room_but_the_pipeline(path):
    own = path.relative_to(PACKAGE).parts[0] if path.is_relative_to(PACKAGE) else ""
    rooms = {name.split(".")[1] for name in imported(path) if re.match(r"hexafix\.\w", name)}
    rooms -= {"__version__", own}
    if path.name == "HexaFixModule.py":
        rooms -= {"slicer_panel"}
    assert rooms <= MAY_REACH
    assert {name.split(".")[0] for name in imported(path)} & ARITHMETIC == set()


@pytest.mark.parametrize("path", door_files(), ids=lambda p: str(p.relative_to(PACKAGE.parent)))
def test_a_door_multiplies_no_matrices(path):
    nodes = ast.walk(ast.parse(path.read_text("utf-8")))
    assert not [
        n.lineno for n in nodes if isinstance(n, ast.BinOp) and isinstance(n.op, ast.MatMult)
    ]


@pytest.mark.parametrize("door", ["presenter", "panel"])
def test_presenter_and_panel_load_no_toolkit_by_themselves(door, modules_after):
    heavy = {"vtk", "vtkmodules", "pyvista", "slicer", "qt", "qtpy", "PySide6", "trame"}
    assert modules_after(f"import hexafix.{door}") & heavy == set()
