import json

import numpy as np
import pytest
from hexafix.accuracy import angle_rule, check_layout, check_layouts, layout_faults
from hexafix.accuracy.advice import UNIQUENESS_TARGET_MM, better_layout
from hexafix.accuracy.layout_check import exchange_rms_mm
from hexafix.accuracy.uniqueness import best_relabelling
from hexafix.errors import LayoutRejected


@pytest.mark.parametrize(
    ("sweeps", "rule"),
    [
        ((0, 120, 240), "preferred"),
        ((0, 45, 90), "preferred"),
        ((0, 44, 150), "relaxed"),
        ((0, 44, 90), "violated"),
        ((200, 10, 95), "preferred"),
        ((0, 15, 120), "relaxed"),
        ((0, 14, 120), "violated"),
        ((0, 15, 110), "violated"),
        ((0, 15, 100), "violated"),
        ((-30, 90, 570), "preferred"),
    ],
)
def test_the_two_rules_of_section_4_3_2(layout_at, sweeps, rule):
    assert angle_rule(layout_at(sweeps)) == rule


def test_more_markers_meet_the_rule_when_three_of_them_do(layout_at):
    assert angle_rule(layout_at(np.arange(10) * 36)) == "preferred"
    assert angle_rule(layout_at([0, 10, 20, 30])) == "violated"
    assert angle_rule(layout_at([0, 120, 240, 245])) == "preferred"


def test_the_verdict_of_the_paper_layout(layout_at):
    verdict = check_layout(layout_at([0, 120, 240]))
    assert verdict.group_error_mm == pytest.approx(0.269, rel=0.03)
    assert np.degrees(verdict.group_error_rad) == pytest.approx(0.179, rel=0.03)
    assert verdict.predicted_error_mm == pytest.approx(0.251, rel=0.01)
    assert np.degrees(verdict.predicted_error_rad) == pytest.approx(0.182, rel=0.01)
    assert verdict.uniqueness_mm < 1e-9
    assert verdict.mirror_mm < 1e-9
    assert verdict.out_of_plane_mm < 1e-9
    assert verdict.triangle_height_mm == pytest.approx(150.0)
    assert verdict.second_singular_mm == pytest.approx(100 / np.sqrt(2))


def test_the_predicted_error_follows_the_stated_ball_errors(layout_at):
    layout = layout_at([0, 105, 225])
    coarse = check_layout(layout, sigma_image_mm=0.3, sigma_installation_mm=0.0)
    fine = check_layout(layout, sigma_image_mm=0.03, sigma_installation_mm=0.0)
    same = check_layout(
        layout, covariances_mm2=np.tile(np.eye(3) * 9e-4, (3, 1, 1)), sigma_installation_mm=0.0
    )
    assert coarse.predicted_error_mm == pytest.approx(10 * fine.predicted_error_mm)
    assert same.predicted_error_mm == pytest.approx(fine.predicted_error_mm)
    assert same.group_error_rad == pytest.approx(fine.group_error_rad)


def test_the_document_holds_the_contract_keys_and_finite_numbers(layout_at):
    check = check_layouts(
        layout_at([0, 120, 240]), layout_at([0, 10, 180], 4, radius_mm=[100, 20, 100])
    )
    document = json.loads(json.dumps(check.as_json(), allow_nan=False))
    for side in ("proximal", "distal"):
        keys = {"included_angles_deg", "rule", "uniqueness_mm"}
        assert keys | {"predicted_error_mm", "predicted_error_deg"} <= document[side].keys()
        assert sum(document[side]["included_angles_deg"]) == pytest.approx(360.0)
    assert document["proximal"]["predicted_error_deg"] == pytest.approx(0.182, rel=0.01)
    assert isinstance(document["advice"], list)


def test_markers_exactly_on_one_line_have_no_predicted_error_and_are_refused(layout_at):
    line = layout_at([0, 0, 180], radius_mm=[100, 40, 100])
    check = check_layouts(line, layout_at([0, 105, 225], 4))
    assert check.proximal.predicted_error_mm is None
    assert check.proximal.group_error_mm is None
    assert "H16" in {fault.hazard for fault in layout_faults(check, numbering_settled=True)}
    json.dumps(check.as_json(), allow_nan=False)


def test_two_markers_are_refused(layout_at):
    with pytest.raises(LayoutRejected) as caught:
        check_layout(layout_at([0, 120]))
    assert caught.value.faults[0].hazard == "H13"


def test_a_good_pair_of_rings_has_no_fault(layout_at):
    check = check_layouts(layout_at([0, 105, 225]), layout_at([15, 105, 230], 4))
    assert layout_faults(check) == ()
    assert check.exchange_mm > 5.0
    assert all("mirrored" in sentence for sentence in check.advice)


def test_ambiguous_and_alike_rings_are_faults_unless_settled(layout_at):
    check = check_layouts(layout_at([0, 120, 240]), layout_at([0, 120, 240], 4))
    hazards = [fault.hazard for fault in layout_faults(check)]
    assert hazards == ["H18", "H18", "H20"]
    assert {f.where for f in layout_faults(check)} == {
        "markers.proximal",
        "markers.distal",
        "markers",
    }
    assert layout_faults(check, numbering_settled=True) == ()


def test_the_relaxed_rule_passes_only_when_accepted(layout_at):
    check = check_layouts(layout_at([0, 15, 120]), layout_at([15, 105, 230], 4))
    assert [f.hazard for f in layout_faults(check)] == ["H17"]
    assert layout_faults(check, accept_relaxed=True) == ()
    worse = check_layouts(layout_at([0, 14, 120]), layout_at([15, 105, 230], 4))
    assert [f.code for f in layout_faults(worse, accept_relaxed=True)] == ["angle-rule-violated"]


def test_rings_with_different_counts_cannot_be_exchanged(layout_at):
    four = layout_at([0, 80, 170, 260], 4)
    assert exchange_rms_mm(layout_at([0, 105, 225]), four) is None


@pytest.mark.parametrize("sweeps", [(0, 120, 240), (0, 45, 90), (0, 40, 80), (0, 90, 180, 270)])
def test_the_advised_layout_is_unique_and_as_good(layout_at, sweeps):
    layout = layout_at(sweeps)
    better = better_layout(layout, sigma_mm=0.3)
    assert better is not None
    assert best_relabelling(better.layout)[0] >= UNIQUENESS_TARGET_MM
    assert angle_rule(better.layout) == "preferred"
    now = check_layout(layout, sigma_installation_mm=0.0)
    then = check_layout(better.layout, sigma_installation_mm=0.0)
    assert then.predicted_error_mm == pytest.approx(better.error_mm)
    assert then.predicted_error_mm <= now.predicted_error_mm + 0.02
    kept = sum(a == b for a, b in zip(layout.sites, better.layout.sites, strict=True))
    assert kept >= len(layout) - 2
    assert better.layout.numbers == layout.numbers


def test_the_advice_is_a_sentence_with_figures(layout_at):
    check = check_layouts(layout_at([0, 120, 240]), layout_at([15, 105, 230], 4))
    sentence = check.advice[0]
    assert sentence.startswith("proximal ring: not unique: numbers 1,2,3 turned")
    assert "move marker 3 from 240 to 225 degrees: unique by 8.0 mm" in sentence
    assert "predicted error 0.25 mm, 0.18 degrees" in sentence


def test_advice_for_alike_rings_makes_them_differ(layout_at):
    proximal, distal = layout_at([0, 105, 225]), layout_at([15, 120, 240], 4)
    check = check_layouts(proximal, distal)
    assert check.exchange_mm < 1e-9
    assert check.advice[0].startswith("distal ring: it can be taken for the proximal ring")
    better = better_layout(distal, other=proximal, sigma_mm=0.3)
    assert exchange_rms_mm(proximal, better.layout) >= UNIQUENESS_TARGET_MM
