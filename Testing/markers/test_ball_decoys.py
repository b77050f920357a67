from __future__ import annotations

import numpy as np
from hexafix.markers import find_balls


def reasons_at(found, place) -> str:
    return " | ".join(r.reason for r in found.rejected if np.linalg.norm(r.center_mm - place) < 3)


def test_a_ball_joint_of_the_same_size_is_rejected_for_its_metal_stem(workbench):
    bench = workbench()
    bench.ball((-10.0, 0.0, 0.0))
    bench.ball((6.0, 0.0, 0.0))
    bench.rod((6.0, 0.0, 0.0), (24.0, 0.0, 0.0), 5.0, 2300.0)
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert len(found.balls) == 1
    assert np.linalg.norm(found.balls[0].center_mm - bench.lps((-10.0, 0.0, 0.0))) < 0.03
    assert "rod: " in reasons_at(found, bench.lps((6.0, 0.0, 0.0)))


def test_a_ball_of_another_material_is_rejected_among_three_alike(workbench):
    bench = workbench(1, (34.0, 14.0, 14.0))
    for x in (-25.0, -8.0, 8.0):
        bench.ball((x, 0.0, 0.0))
    bench.ball((25.0, 0.0, 0.0), hu=1200.0)
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert len(found.balls) == 3
    assert reasons_at(found, bench.lps((25.0, 0.0, 0.0))).startswith("core HU: ")


def test_two_materials_without_a_majority_are_kept_and_warned_about(workbench):
    bench = workbench(1, (34.0, 14.0, 14.0))
    for x, hu in ((-25.0, 2300.0), (-8.0, 2300.0), (8.0, 1200.0), (25.0, 1200.0)):
        bench.ball((x, 0.0, 0.0), hu=hu)
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert len(found.balls) == 4
    assert any("density" in warning for warning in found.warnings)


def test_a_cube_a_bolt_and_an_ellipsoid_are_no_balls(workbench):
    bench = workbench(2, (40.0, 14.0, 14.0))
    bench.ball((-30.0, 0.0, 0.0))
    bench.box((-10.0, 0.0, 0.0), (4.3, 4.3, 4.3), 2300.0)
    bench.rod((8.0, -6.0, 0.0), (8.0, 6.0, 0.0), 9.0, 3000.0)
    stretched = bench.points - np.array([26.0, 0.0, 0.0])
    away = np.linalg.norm(stretched / np.array([1.1, 0.95, 0.9]), axis=-1)
    bench.fill(0.5 * (1 - np.tanh((away - 5.0) / 0.5)), 1500.0)
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert len(found.balls) == 1
    assert np.linalg.norm(found.balls[0].center_mm - bench.lps((-30.0, 0.0, 0.0))) < 0.03


def test_half_a_ball_is_rejected(workbench):
    bench = workbench(3)
    bench.ball((0.0, 0.0, 0.0))
    bench.hu[bench.points[..., 0] > 1.5] = -1000.0
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert found.balls == ()


def test_thin_wires_and_plates_give_no_candidates_at_all(workbench):
    bench = workbench(4)
    bench.rod((-40.0, 0.0, -6.0), (40.0, 0.0, -6.0), 1.8, 3071.0)
    bench.box((0.0, 0.0, 6.0), (40.0, 40.0, 1.5), 1500.0)
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert found.balls == ()
    assert found.rejected == ()


def test_a_ball_that_is_uneven_inside_is_rejected_for_its_core(workbench):
    bench = workbench(5)
    bench.ball((0.0, 0.0, 0.0))
    inside = np.linalg.norm(bench.points, axis=-1) < 3.2
    bench.hu[inside & (bench.points[..., 0] > 1.2)] = 1200.0
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert found.balls == ()
    assert "core: " in reasons_at(found, bench.lps((0.0, 0.0, 0.0)))


def test_a_clipped_round_ended_bolt_is_no_ball(workbench):
    bench = workbench(6)
    bench.ball((0.0, 0.0, 0.0), hu=8000.0)
    bench.rod((0.0, 0.0, 0.0), (8.0, 0.0, 0.0), 10.0, 8000.0)
    assert find_balls(bench.volume(), ball_diameter_mm=10.0).balls == ()
