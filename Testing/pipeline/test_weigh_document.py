"""The readings beside the CT: the same differences and gates as the plan's, without a plan."""

import numpy as np
import pytest
from hexafix.errors import HexaFixError, InputError
from hexafix.pipeline import plan_recognised, weigh_document


def codes(document):
    return {fault["code"] for fault in document["faults"]}


def test_the_differences_and_gates_are_the_plans(a_plan):
    document = weigh_document(a_plan.case, a_plan.recognised)
    differences = [row["difference_mm"] for row in document["struts"]]
    np.testing.assert_allclose(differences, a_plan.struts.witness.differences_mm, atol=1e-9)
    assert document["gates"] == [gate.as_json() for gate in a_plan.struts.gates]
    assert document["agree"]
    assert document["faults"] == []
    assert document["better_order"] is None
    for row, reading in zip(document["struts"], a_plan.case.strut_readings_mm, strict=True):
        assert row["reading_mm"] == reading
        assert row["ct_length_mm"] - row["length_mm"] == pytest.approx(row["difference_mm"])
        assert row["verdict"] == "agrees"
    assert document["from_struts"]["position_mm"] == pytest.approx(
        a_plan.struts.forward.pose.position_mm.tolist(), abs=1e-8
    )


def test_neither_correction_nor_schedule_is_needed(a_draft_case, a_recognised, a_plan):
    case = a_draft_case("correction", "schedule")
    assert weigh_document(case, a_recognised) == weigh_document(a_plan.case, a_recognised)


@pytest.mark.parametrize(
    ("change_mm", "verdict"), [(1.5, "read-again"), (-1.5, "read-again"), (10.0, "disagrees")]
)
def test_a_reading_that_is_off_is_named(a_draft_case, a_recognised, a_phantom, change_mm, verdict):
    readings = list(a_phantom.case["strut_readings_mm"])
    readings[3] += change_mm
    document = weigh_document(a_draft_case(strut_readings_mm=readings), a_recognised)
    verdicts = [row["verdict"] for row in document["struts"]]
    assert verdicts == ["agrees"] * 3 + [verdict] + ["agrees"] * 2


def test_what_a_plan_refuses_is_told_first_and_more(a_draft_case, a_recognised, a_phantom):
    readings = list(a_phantom.case["strut_readings_mm"])
    readings[3] += 10.0
    case = a_draft_case(strut_readings_mm=readings)
    document = weigh_document(case, a_recognised)
    with pytest.raises(HexaFixError) as error:
        plan_recognised(case, a_recognised)
    assert {fault.code for fault in error.value.faults} <= codes(document)
    assert not document["agree"]
    assert "recognition-error" in codes(document)


def test_exchanged_readings_are_told_with_the_right_order(a_draft_case, a_recognised, a_phantom):
    given = a_phantom.case["strut_readings_mm"]
    readings = [given[k] for k in (0, 4, 2, 3, 1, 5)]
    document = weigh_document(a_draft_case(strut_readings_mm=readings), a_recognised)
    assert "strut-order" in codes(document)
    assert "1, 5, 3, 4, 2, 6" in document["better_order"]


def test_readings_that_no_mechanism_has_are_a_fault_and_no_exception(a_draft_case, a_recognised):
    case = a_draft_case(strut_readings_mm=[120.0, 240.0, 120.0, 240.0, 120.0, 240.0])
    document = weigh_document(case, a_recognised)
    assert not document["agree"]
    assert "strut-reading" in codes(document)


def test_a_case_without_readings_says_what_is_missing(a_draft_case, a_recognised):
    with pytest.raises(InputError) as error:
        weigh_document(a_draft_case("strut_readings_mm"), a_recognised)
    assert error.value.faults[0].where == "strut_readings_mm"
