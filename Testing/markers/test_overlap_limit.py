"""Of two fits that would overlap one goes, and the reason tells the limit that was used."""

from types import SimpleNamespace

import numpy as np
import pytest
from hexafix.markers.find import OVERLAP_MM, _apart

RADIUS_MM = 5.0


def fit(x_mm, residual_mm):
    ball = SimpleNamespace(center_mm=np.array([x_mm, 0.0, 0.0]), rms_residual_mm=residual_mm)
    return SimpleNamespace(ball=ball)


@pytest.mark.parametrize("gap_mm", [2 * RADIUS_MM - OVERLAP_MM + 0.01, 2 * RADIUS_MM])
def test_balls_that_may_touch_both_stay(gap_mm):
    kept, doubled = _apart([fit(0.0, 0.01), fit(gap_mm, 0.02)], RADIUS_MM)
    assert len(kept) == 2
    assert doubled == []


def test_the_rounder_of_two_that_overlap_stays_and_the_limit_is_the_one_used():
    kept, (rejected,) = _apart([fit(0.0, 0.02), fit(9.3, 0.01)], RADIUS_MM)
    assert [f.ball.center_mm[0] for f in kept] == [9.3]
    assert rejected.reason == "overlap: 9.3 mm from another ball, limit 9.4 mm"
