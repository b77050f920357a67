"""The live verdict on a numbering against the chain's own, and against brute force."""

from itertools import permutations

import numpy as np
import pytest
from hexafix.case import parts_of
from hexafix.errors import HexaFixError
from hexafix.markers import Ball, BallSet
from hexafix.pipeline import judge_by_struts, judge_case_numbering, judge_numbering
from hexafix.recognition import check_user_numbering, number_balls
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation


@pytest.fixture(scope="module")
def scene(a_recognised, a_read_case):
    """Balls, layouts and the right ball of each number."""
    layouts = {"proximal": a_read_case.proximal, "distal": a_read_case.distal}
    return a_recognised.balls, layouts, a_recognised.numbering.ball_of_number


def codes(document):
    return [fault["code"] for fault in document["faults"]]


def residuals(points, layout_points):
    """Distances after the best rotation by another library."""
    a, b = points - points.mean(axis=0), layout_points - layout_points.mean(axis=0)
    rotation, _ = Rotation.align_vectors(a, b)
    return np.linalg.norm(a - rotation.apply(b), axis=1)


def test_the_automatic_numbering_is_the_chains(scene):
    balls, layouts, _ = scene
    document = judge_numbering(balls, **layouts)
    numbering = number_balls(balls.centers_mm, **layouts)
    assert document["complete"]
    assert document["faults"] == []
    assert document["settled_by"] == "layout"
    assert document["assigned"] == {str(n): k for n, k in numbering.ball_of_number.items()}
    assert document["unused"] == list(numbering.unused)
    assert document["margin_mm"] == pytest.approx(numbering.margin_mm, abs=1e-9)
    assert document["rings"]["proximal"]["rms_mm"] == pytest.approx(
        numbering.proximal.rms_mm, abs=1e-9
    )


@pytest.mark.parametrize("by_index", [True, False])
def test_the_right_numbers_by_the_user_are_complete(scene, by_index):
    balls, layouts, right = scene
    centers = balls.centers_mm
    given_numbers = {
        str(n): k if by_index else (centers[k] + 0.5).tolist() for n, k in right.items()
    }
    document = judge_numbering(balls, **layouts, assigned=given_numbers)
    assert document["complete"]
    assert document["settled_by"] == "user"
    assert document["assigned"] == {str(n): k for n, k in right.items()}
    assert all(ring["assigned"] == ring["markers"] for ring in document["rings"].values())


@pytest.mark.parametrize("swap", [(1, 2), (3, 4), (5, 8), (2, 6)])
def test_exchanged_numbers_are_told_as_the_chain_refuses_them(scene, swap):
    balls, layouts, right = scene
    wrong = {**right, swap[0]: right[swap[1]], swap[1]: right[swap[0]]}
    document = judge_numbering(balls, **layouts, assigned=wrong)
    centers = balls.centers_mm
    with pytest.raises(HexaFixError) as error:
        check_user_numbering({n: centers[k] for n, k in wrong.items()}, centers, **layouts)
    assert document["faults"] == [fault.as_json() for fault in error.value.faults]
    assert not document["complete"]
    assert document["settled_by"] is None
    rings = [r for r, layout in layouts.items() if set(swap) & set(layout.numbers)]
    for ring in rings:
        layout = layouts[ring]
        wanted = residuals(centers[[wrong[n] for n in layout.numbers]], layout.points_mm)
        shown = document["rings"][ring]
        assert shown["rms_mm"] == pytest.approx(np.sqrt(np.mean(wanted**2)), abs=1e-6)
        assert shown["rms_mm"] > 5.0
        assert list(shown["residuals_mm"].values()) == pytest.approx(wanted.tolist(), abs=1e-6)


def test_the_next_best_choice_of_a_ring_is_that_of_brute_force(scene):
    balls, layouts, right = scene
    document, centers = judge_numbering(balls, **layouts), balls.centers_mm
    layout = layouts["proximal"]
    own = [right[n] for n in layout.numbers]
    free = sorted(set(range(len(centers))) - {right[n] for n in layouts["distal"].numbers})
    rms = {
        order: np.sqrt(np.mean(residuals(centers[list(order)], layout.points_mm) ** 2))
        for order in permutations(free, len(layout))
    }
    best = min(value for order, value in rms.items() if list(order) != own)
    assert document["rings"]["proximal"]["next_best_mm"] == pytest.approx(best, abs=1e-6)
    assert document["rings"]["proximal"]["next_best_is_bound"] is False


@settings(deadline=None, max_examples=60)
@given(data=st.data())
def test_right_numbers_given_so_far_miss_only_the_others(data, scene):
    balls, layouts, right = scene
    numbers = data.draw(st.sets(st.sampled_from(sorted(right)), max_size=len(right) - 1))
    document = judge_numbering(balls, **layouts, assigned={n: right[n] for n in numbers})
    assert codes(document) == ["number-missing"]
    missing = sorted(set(right) - numbers)
    assert document["faults"][0]["value"] == ", ".join(map(str, missing))
    assert not document["complete"]
    for ring, layout in layouts.items():
        so_far = [n for n in layout.numbers if n in numbers]
        shown = document["rings"][ring]
        assert shown["assigned"] == len(so_far)
        assert (shown["rms_mm"] is None) == (len(so_far) < 3)
        assert shown["rms_mm"] is None or shown["rms_mm"] < 0.2
        assert (shown["next_best_mm"] is None) == (len(so_far) < len(layout))


def test_a_wrong_number_shows_before_the_ring_is_whole(scene):
    balls, layouts, right = scene
    some = {1: right[2], 2: right[1], 3: right[3]}
    document = judge_numbering(balls, **layouts, assigned=some)
    assert codes(document) == ["number-missing", "numbering-does-not-fit"]
    assert "proximal ring" in document["faults"][1]["message"]


@pytest.mark.parametrize(
    ("wrong", "code"),
    [
        ({"1": 999}, "number-no-ball"),
        ({"1": -1}, "number-no-ball"),
        ({"1": True}, "number-no-ball"),
        ({"1": [0.0, 0.0, 0.0]}, "number-no-ball"),
        ({"1": [0.0, 0.0]}, "number-no-ball"),
        ({"77": 0}, "number-unknown"),
        ({"1": 0, "2": 0}, "ball-twice"),
    ],
)
def test_a_wrong_assignment_is_a_fault_and_no_exception(scene, wrong, code):
    balls, layouts, _ = scene
    document = judge_numbering(balls, **layouts, assigned=wrong)
    assert codes(document) == [code]
    assert not document["complete"]


def test_no_ball_at_all_is_told(scene):
    _, layouts, _ = scene
    assert codes(judge_numbering(BallSet(()), **layouts)) == ["ring-not-found"]
    assert codes(judge_numbering(BallSet(()), **layouts, assigned={1: 0})) == ["number-no-ball"]


def test_a_missing_ball_is_told_as_the_chain_refuses_it(scene):
    balls, layouts, right = scene
    left = BallSet(tuple(b for k, b in enumerate(balls.balls) if k != right[3]))
    document = judge_numbering(left, **layouts)
    assert codes(document) == ["ring-not-found"]
    assert document["assigned"] == {}
    assert "3 of 4" in document["faults"][0]["message"]


@pytest.fixture
def a_symmetric_ring(a_draft_case):
    """Balls of a tilted frame whose proximal layout is threefold, its case, its true readings."""
    even = [
        {"number": n, "radius_mm": 100.0, "sweep_deg": 120.0 * n, "height_mm": 20.0}
        for n in (1, 2, 3)
    ]
    rows = {"proximal": even, "distal": a_draft_case().document["markers"]["distal"]}
    fixator = a_draft_case().fixator
    turn = Rotation.from_euler("xyz", [6.0, -4.0, 9.0], degrees=True).as_matrix()
    shift = np.array([5.0, -7.0, 170.0])
    upper = fixator.proximal.joints_mm @ turn.T + shift
    lengths = np.linalg.norm(upper - fixator.distal.joints_mm, axis=1)

    def places(ring):
        t, phi, h = np.array(
            [[r["radius_mm"], np.radians(r["sweep_deg"]), r["height_mm"]] for r in rows[ring]]
        ).T
        return np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)

    centers = np.vstack([places("proximal") @ turn.T + shift, places("distal")])
    kind = {"diameter_mm": 10.0, "covariance_mm2": 0.03**2 * np.eye(3), "rms_residual_mm": 0.02}
    kind |= {"core_hu": 2300.0, "method": "gradient-rays"}
    balls = BallSet(tuple(Ball(center_mm=center, **kind) for center in centers))

    def case(readings):
        markers = {"ball_diameter_mm": 10.0, **rows}
        values = None if readings is None else np.asarray(readings).tolist()
        return a_draft_case(markers=markers, strut_readings_mm=values)

    return balls, case, lengths - fixator.strut.scale_offset_mm


def test_the_readings_settle_what_a_symmetric_layout_leaves_open(a_symmetric_ring):
    balls, case, readings = a_symmetric_ring
    document = judge_case_numbering(case(readings), balls)
    assert document["settled_by"] == "strut-readings"
    assert [document["assigned"][n] for n in "123"] == [0, 1, 2]
    assert document["complete"]


def test_without_readings_a_symmetric_layout_stays_open(a_symmetric_ring):
    balls, case, _ = a_symmetric_ring
    document = judge_case_numbering(case(None), balls)
    assert codes(document) == ["numbering-ambiguous"]
    assert document["assigned"] == {}
    assert judge_by_struts(None, np.full(6, 170.0)) is None


def test_the_users_numbers_of_a_symmetric_layout_are_not_unique(a_symmetric_ring):
    """What G7 refuses in the chain is told at once."""
    balls, case, readings = a_symmetric_ring
    own = {
        n: k
        for k, n in enumerate((*case(readings).proximal.numbers, *case(readings).distal.numbers))
    }
    parts = case(readings)
    document = judge_numbering(balls, proximal=parts.proximal, distal=parts.distal, assigned=own)
    assert codes(document) == ["numbering-ambiguous"]
    assert not document["complete"]
    assert document["rings"]["proximal"]["next_best_mm"] == pytest.approx(0.0, abs=1e-6)


def test_without_layouts_there_is_nothing_to_judge(tmp_path, a_recognised):
    with pytest.raises(HexaFixError) as error:
        judge_case_numbering(parts_of(b"{}", folder=tmp_path), a_recognised.balls)
    assert error.value.faults[0].code == "no-layout"
