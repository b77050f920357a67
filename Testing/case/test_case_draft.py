"""A case may be unfinished: its right parts can be used, and all that is wrong is told."""

import copy
import hashlib
import json

import numpy as np
import pytest
from hexafix.case import (
    case_from_document,
    draft_faults,
    load_raw_case,
    partial_case,
    parts_of,
)
from hexafix.errors import InputError
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

PARTS_OF_KEY = {
    "case_id": ["case_id"],
    "limb": ["limb"],
    "image": ["image_path"],
    "fixator": ["fixator"],
    "markers": ["ball_diameter_mm", "proximal", "distal"],
    "strut_readings_mm": ["strut_readings_mm"],
    "correction": ["correction"],
    "schedule": ["schedule"],
}
BROKEN = {
    "case_id": "a/b",
    "limb": {"side": "middle"},
    "image": {},
    "fixator": "none-such",
    "markers": {"ball_diameter_mm": "ten"},
    "strut_readings_mm": [190.2, None, 190.2, 190.2, 190.2, 190.2],
    "correction": {"kind": "target-pose"},
    "schedule": {"start_date": "soon"},
}


def raw_of(document):
    return json.dumps(document).encode()


def test_a_finished_case_has_no_faults_and_all_its_parts(a_case_document, a_case_folder):
    raw = raw_of(a_case_document)
    assert draft_faults(raw, folder=a_case_folder) == ()
    parts, case = (
        parts_of(raw, folder=a_case_folder),
        case_from_document(raw, folder=a_case_folder),
    )
    assert parts.image_path == case.image_path
    assert (parts.case_id, parts.limb) == (case.case_id, case.limb)
    assert (parts.proximal, parts.distal) == (case.proximal, case.distal)
    assert parts.ball_diameter_mm == case.ball_diameter_mm
    assert parts.fixator.id == case.fixator.id
    assert parts.schedule.start_date == case.schedule.start_date
    np.testing.assert_array_equal(parts.strut_readings_mm, case.strut_readings_mm)
    np.testing.assert_array_equal(parts.correction.pose.matrix, case.correction.pose.matrix)


@pytest.mark.parametrize("given_faults", ["{}", "[]", "not json", '{"a": 1, "a": 2}', "\xff"])
def test_no_bytes_make_a_draft_raise(given_faults, a_case_folder):
    raw = given_faults.encode("latin-1")
    assert draft_faults(raw, folder=a_case_folder)
    assert parts_of(raw, folder=a_case_folder).proximal is None


def test_the_faults_of_a_draft_are_those_of_reading_it(a_case_document, a_case_folder):
    document = {**a_case_document, "limb": {"side": "middle", "bone": "tibia"}, "correction": None}
    document["image"] = {"path": "nowhere"}
    with pytest.raises(InputError) as error:
        case_from_document(raw_of(document), folder=a_case_folder)
    faults = draft_faults(raw_of(document), folder=a_case_folder)
    assert faults == error.value.faults
    assert {fault.where for fault in faults} == {"limb.side", "correction", "image.path"}


@settings(
    deadline=None,
    max_examples=40,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(
    missing=st.sets(st.sampled_from(sorted(PARTS_OF_KEY))),
    broken=st.sets(st.sampled_from(sorted(BROKEN))),
)
def test_what_is_missing_or_wrong_takes_no_other_part_with_it(
    a_case_document, a_case_folder, missing, broken
):
    document = {key: value for key, value in a_case_document.items() if key not in missing}
    broken -= missing
    document.update({key: BROKEN[key] for key in broken})
    raw = raw_of(document)
    parts = parts_of(raw, folder=a_case_folder)
    for key, names in PARTS_OF_KEY.items():
        for name in names:
            assert (getattr(parts, name) is None) == (key in missing | broken), name
    told = {
        fault.where.split(".")[0].split("[")[0] for fault in draft_faults(raw, folder=a_case_folder)
    }
    assert missing | broken <= told


def test_one_ring_can_be_used_while_the_other_is_missing(a_case_document, a_case_folder):
    document = copy.deepcopy(a_case_document)
    del document["markers"]["distal"]
    parts = parts_of(raw_of(document), folder=a_case_folder)
    assert parts.proximal.numbers == (1, 2, 3)
    assert parts.distal is None
    assert parts.ball_diameter_mm == 10.0


def test_layouts_that_share_a_number_are_not_used(a_case_document, a_case_folder):
    document = copy.deepcopy(a_case_document)
    document["markers"]["distal"][0]["number"] = 1
    parts = parts_of(raw_of(document), folder=a_case_folder)
    assert (parts.proximal, parts.distal) == (None, None)


def test_a_numbering_that_is_being_made_is_read(a_case_document, a_case_folder):
    document = {**a_case_document, "numbering": {"2": [1, 2, 3]}}
    parts = parts_of(raw_of(document), folder=a_case_folder)
    assert list(parts.numbering) == [2]
    assert parts.numbering[2].tolist() == [1, 2, 3]


def test_readings_off_the_struts_scale_are_not_used(a_case_document, a_case_folder):
    document = {**a_case_document, "strut_readings_mm": [190.2] * 5 + [19.02]}
    assert parts_of(raw_of(document), folder=a_case_folder).strut_readings_mm is None


def test_wrong_edits_are_told_apart_from_none(a_case_document, a_case_folder):
    document = {**a_case_document, "schema_version": 2}
    assert not parts_of(raw_of(document), folder=a_case_folder).marker_edits
    document["marker_edits"] = {"added_lps_mm": [[1, 2, 3]]}
    assert parts_of(raw_of(document), folder=a_case_folder).marker_edits
    document["marker_edits"] = {"added_lps_mm": [[1, 2]]}
    assert parts_of(raw_of(document), folder=a_case_folder).marker_edits is None


def test_a_step_reads_the_case_without_the_parts_it_does_not_need(a_case_document, a_case_folder):
    document = {**a_case_document, "correction": {"kind": "wish"}, "schedule": None}
    raw = raw_of(document)
    with pytest.raises(InputError):
        case_from_document(raw, folder=a_case_folder, plannable=False)
    case = partial_case(raw, folder=a_case_folder, keep=("strut_readings_mm",))
    assert case.correction is None
    assert case.strut_readings_mm.tolist() == [190.2] * 6
    assert case.case_sha256 == hashlib.sha256(raw).hexdigest()
    assert partial_case(raw, folder=a_case_folder).strut_readings_mm is None


def test_a_step_is_refused_a_part_that_it_needs_and_that_is_wrong(a_case_document, a_case_folder):
    document = {**a_case_document, "strut_readings_mm": [190.2] * 5 + [19.02]}
    raw = raw_of(document)
    assert partial_case(raw, folder=a_case_folder)
    with pytest.raises(InputError) as error:
        partial_case(raw, folder=a_case_folder, keep=("strut_readings_mm",))
    assert [fault.where for fault in error.value.faults] == ["strut_readings_mm[5]"]


def test_the_bytes_of_a_draft_are_read_as_they_are(tmp_path):
    (tmp_path / "case.json").write_bytes(b'{"case_id":\n "x"}')
    raw, folder = load_raw_case(tmp_path)
    assert raw == b'{"case_id":\n "x"}'
    assert folder == tmp_path.resolve()
