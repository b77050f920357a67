"""The layouts of Section 4.3."""

import numpy as np
import pytest
from hexafix.accuracy import angle_rule
from hexafix.errors import InputError, LayoutRejected
from hexafix.recognition.groups import marker_groups
from hexafix.study.layouts import (
    RingLayouts,
    angle_rules,
    even_layout,
    three_marker_layouts,
)


@pytest.fixture(scope="module")
def sweep():
    return three_marker_layouts(5)


def test_the_grid_holds_every_ordered_layout_once(sweep):
    wanted = {
        (a, b, 360 - a - b) for a in range(5, 360, 5) for b in range(5, 360, 5) if a + b <= 355
    }
    gaps = np.rint(np.degrees(sweep.included_angles_rad)).astype(int)
    assert len(sweep) == len(wanted) == 2485
    assert {tuple(row) for row in gaps.tolist()} == wanted
    assert np.all(sweep.sweep_rad[:, 0] == 0.0)


def test_layouts_are_sorted_by_minimum_median_maximum(sweep):
    keys = np.sort(np.rint(np.degrees(sweep.included_angles_rad)), axis=1).tolist()
    assert keys == sorted(keys)


def test_the_rules_are_those_of_check_layout(sweep):
    rules = angle_rules(sweep)
    for g in range(0, len(sweep), 37):
        rule = angle_rule(sweep.layout(g))
        assert rules["preferred"][g] == (rule == "preferred")
        assert (rules["relaxed"] | rules["preferred"])[g] == (rule != "violated")


def test_rules_hold_at_their_limits():
    layouts = RingLayouts.of(
        [[0, 45, 90], [0, 44.9, 90], [0, 46, 92], [0, 15, 113], [0, 15, 112], [0, 14, 120]]
    )
    rules = angle_rules(layouts)
    assert rules["preferred"].tolist() == [True, False, True, False, False, False]
    assert rules["above-preferred"].tolist() == [False, False, True, False, False, False]
    # 15/98/247 and 15/97/248: the difference of 150° lies between
    assert rules["relaxed"].tolist() == [False, False, False, True, False, False]


def test_recognisable_layouts_are_those_that_recognition_takes(sweep):
    stated = sweep.recognisable
    assert 100 < np.count_nonzero(~stated) < 1000
    for g in range(0, len(sweep), 29):
        try:
            taken = len(marker_groups(sweep.layout(g))) == 3
        except LayoutRejected:
            taken = False
        assert stated[g] == taken


@pytest.mark.parametrize("markers", [3, 4, 5, 8, 10])
def test_groups_are_the_recognitions(markers):
    layouts = even_layout(markers)
    assert np.array_equal(layouts.groups[0], marker_groups(layouts.layout(0)))
    rng = np.random.default_rng(1)
    shuffled = RingLayouts.of(rng.permuted(np.degrees(layouts.sweep_rad) + 3.0, axis=1))
    assert np.array_equal(shuffled.groups[0], marker_groups(shuffled.layout(0)))


def test_points_are_those_of_the_single_layout(sweep):
    assert np.allclose(sweep.points_mm[100], sweep.layout(100).points_mm, atol=1e-12)
    assert not sweep.sweep_rad.flags.writeable


@pytest.mark.parametrize("step", [0, 7, -5])
def test_a_step_that_does_not_divide_the_circle_is_refused(step):
    with pytest.raises(InputError, match="divide the circle"):
        three_marker_layouts(step)


def test_two_markers_are_refused():
    with pytest.raises(InputError, match="three markers"):
        RingLayouts.of([[0.0, 180.0]])
