"""Without Slicer CMake runs the tests; with it the extension is built whole.

Slicer itself is played by `SlicerConfig.cmake` beside this file.
"""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent
MODULES = "lib/Slicer-5.12/qt-scripted-modules"

SCHEMA = {
    "required": {"$schema", "category", "scm_url"},
    "optional": {
        *("build_dependencies", "build_subdirectory", "enabled"),
        *("scm_revision", "scm_type", "tier"),
    },
}
"""Keys of slicer-extension-catalog-entry-schema-v1.0.1; it takes no others."""


def cmake(*arguments):
    assert shutil.which("cmake"), "these tests need cmake: install Debian's package cmake"
    run = subprocess.run(
        ["cmake", *map(str, arguments)], capture_output=True, text=True, check=False
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run


@pytest.fixture(scope="module")
def a_fake_slicer(tmp_path_factory):
    """A Slicer build's folder, as `Slicer_DIR` names it."""
    folder = tmp_path_factory.mktemp("slicer")
    shutil.copy(HERE / "SlicerConfig.cmake", folder)
    for name in ("UseSlicer", "GenerateConfig", "CPack"):
        (folder / f"{name}.cmake").write_text(
            f'file(APPEND ${{record}} "{name}|${{EXTENSION_DEPENDS}}|${{EXTENSION_HOMEPAGE}}'
            '|${EXTENSION_CONTRIBUTORS}|${EXTENSION_ICONURL}|${EXTENSION_SCREENSHOTURLS}\\n")\n'
        )
    return folder


@pytest.fixture(scope="module")
def a_built_extension(a_fake_slicer, top, tmp_path_factory):
    """Build and install trees of the extension."""
    build, prefix = tmp_path_factory.mktemp("build"), tmp_path_factory.mktemp("install")
    cmake("-S", top, "-B", build, f"-DSlicer_DIR={a_fake_slicer}", "-DBUILD_TESTING=ON")
    cmake("--build", build)
    cmake("--install", build, "--prefix", prefix)
    return build, prefix


def record(build):
    lines = (build / "record.txt").read_text().splitlines()
    return [tuple(line.split("|")) for line in lines]


def files_of(folder, pattern="*"):
    return {
        path.relative_to(folder).as_posix()
        for path in folder.rglob(pattern)
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_without_slicer_ctest_runs_the_tests(top, tmp_path):
    cmake("-S", top, "-B", tmp_path, "-DCMAKE_DISABLE_FIND_PACKAGE_Slicer=ON")
    assert not (tmp_path / "record.txt").exists()
    listed = subprocess.run(
        ["ctest", "--show-only=json-v1", "--test-dir", tmp_path],
        capture_output=True,
        text=True,
        check=True,
    )
    tests = {test["name"]: test["command"] for test in json.loads(listed.stdout)["tests"]}
    assert set(tests) == {"hexafix"}
    assert tests["hexafix"][1:] == ["-m", "pytest"]


def test_every_file_of_the_package_is_a_script_of_the_module(a_built_extension, top):
    calls = [entry for entry in record(a_built_extension[0]) if entry[0] == "module"]
    assert len(calls) == 1
    arguments = calls[0][1].split(";")
    assert arguments[:3] == ["NAME", "HexaFixModule", "SCRIPTS"]
    assert arguments[-1] == "WITH_GENERIC_TESTS"
    scripts = arguments[3:-1]
    assert scripts[0] == "HexaFixModule.py"
    package = {f"hexafix/{name}" for name in files_of(top / "HexaFixModule/hexafix", "*.py")}
    assert set(scripts[1:]) == package
    assert len(package) > 150


def test_the_modules_own_test_is_registered(a_built_extension):
    assert ("unittest", "SCRIPT;HexaFixModule.py") in record(a_built_extension[0])


def test_slicers_files_are_included_in_their_order(a_built_extension):
    names = [entry[0] for entry in record(a_built_extension[0])]
    assert [name for name in names if name not in ("module", "unittest")] == [
        "UseSlicer",
        "GenerateConfig",
        "CPack",
    ]
    assert names.index("module") < names.index("GenerateConfig")


@pytest.mark.parametrize("tree", [0, 1], ids=["build", "install"])
def test_module_package_and_resources_lie_side_by_side(a_built_extension, top, tree):
    modules = a_built_extension[tree] / MODULES
    assert {path.name for path in modules.iterdir()} == {"HexaFixModule.py", "hexafix", "Resources"}
    assert files_of(modules / "Resources") == files_of(top / "Resources")
    assert {"UI/HexaFixModule.ui", "Icons/HexaFixModule.png"} <= files_of(modules / "Resources")


def test_the_installed_module_finds_its_four_classes_and_its_resources(
    a_built_extension, run_python, tmp_path
):
    modules = a_built_extension[1] / MODULES
    code = (
        "import HexaFixModule as m\n"
        "from hexafix.paths import resources\n"
        "from hexafix.hardware import shipped_fixator\n"
        "names = ('', 'Widget', 'Logic', 'Test')\n"
        "print(*(getattr(m, 'HexaFixModule' + name).__name__ for name in names))\n"
        "print(resources(), shipped_fixator().id)\n"
        "print(m.__file__)\n"
    )
    run = run_python(code, path=[modules])
    assert run.returncode == 0, run.stderr
    classes, found, file = run.stdout.splitlines()
    assert classes.split() == [
        "HexaFixModule",
        "HexaFixModuleWidget",
        "HexaFixModuleLogic",
        "HexaFixModuleTest",
    ]
    assert found == f"{modules / 'Resources'} generic-6sps-160"
    assert file == str(modules / "HexaFixModule.py")


def extension_literals(top):
    text = (top / "CMakeLists.txt").read_text()
    return dict(re.findall(r'^set\(EXTENSION_([A-Z]+) "(.*)"\)$', text, re.MULTILINE))


def test_what_the_index_reads_stands_as_literals(top):
    literals = extension_literals(top)
    wanted = {"HOMEPAGE", "CATEGORY", "CONTRIBUTORS", "DESCRIPTION", "ICONURL", "SCREENSHOTURLS"}
    assert set(literals) == wanted | {"DEPENDS"}
    assert "not a medical device" in literals["DESCRIPTION"]
    assert not any("${" in value for value in literals.values())


def test_the_index_entry_keeps_its_schema(top):
    raw = (top / "HexaFix.json").read_bytes()
    assert b"\r" not in raw
    entry = json.loads(raw)
    assert SCHEMA["required"] <= set(entry)
    assert set(entry) <= SCHEMA["required"] | SCHEMA["optional"]
    assert entry["$schema"].endswith("slicer-extension-catalog-entry-schema-v1.0.1.json#")
    assert entry["tier"] in (1, 3, 5)
    assert entry["scm_type"] in ("git", "local")
    assert entry["build_dependencies"] == []
    assert entry["category"] == extension_literals(top)["CATEGORY"]


def test_names_agree_and_follow_the_index_rule(top):
    """The extension's name does not begin with Slicer, its repository's does."""
    (entry,) = top.glob("*.json")
    project = re.search(r"^project\((\w+)", (top / "CMakeLists.txt").read_text(), re.MULTILINE)[1]
    assert entry.stem == project == "HexaFix"
    repository = json.loads(entry.read_text())["scm_url"].rstrip("/").split("/")[-1]
    assert repository.removesuffix(".git").startswith("Slicer")
    assert (top / "LICENSE").is_file()
