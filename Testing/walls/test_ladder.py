"""Arrows go only down the ladder of rooms, and a plain import stays small."""

import ast
import sys
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule" / "hexafix"

LADDER = {
    "errors": 0,
    "progress": 0,
    "paths": 1,
    "strict_json": 1,
    "threads": 1,
    "libraries": 1,
    "__init__": 1,
    "geometry": 2,
    "hardware": 3,
    "imaging": 3,
    "markers": 4,
    "recognition": 5,
    "kinematics": 5,
    "accuracy": 6,
    "correction": 6,
    "phantom": 6,
    "case": 7,
    "gates": 7,
    "report": 8,
    "export": 8,
    "verify": 9,
    "selftest": 9,
    "pipeline": 10,
    "benchmark": 11,
    "scenarios": 11,
    "surfaces": 11,
    "presenter": 11,
    "mrml": 12,
    "panel": 12,
    "study": 12,
    "web": 13,
    "qt": 13,
    "slicer_panel": 13,
    "comparison": 13,
    "cli": 14,
    "__main__": 15,
}
"""Each room's level: a room may import rooms of lower levels only."""

SIDEWAYS_OR_DOORS = {"vtk", "vtkmodules", "pyvista", "slicer", "qt", "ctk", "qtpy", "PySide6",
                     "trame", "trame_slicer", "pyvistaqt", "matplotlib", "skimage", "joblib",
                     "distributed", "cc3d"}  # fmt: skip
"""Optional libraries: never imported at a module's top level."""

LIBRARIES = {
    "errors": set(),
    "paths": set(),
    "strict_json": set(),
    "threads": set(),
    "libraries": set(),
    "progress": set(),
    "geometry": {"numpy", "scipy"},
    "hardware": {"numpy"},
    "imaging": {"numpy", "pydicom", "SimpleITK", "scipy"},
    "markers": {"numpy", "scipy"},
    "recognition": {"numpy", "scipy"},
    "kinematics": {"numpy", "scipy"},
    "accuracy": {"numpy", "scipy"},
    "correction": {"numpy", "scipy"},
    "phantom": {"numpy", "scipy", "pydicom", "SimpleITK"},
    "case": {"numpy", "pydantic"},
    "gates": {"numpy"},
    "export": set(),
    "report": {"numpy", "scipy", "typst", "vtkmodules", "pypdfium2"},
    "verify": {"numpy", "scipy", "pypdfium2"},
    "selftest": {"numpy", "scipy"},
    "pipeline": {"numpy", "scipy"},
    "cli": {"cyclopts", "rich"},
    "study": {"numpy", "matplotlib", "joblib", "distributed"},
    "scenarios": {"numpy", "pydicom"},
    "benchmark": {"numpy", "scipy", "pydicom", "SimpleITK", "skimage", "vtkmodules", "psutil"}
    | {"cc3d"},
    "comparison": {"matplotlib"},
    "surfaces": {"numpy", "vtkmodules"},
    "presenter": set(),
    "mrml": {"numpy", "slicer", "vtk", "vtkmodules"},
    "panel": set(),
    "web": {
        "trame",
        "trame_client",
        "trame_server",
        "trame_slicer",
        "trame_vuetify",
        "trame_rca",
        "wslink",
        "aiohttp",
        "PIL",
        "slicer",
        "vtk",
        "vtkmodules",
    },
    "qt": {"qtpy", "PySide6", "pyvista", "pyvistaqt", "vtkmodules"},
    "slicer_panel": {"qt", "ctk", "slicer", "vtk"},
}
"""What each room may use besides the standard library, anywhere in its files."""


def files():
    return sorted(PACKAGE.rglob("*.py"))


def room(path):
    return path.relative_to(PACKAGE).parts[0].removesuffix(".py")


def imports(path, *, top_level_only=False):
    tree = ast.parse(path.read_text())
    hidden = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            hidden |= {id(inner) for inner in ast.walk(node)}
    nodes = tree.body if top_level_only else ast.walk(tree)
    for node in nodes:
        if id(node) in hidden:
            continue
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            yield node.module
            if node.module == "hexafix":
                yield from (f"hexafix.{alias.name}" for alias in node.names)


@pytest.mark.parametrize("path", files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_a_room_imports_only_rooms_below_it(path):
    own = room(path)
    for name in imports(path):
        parts = name.split(".")
        if parts[0] == "hexafix" and len(parts) > 1 and parts[1] in LADDER:
            other = parts[1]
            assert other == own or LADDER[other] < LADDER[own], f"{own} imports {other}"


@pytest.mark.parametrize("path", files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_a_room_uses_only_its_libraries(path):
    own = room(path)
    if own in ("__init__", "__main__"):
        return
    used = {name.split(".")[0] for name in imports(path)} - set(sys.stdlib_module_names)
    assert used - {"hexafix"} <= LIBRARIES[own]


@pytest.mark.parametrize("path", files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_optional_libraries_are_imported_where_they_are_used(path):
    top = {name.split(".")[0] for name in imports(path, top_level_only=True)}
    assert not top & SIDEWAYS_OR_DOORS


@pytest.mark.parametrize("path", files(), ids=lambda p: str(p.relative_to(PACKAGE)))
def test_no_file_is_longer_than_400_lines_and_no_function_than_60(path):
    text = path.read_text()
    assert text.count("\n") <= 400
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            if body:
                length = body[-1].end_lineno - body[0].lineno + 1
                assert length <= 60, f"{node.name} has {length} lines"


def test_every_room_stands_on_the_ladder():
    assert {room(path) for path in files()} <= set(LADDER)


def test_a_plain_import_pulls_in_nothing_heavy(modules_after):
    loaded = modules_after("import hexafix")
    assert not loaded & {"numpy", "scipy", "pydantic", "SimpleITK", "pydicom", "vtk", "typst"}


def test_the_command_line_starts_without_the_chain(modules_after):
    loaded = modules_after("import hexafix.cli")
    assert not loaded & {"numpy", "scipy", "pydantic", "SimpleITK", "pydicom", "vtk", "typst"}


def test_the_chain_imports_no_toolkit(modules_after):
    loaded = modules_after("import hexafix.pipeline, hexafix.verify")
    assert not loaded & (SIDEWAYS_OR_DOORS - {"matplotlib"})


def test_the_slicer_entrance_imports_without_slicer_and_does_no_arithmetic(modules_after):
    entrance = PACKAGE.parent / "HexaFixModule.py"
    names = {name.split(".")[0] for name in imports(entrance)}
    assert names <= {"hexafix", "slicer", "sys", "pathlib", "typing", "tempfile", "__future__"}
    assert "HexaFixModule" in modules_after("import HexaFixModule")


def test_the_public_names_are_loaded_when_used():
    import hexafix

    for name in hexafix.__all__:
        assert getattr(hexafix, name) is not None
    with pytest.raises(AttributeError):
        _ = hexafix.no_such_name
