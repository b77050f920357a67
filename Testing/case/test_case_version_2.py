"""What version 2 of the case file knows: the user's ball edits and the rings' front."""

import json

import numpy as np
import pytest
from hexafix.case import case_from_document
from hexafix.errors import InputError

EDITS = {
    "added_lps_mm": [[1.5, -2.25, 800.0]],
    "removed_lps_mm": [[1.0, -2.0, 801.0], [40, 5, 6]],
}


def read(document, folder):
    return case_from_document(json.dumps(document).encode(), folder=folder)


def faults(document, folder):
    with pytest.raises(InputError) as error:
        read(document, folder)
    return {fault.where: fault for fault in error.value.faults}


@pytest.mark.parametrize(
    ("key", "value"),
    [("marker_edits", EDITS), ("ring_front_confirmed", True), ("readings_to_repeat", False)],
)
def test_version_1_refuses_each_new_key_by_name(a_case_document, a_case_folder, key, value):
    found = faults({**a_case_document, key: value}, a_case_folder)
    assert set(found) == {key}
    assert found[key].code == "unknown-key"
    assert read({**a_case_document, key: value, "schema_version": 2}, a_case_folder).case_id


def test_a_case_of_version_1_is_read_as_before(a_case_document, a_case_folder):
    case = read(a_case_document, a_case_folder)
    assert not case.marker_edits
    assert case.ring_front_confirmed is None
    assert set(case.document) == set(a_case_document)
    assert case.document["schema_version"] == 1


def test_version_2_without_its_keys_differs_from_version_1_in_the_number_alone(
    a_case_document, a_case_folder
):
    old = dict(read(a_case_document, a_case_folder).document)
    new = dict(read({**a_case_document, "schema_version": 2}, a_case_folder).document)
    assert new.pop("schema_version") == 2
    assert old.pop("schema_version") == 1
    assert new == old


def test_version_2_holds_the_users_edits_and_the_confirmation(a_case_document, a_case_folder):
    new = {"schema_version": 2, "marker_edits": EDITS, "ring_front_confirmed": False}
    case = read({**a_case_document, **new}, a_case_folder)
    assert case.marker_edits
    np.testing.assert_array_equal(case.marker_edits.added_lps_mm, EDITS["added_lps_mm"])
    np.testing.assert_array_equal(case.marker_edits.removed_lps_mm, EDITS["removed_lps_mm"])
    assert case.ring_front_confirmed is False
    assert case.document["marker_edits"] == EDITS
    assert case.document["ring_front_confirmed"] is False
    with pytest.raises(ValueError, match="read-only"):
        case.marker_edits.added_lps_mm[0, 0] = 0.0


@pytest.mark.parametrize(
    ("value", "where"),
    [
        ({"added_lps_mm": [[1, 2]]}, "marker_edits.added_lps_mm[0]"),
        ({"added_lps_mm": [[1, 2, "3"]]}, "marker_edits.added_lps_mm[0][2]"),
        ({"removed_lps_mm": [[1, 2, 9e9]]}, "marker_edits.removed_lps_mm[0][2]"),
        ({"moved_lps_mm": []}, "marker_edits.moved_lps_mm"),
        ({"added_lps_mm": [[0, 0, 0]] * 201}, "marker_edits.added_lps_mm"),
    ],
)
def test_a_wrong_edit_is_refused_at_its_path(a_case_document, a_case_folder, value, where):
    document = {**a_case_document, "schema_version": 2, "marker_edits": value}
    assert set(faults(document, a_case_folder)) == {where}


@pytest.mark.parametrize("version", [0, 3, True, 1.0, 2.0, "2", 2.5, None])
def test_any_other_version_is_refused(a_case_document, a_case_folder, version):
    found = faults({**a_case_document, "schema_version": version}, a_case_folder)
    assert "schema_version" in found
