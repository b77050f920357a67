from itertools import pairwise

import numpy as np
import pytest
from hexafix.correction.path import days_needed, watched_points
from hexafix.errors import InputError, Refused
from hexafix.geometry import Pose
from hypothesis import given, settings
from hypothesis import strategies as st

MOVING = ["proximal", "distal"]
turn = st.floats(-12.0, 12.0)
shift = st.floats(-15.0, 15.0)


def ways_by_brute_force(path, points_mm, count):
    """Points of the moving ring in the frame of the resting one, shape (count + 1, P, 3)."""
    rotations, positions = path.poses(np.linspace(0.0, 1.0, count + 1))
    if path.moving == "proximal":
        return np.einsum("sij,pj->spi", rotations, points_mm) + positions[:, None]
    return np.einsum("sji,spj->spi", rotations, points_mm - positions[:, None])


@settings(max_examples=50, deadline=None)
@given(
    angles=st.tuples(turn, turn, turn),
    offset=st.tuples(shift, shift, shift),
    moving=st.sampled_from(MOVING),
)
def test_every_watched_point_runs_at_constant_speed(pose, path_of, angles, offset, moving):
    path = path_of(pose(), pose(np.add((0, 0, 185.0), offset), angles), moving)
    at = ways_by_brute_force(path, path.watched.points_mm, 500)
    steps = np.linalg.norm(np.diff(at, axis=0), axis=-1) * 500
    np.testing.assert_allclose(steps, np.broadcast_to(path.ways_mm, steps.shape), atol=1e-4)


@pytest.mark.parametrize("moving", MOVING)
def test_the_path_runs_from_start_to_target(pose, path_of, moving):
    start, target = pose((3, 4, 180), (5, -6, 20)), pose((-10, 2, 190), (-8, 9, -30))
    rotations, positions = path_of(start, target, moving).poses([0.0, 1.0])
    np.testing.assert_allclose(rotations, [start.rotation, target.rotation], atol=1e-12)
    np.testing.assert_allclose(positions, [start.position_mm, target.position_mm], atol=1e-9)


def test_a_pure_shift_is_a_straight_line(pose, path_of):
    path = path_of(pose(), pose((12, -5, 170)))
    rotations, positions = path.poses([0.25])
    np.testing.assert_allclose(rotations[0], np.eye(3), atol=1e-12)
    np.testing.assert_allclose(positions[0], [3.0, -1.25, 181.25], atol=1e-9)
    assert path.sideways_mm.max() < 1e-9


@pytest.mark.parametrize("moving", MOVING)
def test_the_rate_limit_holds_between_rows_and_the_day_less_would_break_it(
    pose, path_of, rules, moving
):
    path = path_of(pose((5, -8, 180), (6, -9, 12)), pose((-6, 4, 192), (-3, 4, -2)), moving)
    limits = rules(max_rate_mm_per_day=0.8, max_rate_rad_per_day=1.0)
    pace = days_needed(path, limits)
    at = ways_by_brute_force(path, path.watched.points_mm, 200 * pace.days)
    within_a_day = max(
        np.linalg.norm(np.diff(at[k : k + 201], axis=0), axis=-1).sum(axis=0).max()
        for k in range(0, len(at) - 200, 37)
    )
    assert within_a_day <= 0.8 + 1e-9
    assert within_a_day == pytest.approx(pace.rate_mm_per_day, rel=1e-5)
    assert path.ways_mm.max() / (pace.days - 1) > 0.8


def test_the_fastest_point_rules_and_is_named(pose, path_of, rules):
    # tilting about x moves the joints far from the x axis
    path = path_of(pose(), pose(angles_deg=(10.0, 0.0, 0.0)))
    pace = days_needed(path, rules(max_rate_rad_per_day=1.0))
    assert pace.ruling in ("joint 2 of the proximal ring", "joint 5 of the proximal ring")
    assert pace.days == int(np.ceil(path.ways_mm.max()))


def test_the_rotation_rules_when_it_is_the_slower_one(pose, path_of, rules):
    path = path_of(pose(), pose(angles_deg=(0.0, 0.0, 10.0)))
    pace = days_needed(
        path, rules(max_rate_mm_per_day=50.0, max_rate_rad_per_day=float(np.radians(1.0)))
    )
    assert pace.ruling == "rotation"
    assert pace.days == 10
    assert np.degrees(pace.rate_rad_per_day) == pytest.approx(1.0)


def test_a_limit_met_exactly_needs_no_further_day(pose, path_of, rules):
    pace = days_needed(path_of(pose(), pose((0, 0, 192))), rules())
    assert pace.days == 7
    assert pace.rate_mm_per_day == pytest.approx(1.0)


@pytest.mark.parametrize("moving", MOVING)
def test_structures_at_risk_rule_instead_of_the_ring(pose, path_of, rules, moving):
    start, target = pose(), pose(angles_deg=(0.0, 0.0, 9.0))
    nerve = np.array([[20.0, 0.0, 90.0], [5.0, 0.0, 90.0]])
    path = path_of(start, target, moving, structures=nerve)
    # about the z axis a point runs radius times angle, whichever ring moves
    np.testing.assert_allclose(path.ways_mm, np.radians(9.0) * np.array([20.0, 5.0]), atol=1e-9)
    pace = days_needed(path, rules(max_rate_rad_per_day=1.0))
    assert pace.ruling == "structure at risk 1"
    assert pace.days == 4


def test_structures_are_read_in_the_image_frame(fixator):
    ring = Pose.from_xyz_fixed(position_mm=[50, 60, 70], angles_rad=[0.1, 0.2, 2.0])
    inside = np.array([[1.0, 2.0, 3.0]])
    watched = watched_points(
        fixator, moving="distal", moving_ring=ring, structures_lps_mm=ring.apply(inside)
    )
    np.testing.assert_allclose(watched.points_mm, inside, atol=1e-12)


def test_the_moving_ring_is_watched_at_its_centre_and_joints(fixator, pose):
    for moving in MOVING:
        watched = watched_points(fixator, moving=moving, moving_ring=pose())
        np.testing.assert_array_equal(watched.points_mm[0], [0, 0, 0])
        np.testing.assert_array_equal(watched.points_mm[1:], getattr(fixator, moving).joints_mm)


@pytest.mark.parametrize("moving", MOVING)
def test_without_structures_rounding_counts_in_the_middle_between_the_rings(pose, path_of, moving):
    start = pose((10.0, -20.0, 180.0), (5, 6, 7))
    path = path_of(start, pose(), moving)
    in_a = path.in_proximal(path.interest_mm, [0.0])[0]
    np.testing.assert_allclose(start.apply(in_a), [[5.0, -10.0, 90.0]], atol=1e-9)
    fracture = path_of(start, pose(), moving, fracture=[1.0, 2.0, 70.0])
    in_a = fracture.in_proximal(fracture.interest_mm, [0.0])[0]
    np.testing.assert_allclose(start.apply(in_a), [[1.0, 2.0, 70.0]], atol=1e-9)


def test_the_sideways_excursion_is_that_of_a_circle(pose, path_of):
    path = path_of(pose(), pose(angles_deg=(0.0, 0.0, 40.0)), structures=[[100.0, 0.0, 185.0]])
    sagitta = 100.0 * (1 - np.cos(np.radians(20.0)))
    assert path.sideways_mm[0] == pytest.approx(sagitta, rel=1e-3)
    rough = path.ways_mm[0] * np.radians(40.0) / 8
    assert path.sideways_mm[0] == pytest.approx(rough, rel=0.02)


def test_no_motion_needs_no_day(pose, path_of, rules):
    pace = days_needed(path_of(pose(), pose()), rules())
    assert (pace.days, pace.ruling) == (0, "nothing moves")


def test_an_absurd_duration_is_refused_with_its_reason(pose, path_of, rules):
    with pytest.raises(Refused) as caught:
        days_needed(path_of(pose(), pose((0, 0, 195))), rules(max_rate_mm_per_day=0.02))
    fault = caught.value.faults[0]
    assert fault.code == "absurd-duration"
    assert "500 days" in str(fault.value)
    assert "ring" in fault.what


@pytest.mark.parametrize("rate", [0.0, -1.0, np.inf, np.nan])
@pytest.mark.parametrize("name", ["max_rate_mm_per_day", "max_rate_rad_per_day"])
def test_a_rate_that_is_no_rate_is_an_input_error(pose, path_of, rules, name, rate):
    with pytest.raises(InputError) as caught:
        days_needed(path_of(pose(), pose((0, 0, 195))), rules(**{name: rate}))
    assert caught.value.faults[0].where == f"schedule.{name.replace('rad', 'deg')}"


@pytest.mark.parametrize("bad", [[[1.0, 2.0]], [1.0, 2.0, 3.0], [[1.0, 2.0, np.nan]]])
def test_structures_that_are_no_points_are_input_errors(fixator, pose, bad):
    with pytest.raises(InputError, match="structures"):
        watched_points(fixator, moving="distal", moving_ring=pose(), structures_lps_mm=bad)


def test_both_fragments_see_one_path(pose, path_of):
    start, target = pose((5, -8, 180), (6, -9, 12)), pose((-6, 4, 192), (-3, 4, -2))
    s = np.linspace(0, 1, 7)
    for a, b in pairwise([path_of(start, target, moving).poses(s) for moving in MOVING]):
        np.testing.assert_array_equal(a[0], b[0])
        np.testing.assert_array_equal(a[1], b[1])
