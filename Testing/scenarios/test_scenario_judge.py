"""The judging cannot pass vacuously: a truth or a plan that is wrong by little fails by name."""

import copy
import json
from dataclasses import replace

import numpy as np
import pytest
from hexafix.errors import Fault
from hexafix.geometry import Pose
from hexafix.phantom import PhantomSpec
from hexafix.scenarios import limits
from hexafix.scenarios.judge import Finding, judge_plan, judge_refusal
from hexafix.scenarios.scenario import Refusal

DUE = Refusal({"missing-slice": "H03", "gantry-tilt": "H02"})


@pytest.fixture(scope="module")
def a_judged_plan(a_phantom, an_export):
    """Plan, truth and spec that agree."""
    document = json.loads((an_export / "plan.json").read_text())
    truth = json.loads(json.dumps(a_phantom.truth))
    return document, truth, a_phantom.spec


def failed(document, truth, spec, **options):
    findings = list(judge_plan(document, truth, spec, **options))
    return {f"{f.name} {f.unit}".strip() for f in findings if not f.passed}


def moved(matrix, *, mm=(0.0, 0.0, 0.0), deg=(0.0, 0.0, 0.0)):
    pose = Pose.from_matrix(matrix) @ Pose.exp([*mm, *np.radians(deg)])
    return pose.matrix.tolist()


def test_a_good_plan_passes_every_comparison(a_judged_plan):
    findings = list(judge_plan(*a_judged_plan))
    assert all(finding.passed for finding in findings)
    assert len(findings) >= 17
    # the limits are limits: nothing stands at a thousandth of them
    shares = [f.value / f.limit for f in findings if f.limit > 1e-3 and f.value > 0.0]
    assert max(shares) > 0.2


def ball_off(truth):
    truth["balls"][2]["center_mm"][1] += 0.12


def balls_exchanged(truth):
    one, other = truth["balls"][0], truth["balls"][1]
    one["center_mm"], other["center_mm"] = other["center_mm"], one["center_mm"]


def ball_missing(truth):
    del truth["balls"][3]


def ring_off(truth):
    ring = truth["rings"]["distal"]
    ring["matrix_lps"] = moved(ring["matrix_lps"], mm=(0.0, 0.45, 0.0))


def ring_turned(truth):
    ring = truth["rings"]["proximal"]
    ring["matrix_lps"] = moved(ring["matrix_lps"], deg=(0.0, 0.0, 0.4))


def mechanism_off(truth):
    truth["mechanism"]["matrix"] = moved(truth["mechanism"]["matrix"], mm=(1.2, 0.0, 0.0))


def target_off(truth):
    target = truth["target"]["mechanism"]
    target["matrix"] = moved(target["matrix"], mm=(1.0, 0.0, 0.9))


def target_turned(truth):
    target = truth["target"]["mechanism"]
    target["matrix"] = moved(target["matrix"], deg=(1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("corrupt", "told"),
    [
        (ball_off, "ball centre mm"),
        (balls_exchanged, "ball centre mm"),
        (ball_missing, "every ball under its number"),
        (ring_off, "distal ring mm"),
        (ring_turned, "proximal ring deg"),
        (mechanism_off, "mechanism mm"),
        (target_off, "fracture at the end mm"),
        (target_off, "end mm"),
        (target_turned, "end deg"),
    ],
)
def test_a_corrupted_truth_fails_by_name(a_judged_plan, corrupt, told):
    document, truth, spec = a_judged_plan
    truth = copy.deepcopy(truth)
    corrupt(truth)
    assert told in failed(document, truth, spec)


def last_row_wrong(document):
    for row in document["schedule"]["rows"][-1:]:
        row["strut_mm"] = [value + 1.0 for value in row["strut_mm"]]


def too_fast(document):
    rows = document["schedule"]["rows"]
    document["schedule"]["rows"] = [rows[0], *rows[1::3]]


def off_the_scale(document):
    document["schedule"]["rows"][5]["strut_mm"][2] += 0.1


def beyond_the_stroke(document):
    document["schedule"]["rows"][7]["strut_mm"][4] = 241.0


def a_day_twice(document):
    rows = document["schedule"]["rows"]
    for row, before in zip(rows[9:13], rows[5:9], strict=True):
        row["date"] = before["date"]


def struts_wrong(document):
    pose = document["mechanism"]["from_struts"]
    pose["matrix"] = moved(pose["matrix"], mm=(0.0, 1.6, 0.0))


def not_a_number(document):
    document["balls"][0]["center_mm"][0] = float("nan")


@pytest.mark.parametrize(
    ("corrupt", "told"),
    [
        (last_row_wrong, "fracture at the end mm"),
        (too_fast, "way within a day mm"),
        (off_the_scale, "rows off the strut's scale mm"),
        (beyond_the_stroke, "struts beyond their stroke mm"),
        (a_day_twice, "calendar"),
        (struts_wrong, "mechanism by struts mm"),
        (not_a_number, "ball centre mm"),
    ],
)
def test_a_corrupted_plan_fails_by_name(a_judged_plan, corrupt, told):
    document, truth, spec = a_judged_plan
    document = copy.deepcopy(document)
    corrupt(document)
    assert told in failed(document, truth, spec)


def test_a_date_that_is_not_there_fails(a_judged_plan):
    assert failed(*a_judged_plan, dates=["2026-12-02"]) == set()
    assert failed(*a_judged_plan, dates=["2028-02-29"]) == {"2028-02-29 is in the calendar"}


def faults(*pairs, next_step="do it again"):
    return [Fault(code, "wrong", hazard=hazard, next_step=next_step) for code, hazard in pairs]


@pytest.mark.parametrize(
    ("told", "exit_code", "left", "wrong"),
    [
        (faults(("missing-slice", "H03")), 3, [], "every fault that was due is told"),
        (faults(*DUE.faults.items(), ("ring-rms", "H01")), 3, [], "no other fault is told"),
        (faults(("missing-slice", "H99"), ("gantry-tilt", "H02")), 3, [], "no other fault is told"),
        (faults(*DUE.faults.items()), 2, [], "the exit code"),
        (faults(*DUE.faults.items()), 3, [".prescription.staging-7"], "nothing was written"),
        (faults(*DUE.faults.items(), next_step=None), 3, [], "every fault tells the next step"),
    ],
)
def test_a_refusal_that_differs_in_anything_fails(told, exit_code, left, wrong):
    good = judge_refusal(DUE, faults(*DUE.faults.items()), 3, left_behind=[])
    assert all(finding.passed for finding in good)
    findings = list(judge_refusal(DUE, told, exit_code, left_behind=left))
    assert wrong in {finding.name for finding in findings if not finding.passed}


def test_a_finding_that_is_no_number_fails():
    assert not Finding("ball centre", float("nan"), 1.0).passed
    assert not Finding("ball centre", float("inf"), float("inf")).passed


def test_ball_limits_follow_the_scan_and_not_the_results():
    fine = PhantomSpec(spacing_mm=(0.5, 0.5, 0.8), noise_hu=30.0)
    assert limits.ball_mm(fine) == 0.06
    assert limits.ball_mm(replace(fine, spacing_mm=(0.5, 0.5, 2.0))) == 0.12
    assert limits.ball_mm(replace(fine, slice_thickness_mm=2.0)) == 0.12
    assert limits.ball_mm(replace(fine, noise_hu=100.0)) == 0.12
    assert limits.ball_mm(replace(fine, gantry_tilt_rad=0.2)) == pytest.approx(0.09)
    assert limits.ball_mm(replace(fine, ball_hu=8000.0)) == pytest.approx(0.09)
    assert limits.ball_mm(replace(fine, streak_hu=200.0)) == pytest.approx(0.10)


def test_pose_limits_are_what_simulated_balls_scatter_by():
    """Against a Monte Carlo of Kabsch fits, which shares no formula with the limits."""
    spec, sigma = PhantomSpec(), 0.08
    rng = np.random.default_rng(5)
    points = spec.proximal.points_mm
    middle = points.mean(axis=0)
    errors = []
    for _ in range(4000):
        seen = points + sigma * rng.normal(size=points.shape)
        u, _, vt = np.linalg.svd((seen - seen.mean(axis=0)).T @ (points - middle))
        turn = u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt
        errors.append(Pose(turn, seen.mean(axis=0) - turn @ middle).log())
    sampled = np.cov(np.array(errors).T)
    predicted = limits.ring_covariance(spec.proximal, sigma)
    np.testing.assert_allclose(np.diag(predicted), np.diag(sampled), rtol=0.12)
    far = np.array([10.0, -20.0, 150.0])
    spread = np.std([Pose.exp(e).apply(far) for e in errors], axis=0)
    limit = limits.at_point_mm(predicted, far)
    assert limit == pytest.approx(limits.SIGMAS * np.linalg.norm(spread), rel=0.06)


def test_reading_limits_are_what_rounded_struts_scatter_by():
    from hexafix.kinematics import forward_kinematics, strut_lengths

    spec, step = PhantomSpec(), 0.5
    rng = np.random.default_rng(6)
    true = spec.mechanism_pose
    lengths = strut_lengths(true, spec.fixator)
    errors = []
    for _ in range(400):
        off = lengths + rng.uniform(-step / 2.0, step / 2.0, 6)
        pose = forward_kinematics(off, spec.fixator, start=true).pose
        errors.append((true.inverse() @ pose).log())
    predicted = limits.rounding_covariance(true, spec.fixator, step)
    ratio = np.sqrt(np.trace(np.cov(np.array(errors).T)) / np.trace(predicted))
    assert ratio == pytest.approx(1.0, abs=0.1)
