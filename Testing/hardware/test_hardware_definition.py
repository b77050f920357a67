"""Hardware definitions are read strictly: every fault is named at once, nothing is guessed."""

import copy
import json

import numpy as np
import pytest
from hexafix.errors import HardwareDefinitionError
from hexafix.hardware import fixator_from_document, read_fixator, shipped_fixator, shipped_fixators
from hexafix.paths import resources


@pytest.fixture
def a_document() -> dict:
    path = resources() / "Hardware" / "Frames" / "generic-6sps-160.json"
    return json.loads(path.read_text(encoding="utf-8"))


def faults_of(document) -> dict[str, str]:
    """Code of each fault by its place."""
    with pytest.raises(HardwareDefinitionError) as caught:
        fixator_from_document(document, where="fixator")
    return {str(fault.where): fault.code for fault in caught.value.faults}


def test_the_definition_arrives_unchanged(a_document) -> None:
    fixator = shipped_fixator("generic-6sps-160")
    assert fixator.id == "generic-6sps-160"
    np.testing.assert_array_equal(fixator.distal.joints_mm, a_document["distal"]["joints_mm"])
    assert fixator.proximal.thickness_mm == a_document["proximal"]["thickness_mm"]
    assert (fixator.strut.min_mm, fixator.strut.max_mm) == (120.0, 240.0)
    with pytest.raises(ValueError, match="read-only"):
        fixator.proximal.joints_mm[0, 0] = 1.0


def test_every_shipped_definition_is_named_like_its_file() -> None:
    assert shipped_fixators()
    for name in shipped_fixators():
        assert shipped_fixator(name).id == name


def test_the_scale_offset_may_be_left_out(a_document) -> None:
    del a_document["strut"]["scale_offset_mm"]
    assert fixator_from_document(a_document).strut.scale_offset_mm == 0.0
    a_document["strut"]["scale_offset_mm"] = -31.5
    assert fixator_from_document(a_document).strut.scale_offset_mm == -31.5


def test_all_faults_are_named_at_once(a_document) -> None:
    a_document["schema_version"] = 2
    a_document["colour"] = "red"
    a_document["proximal"]["joints_mm"][3] = [1.0, float("nan"), 2.0]
    a_document["distal"]["thickness_mm"] = -8.0
    del a_document["strut"]["max_mm"]
    assert faults_of(a_document) == {
        "fixator.schema_version": "schema-version",
        "fixator.colour": "unknown-key",
        "fixator.proximal.joints_mm[3]": "wrong-shape",
        "fixator.distal.thickness_mm": "out-of-range",
        "fixator.strut.max_mm": "missing-key",
    }


@pytest.mark.parametrize(
    ("path", "value", "where", "code"),
    [
        (("schema_version",), True, "fixator.schema_version", "schema-version"),
        (("schema_version",), 1.0, "fixator.schema_version", "schema-version"),
        (("schema_version",), "1", "fixator.schema_version", "schema-version"),
        (("name",), " ", "fixator.name", "wrong-type"),
        (("source",), 3, "fixator.source", "wrong-type"),
        (("proximal",), [], "fixator.proximal", "wrong-type"),
        (("proximal", "joints_mm"), [[0, 0, 0]] * 5, "fixator.proximal.joints_mm", "wrong-shape"),
        (("distal", "joints_mm"), [[0, 0, 0]] * 6, "fixator.distal.joints_mm", "joints-coincide"),
        (("distal", "joints_mm", 0), [1, 2], "fixator.distal.joints_mm[0]", "wrong-shape"),
        (("distal", "joints_mm", 0), [1, 2, "3"], "fixator.distal.joints_mm[0]", "wrong-shape"),
        (("distal", "outer_radius_mm"), 0, "fixator.distal.outer_radius_mm", "out-of-range"),
        (("distal", "thickness_mm"), True, "fixator.distal.thickness_mm", "not-a-number"),
        (("distal", "thickness_mm"), 10**400, "fixator.distal.thickness_mm", "not-a-number"),
        (("strut", "min_mm"), 240.0, "fixator.strut.min_mm", "out-of-range"),
        (("strut", "scale_offset_mm"), None, "fixator.strut.scale_offset_mm", "not-a-number"),
        (
            ("strut", "scale_offset_mm"),
            float("inf"),
            "fixator.strut.scale_offset_mm",
            "not-a-number",
        ),
        (("strut", "turns"), 2, "fixator.strut.turns", "unknown-key"),
    ],
)
def test_one_wrong_entry_is_refused_by_name(a_document, path, value, where, code) -> None:
    document = copy.deepcopy(a_document)
    entry = document
    for key in path[:-1]:
        entry = entry[key]
    entry[path[-1]] = value
    assert faults_of(document) == {where: code}


@pytest.mark.parametrize("document", [None, [], "generic-6sps-160", 3])
def test_what_is_no_object_is_refused(document) -> None:
    assert faults_of(document)["fixator"] == "wrong-type"


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("{", "not valid JSON"),
        ('{"strut": NaN}', "NaN is not a number"),
        ('{"id": "a", "id": "b"}', "key given twice: id"),
    ],
)
def test_a_file_of_loose_json_is_refused(tmp_path, text: str, word: str) -> None:
    path = tmp_path / "frame.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(HardwareDefinitionError, match=word):
        read_fixator(path)


def test_a_file_that_is_not_there_is_refused(tmp_path) -> None:
    with pytest.raises(HardwareDefinitionError, match="cannot be read"):
        read_fixator(tmp_path / "none.json")


def test_an_unknown_id_names_the_known_ones() -> None:
    with pytest.raises(HardwareDefinitionError, match="generic-6sps-160"):
        shipped_fixator("taylor-155")


def test_bytes_that_are_no_text_are_refused(tmp_path) -> None:
    path = tmp_path / "frame.json"
    path.write_bytes(b"\xff\xfe\x00\x01")
    with pytest.raises(HardwareDefinitionError, match="not valid JSON"):
        read_fixator(path)


def test_nesting_without_end_is_refused(tmp_path) -> None:
    path = tmp_path / "frame.json"
    path.write_text("[" * 100_000, encoding="utf-8")
    with pytest.raises(HardwareDefinitionError, match="not valid JSON"):
        read_fixator(path)
