"""Section 4.3.2 over all 5° layouts of three markers, by the analytic model."""

import numpy as np
import pytest
from hexafix.accuracy import angle_rule
from hexafix.accuracy.jacobian import (
    group_covariance,
    isotropic_covariances,
    least_squares_covariance,
    volume_error,
)
from hexafix.hardware import MarkerLayout
from hexafix.recognition.least_squares import IMAGE_SIGMA_MM, INSTALLATION_SIGMA_MM
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM, best_triangle_height_mm

Row = tuple[tuple[int, ...], MarkerLayout, float, float]


@pytest.fixture(scope="module")
def sweep() -> list[Row]:
    """Sorted included angles, layout and volume errors (mm, °), once for each set of angles."""
    rows = []
    for smallest in range(15, 125, 5):
        for median in range(smallest, (360 - smallest) // 2 + 1, 5):
            largest = 360 - smallest - median
            layout = MarkerLayout.of(
                radius_mm=[100] * 3, sweep_deg=[0, smallest, smallest + median], height_mm=[20] * 3
            )
            if best_triangle_height_mm(layout.points_mm) < MIN_TRIANGLE_HEIGHT_MM:
                continue  # Refused whatever the rules say (H16).
            mm, rad = volume_error(group_covariance(layout))
            rows.append(((smallest, median, largest), layout, float(mm), float(np.degrees(rad))))
    return rows


def worst(rows: list[Row]) -> tuple[float, float]:
    assert len(rows) > 20
    return max(row[2] for row in rows), max(row[3] for row in rows)


def test_the_45_degree_rule_holds_to_within_four_percent(sweep):
    preferred = [row for row in sweep if row[0][0] >= 45]
    assert all(angle_rule(layout) == "preferred" for _, layout, _, _ in preferred)
    assert worst(preferred) == pytest.approx((0.909, 0.617), rel=0.01)
    mm, deg = worst(preferred)
    assert mm / 0.9 < 1.04
    assert deg / 0.6 < 1.04
    assert max(preferred, key=lambda row: row[2])[0] == (45, 45, 270)
    stricter = [row for row in preferred if row[0][0] > 45]
    assert worst(stricter) == pytest.approx((0.742, 0.520), rel=0.015)


def test_the_relaxed_rule_is_optimistic(sweep):
    relaxed = [row for row in sweep if row[0][2] - row[0][1] <= 150]
    assert all(angle_rule(layout) in ("preferred", "relaxed") for _, layout, _, _ in relaxed)
    mm, deg = worst(relaxed)
    assert (mm, deg) == pytest.approx((1.17, 1.01), rel=0.03)
    assert mm > 1.0
    assert deg > 0.8


def test_ninety_degrees_and_the_best_layout(sweep):
    assert worst([r for r in sweep if r[0][0] >= 75])[0] > worst_of_ninety(sweep)[0]
    assert worst_of_ninety(sweep) == pytest.approx((0.301, 0.216), rel=0.02)
    best = min(sweep, key=lambda row: row[2])
    assert best[0] == (120, 120, 120)
    assert best[2:] == pytest.approx((0.269, 0.179), rel=0.02)


def worst_of_ninety(rows: list[Row]) -> tuple[float, float]:
    even = [row for row in rows if row[0][0] >= 90]
    return max(row[2] for row in even), max(row[3] for row in even)


def test_the_batched_model_ranks_as_the_single_one(sweep):
    some = [layout for _, layout, _, _ in sweep[::10]]
    sigma = float(np.hypot(IMAGE_SIGMA_MM, INSTALLATION_SIGMA_MM))
    batch = volume_error(isotropic_covariances(np.array([x.points_mm for x in some]), sigma))
    single = [volume_error(least_squares_covariance(x)) for x in some]
    assert batch[0] == pytest.approx([float(e[0]) for e in single], rel=1e-9)
    assert batch[1] == pytest.approx([float(e[1]) for e in single], rel=1e-9)
