"""Every gate is asked in the chain, and a red one stops it."""

from dataclasses import replace

import pytest
from hexafix import gates
from hexafix.errors import Refused

PLAIN = [
    "angles_rebuild",
    "ball_diameters",
    "forward_basin",
    "layout_rule",
    "limbs_agree",
    "moving_ring_above",
    "numbering_unique",
    "realised_rate",
    "ring_rms",
    "rings_face_each_other",
    "sides_agree",
    "struts_agree",
    "towards_the_head",
    "well_conditioned",
]
IN_PAIRS = ["recognition_error", "recomputed"]


def red(gate):
    return replace(gate, passed=False)


def test_these_are_all_gates_that_refuse():
    found = set(gates.__all__) - {name for name in gates.__all__ if name[0].isupper()}
    # this one tells and never refuses (H34)
    told = {"subtraction_near_composition"}
    assert found - {"decide", "red"} - told == {*PLAIN, *IN_PAIRS}


@pytest.mark.parametrize("name", PLAIN)
def test_a_red_gate_stops_the_plan(measured, monkeypatch, name):
    right, codes = getattr(gates, name), []

    def asked(*values, **options):
        gate = red(right(*values, **options))
        codes.append(gate.code)
        return gate

    monkeypatch.setattr(gates, name, asked)
    found = measured.verdict(measured.PLAIN.document(), measured.PLAIN.balls_mm())
    assert codes
    assert {code for _, code in found} == set(codes)


@pytest.mark.parametrize("ring", ["proximal", "distal"])
@pytest.mark.parametrize("name", ["ring_rms", "ball_diameters", "layout_rule"])
def test_a_gate_of_one_ring_is_asked_for_both(measured, monkeypatch, name, ring):
    right = getattr(gates, name)

    def asked(side, *values, **options):
        gate = right(side, *values, **options)
        return red(gate) if side == ring else gate

    monkeypatch.setattr(gates, name, asked)
    found = measured.verdict(measured.PLAIN.document(), measured.PLAIN.balls_mm())
    assert len(found) == 1


@pytest.mark.parametrize("which", [0, 1])
def test_a_red_recognition_error_stops_the_plan(measured, monkeypatch, which):
    right = gates.recognition_error

    def asked(*values):
        pair = list(right(*values))
        pair[which] = red(pair[which])
        return tuple(pair)

    monkeypatch.setattr(gates, "recognition_error", asked)
    found = measured.verdict(measured.PLAIN.document(), measured.PLAIN.balls_mm())
    assert found == [("H33", "recognition-error")]


def test_a_red_recomputation_stops_the_export(a_phantom, a_phantom_case, tmp_path, monkeypatch):
    from hexafix.pipeline import plan_and_export

    right = gates.recomputed
    monkeypatch.setattr(gates, "recomputed", lambda *values: tuple(map(red, right(*values))))
    with pytest.raises(Refused) as error:
        plan_and_export(a_phantom_case(), tmp_path / "out", volume=a_phantom.volume)
    assert {fault.code for fault in error.value.faults} == {"recomputation"}
    assert not (tmp_path / "out").exists()
