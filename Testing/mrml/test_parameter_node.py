"""The parameter node in the format of desktop Slicer's wrapper, and the case inside it."""

import dataclasses
import enum
import json
import pathlib
from typing import Any

import pytest
from hexafix.errors import InputError
from hexafix.mrml import parameter_node
from hexafix.mrml.parameter_node import ShellParameters


class Colour(enum.Enum):
    RED = 1
    BLUE = 2


@dataclasses.dataclass
class Pack:
    diameterMm: float = 10.0  # noqa: N815
    name: str = ""


@dataclasses.dataclass
class Everything:
    count: int = 0
    share: float = 0.5
    on: bool = False
    text: str = ""
    colour: Colour = Colour.RED
    path: pathlib.Path = pathlib.Path()
    ring: Pack = dataclasses.field(default_factory=Pack)
    volume: Any = None


def test_the_values_stand_as_the_wrapper_writes_them(app):
    node = parameter_node.parameter_node(app.scene)
    volume = app.scene.AddNewNodeByClass("vtkMRMLScalarVolumeNode")
    values = Everything(3, 0.1, True, "ä", Colour.BLUE, pathlib.Path("a/b"), Pack(12.5), volume)
    parameter_node.write(node, values)
    held = {name: node.GetParameter(name) for name in node.GetParameterNames()}
    assert held == {
        "count": "3",
        "share": "0.1",
        "on": "True",
        "text": "ä",
        "colour": "BLUE",
        "path": "a/b",
        "ring.diameterMm": "12.5",
        "ring.name": "",
        "volume": "",
    }
    assert node.GetNodeReferenceID("volume") == volume.GetID()
    assert parameter_node.read(node, Everything) == values


def test_the_node_is_the_modules_own(app):
    node = parameter_node.parameter_node(app.scene)
    assert node.GetModuleName() == "HexaFixModule"
    assert node.GetAttribute("ModuleName") == "HexaFixModule"
    assert node.GetSingletonTag() == "HexaFixModule"
    assert parameter_node.parameter_node(app.scene) is node


def test_a_node_that_slicer_made_is_taken_over(app):
    import slicer

    made = slicer.vtkMRMLScriptedModuleNode()
    made.SetSingletonTag("HexaFixModule")
    made.SetModuleName("HexaFixModule")
    app.scene.AddNode(made)
    assert parameter_node.parameter_node(app.scene) is made


@pytest.mark.parametrize(
    ("name", "value"),
    [("acceptRelaxedLayout", "yes"), ("playbackRow", "1.5"), ("splitFraction", "half")],
)
def test_a_value_of_another_kind_is_refused_by_name(app, name, value):
    node = parameter_node.parameter_node(app.scene)
    node.SetParameter(name, value)
    with pytest.raises(InputError) as refused:
        parameter_node.read(node, ShellParameters)
    assert refused.value.faults[0].where == name


def test_a_case_and_the_shells_state_come_back(app, a_phantom_case):
    case = a_phantom_case()
    parameter_node.store_case(app.scene, case, step="schedule", splitFraction=0.37)
    node = parameter_node.parameter_node(app.scene)
    shell = parameter_node.read(node, ShellParameters)
    assert (shell.step, shell.splitFraction) == ("schedule", 0.37)
    back = parameter_node.stored_case(app.scene)
    assert dict(back.document) == dict(case.document)
    assert back.case_sha256 == case.case_sha256


def test_a_changed_case_does_not_keep_the_hash_of_the_file(app, a_phantom_case):
    case = a_phantom_case()
    node = parameter_node.store_case(app.scene, case)
    document = json.loads(node.GetParameter("caseJson"))
    document["strut_readings_mm"][0] += 0.5
    node.SetParameter("caseJson", json.dumps(document))
    back = parameter_node.stored_case(app.scene)
    assert back.case_sha256 != case.case_sha256
    assert back.strut_readings_mm[0] == case.strut_readings_mm[0] + 0.5


def test_neither_path_nor_series_of_the_image_is_stored(app, a_phantom):
    document = {
        **a_phantom.case,
        "image": {"path": "/home/Doe/Jane", "series_instance_uid": "1.2.3.4"},
        "fixator": "/home/Doe/frame.json",
    }
    node = parameter_node.store_case(app.scene, document)
    held = " ".join(node.GetParameter(name) for name in node.GetParameterNames())
    assert "Doe" not in held
    assert "1.2.3.4" not in held


def test_a_draft_comes_back_as_a_draft(app):
    parameter_node.store_case(app.scene, {"schema_version": 1, "case_id": "draft-1"})
    back = parameter_node.stored_document(app.scene)
    assert back["case_id"] == "draft-1"
    with pytest.raises(InputError):
        parameter_node.stored_case(app.scene)


def test_a_scene_without_a_case_says_so(app):
    assert parameter_node.stored_document(app.scene) is None
    with pytest.raises(InputError) as refused:
        parameter_node.stored_case(app.scene)
    assert refused.value.faults[0].code == "no-case-in-scene"


def test_every_character_survives_the_scenes_file(app, tmp_path):
    """MRML writes parameters as XML attributes."""
    from hexafix.mrml import HeadlessMrmlApp

    text = json.dumps({"a": 'b "c" <d> & ; : = % %20 é ü 髓\n\ttab'}, ensure_ascii=False)
    node = parameter_node.parameter_node(app.scene)
    parameter_node.write(node, ShellParameters(caseJson=text))
    app.scene.SetURL(str(tmp_path / "scene.mrml"))
    assert app.scene.Commit()
    with HeadlessMrmlApp() as other:
        other.scene.SetURL(str(tmp_path / "scene.mrml"))
        assert other.scene.Import()
        back = parameter_node.read(parameter_node.parameter_node(other.scene), ShellParameters)
    assert back.caseJson == text
