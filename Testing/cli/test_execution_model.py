"""`hexafix plan --xml` says what the command line takes: a form made from it runs."""

import inspect
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Annotated, Literal
from xml.etree import ElementTree

import hexafix
import pytest
from cyclopts import App, Parameter
from hexafix.cli import app as command_line
from hexafix.cli.execution_model import Channel, execution_model_xml

EXECUTABLE = ["category", "title", "description", "version", "license", "contributor"]
PARAMETER = ["name", "flag", "longflag", "index", "description", "label", "default", "channel"]
PARAMETER += ["element"]
"""The order of elements in ctkCmdLineModule.xsd."""


def run_hexafix(*arguments):
    return subprocess.run(
        [sys.executable, "-m", "hexafix", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"PYTHONPATH": os.pathsep.join(p for p in sys.path if p)},
    )


def read(xml):
    """Parameters by name, read as a strict reader of the schema does."""
    root = ElementTree.fromstring(xml)
    assert root.tag == "executable"
    tags = [element.tag for element in root]
    assert tags == EXECUTABLE + ["parameters"] * (len(tags) - len(EXECUTABLE))
    found = {}
    for group in root.iter("parameters"):
        assert [element.tag for element in group][:2] == ["label", "description"]
        for element in list(group)[2:]:
            tags = [child.tag for child in element]
            assert tags == sorted(tags, key=PARAMETER.index), "the schema's order"
            entry = {child.tag: child.text for child in element}
            assert re.fullmatch(r"[_a-zA-Z][_a-zA-Z0-9]*", entry["name"])
            assert ("index" in entry) != ("longflag" in entry)
            assert re.fullmatch(r"--[_a-zA-Z][_a-zA-Z0-9]*", entry.get("longflag", "--x"))
            assert re.fullmatch(r"-[a-zA-Z]", entry.get("flag", "-x"))
            assert entry["description"]
            assert entry["label"]
            entry["elements"] = [child.text for child in element if child.tag == "element"]
            assert entry["name"] not in found
            found[entry["name"]] = entry | {"tag": element.tag, **element.attrib}
    return found


def compose(parameters, values):
    """A command line as Slicer composes it: flags first, then what has an index."""
    options, places = [], {}
    for name, value in values.items():
        entry = parameters[name]
        if "index" in entry:
            places[int(entry["index"])] = str(value)
        elif entry["tag"] == "boolean":
            options += [entry["longflag"]] if value else []
        else:
            options += [entry["longflag"], str(value)]
    return [*options, *(places[k] for k in sorted(places))]


@pytest.fixture(scope="module")
def description():
    run = run_hexafix("plan", "--xml")
    assert run.returncode == 0, run.stderr
    assert run.stderr == ""
    return run.stdout


def test_every_parameter_of_plan_stands_in_the_xml_with_its_default(description):
    signature = inspect.signature(command_line.plan)
    wanted = {name: p for name, p in signature.parameters.items() if name != "xml"}
    parameters = read(description)
    assert set(parameters) == set(wanted)
    for name, parameter in wanted.items():
        default = parameters[name].get("default")
        if parameter.default is inspect.Parameter.empty:
            assert default is None
        else:
            assert default == {False: "false"}[parameter.default]
        assert ("index" in parameters[name]) == (parameter.kind is parameter.POSITIONAL_OR_KEYWORD)


def test_the_case_is_a_file_the_export_a_folder_and_switches_are_flags(description):
    parameters = read(description)
    case, out = parameters.pop("case"), parameters.pop("out")
    assert (case["tag"], case["index"], case["channel"]) == ("file", "0", "input")
    assert case["fileExtensions"] == ".json"
    assert (out["tag"], out["longflag"], out["channel"]) == ("directory", "--out", "output")
    assert {entry["tag"] for entry in parameters.values()} == {"boolean"}


def test_the_xml_says_version_and_that_it_is_no_medical_device(description):
    root = ElementTree.fromstring(description)
    assert root.findtext("version") == hexafix.__version__
    assert "not a medical device" in root.findtext("description")
    assert root.findtext("title") == "HexaFix plan"


def test_the_command_takes_every_flag_of_the_xml(description):
    parameters = read(description)
    values = {"case": Path("a.json"), "out": Path("b")}
    values |= {name: True for name, entry in parameters.items() if entry["tag"] == "boolean"}
    assert len(values) >= 6
    tokens = ["plan", *compose(parameters, values)]
    _, bound, ignored = command_line.app.parse_args(tokens, exit_on_error=False, print_error=False)
    assert dict(bound.arguments) == values
    assert not ignored
    short = ["plan", "a.json", "--out", "b", parameters["quiet"]["flag"]]
    _, bound, _ = command_line.app.parse_args(short, exit_on_error=False, print_error=False)
    assert bound.arguments["quiet"] is True


def test_a_command_line_made_from_the_xml_plans(description, a_phantom, tmp_path):
    from hexafix.phantom import write_phantom

    write_phantom(a_phantom, tmp_path / "bundle", image_format="nrrd")
    values = {"case": tmp_path / "bundle" / "case.json", "out": tmp_path / "export"}
    values |= {"accept_relaxed_layout": False, "json": True, "quiet": True}
    run = run_hexafix("plan", *compose(read(description), values))
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout) == json.loads((tmp_path / "export" / "plan.json").read_text())


def test_xml_is_printed_also_when_arguments_stand_beside_it(description, tmp_path):
    run = run_hexafix("plan", "case.json", "--out", tmp_path / "export", "--xml")
    assert run.stdout == description
    assert not (tmp_path / "export").exists()


def test_other_commands_have_no_xml():
    run = run_hexafix("series", "--xml")
    assert run.returncode == 2
    assert run.stdout == ""


def described(function):
    app = App()
    app.command(function, name="try-it")
    return execution_model_xml(app, "try-it")


def test_numbers_texts_and_choices_have_their_elements():
    def work(
        *,
        count: Annotated[int, Parameter(help="How many.")] = 3,
        gap_mm: Annotated[float, Parameter(help="Gap.")] = 1.5,
        kind: Annotated[Literal["dicom", "nrrd"], Parameter(help="Kind.")] = "nrrd",
        note: Annotated[str, Parameter(help="a < b & c")] = "",
    ) -> None:
        """Do it.

        Not told.
        """

    parameters = read(described(work))
    tags = {name: (entry["tag"], entry["default"]) for name, entry in parameters.items()}
    assert tags == {
        "count": ("integer", "3"),
        "gap_mm": ("double", "1.5"),
        "kind": ("string-enumeration", "nrrd"),
        "note": ("string", None),
    }
    assert parameters["kind"]["elements"] == ["dicom", "nrrd"]
    assert parameters["note"]["description"] == "a < b & c"
    root = ElementTree.fromstring(described(work))
    assert root.findtext("title") == "HexaFix try it"
    assert root.findtext("description").startswith("Do it. Research")


def a_path(*, folder: Annotated[Path, Parameter(help="Where.")]) -> None:
    """A path that does not say whether it is read or written."""


def a_switch(*, on: Annotated[bool, Parameter(help="On.")] = True) -> None:
    """A switch that a form could not turn off."""


def a_pair(*, size: Annotated[tuple[int, int], Parameter(help="Size.")] = (1, 2)) -> None:
    """Two values of one option, which Slicer would join by a comma."""


def a_marked_number(*, n: Annotated[int, Parameter(help="N."), Channel("file", "input")]) -> None:
    """A number that claims to be a file."""


@pytest.mark.parametrize("function", [a_path, a_switch, a_pair, a_marked_number])
def test_what_the_description_cannot_say_is_an_error_and_no_wrong_form(function):
    with pytest.raises(TypeError):
        described(function)
