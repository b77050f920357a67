import datetime

import numpy as np
import pytest
from hexafix.correction import make_schedule
from hexafix.correction.stroke import stroke_along
from hexafix.errors import InputError, Refused, StrutOutOfRange
from hexafix.geometry import Pose
from hexafix.kinematics import forward_kinematics, strut_lengths, strut_lengths_batch
from hypothesis import example, given, settings
from hypothesis import strategies as st

turn = st.floats(-8.0, 8.0)
shift = st.floats(-12.0, 12.0)


@pytest.fixture(scope="module")
def schedule_of(fixator):
    def make(path, rules, frame=fixator):
        readings = strut_lengths(path.start, frame) - frame.strut.scale_offset_mm
        return make_schedule(path, frame, rules, readings_mm=readings)

    return make


@pytest.fixture
def path(path_of, pose):
    return path_of(pose((5, -8, 180), (6, -9, 12)), pose((-6, 4, 192), (-3, 4, -2)))


def test_the_first_row_is_today_as_read(path, rules, fixator, schedule_of):
    first = schedule_of(path, rules()).rows[0]
    assert (first.day, first.adjustment, first.date) == (0, 0, datetime.date(2026, 12, 1))
    np.testing.assert_array_equal(first.strut_mm, strut_lengths(path.start, fixator))


def _worst_shift_mm(target, point, step, fixator):
    """What a point may move at most, to first order, while no strut is a whole step off."""
    lengths, place = strut_lengths(target, fixator), target.apply(point)
    moved = []
    for strut in np.eye(6):
        near = forward_kinematics(lengths + 1e-4 * strut, fixator, start=target).pose
        moved.append((near.apply(point) - place) / 1e-4)
    signs = np.array(np.meshgrid(*[(-1.0, 1.0)] * 6)).reshape(6, -1).T
    return step * float(np.max(np.linalg.norm(signs @ np.array(moved), axis=1)))


@settings(max_examples=15, deadline=None)
@given(
    angles=st.tuples(turn, turn, turn),
    offset=st.tuples(shift, shift, shift),
    moving=st.sampled_from(["proximal", "distal"]),
    step=st.sampled_from([0.25, 0.5, 1.0]),
)
@example(angles=(0.0, 0.0, 0.0), offset=(0.0, 1.0, 0.0), moving="proximal", step=1.0)
def test_the_last_row_puts_the_ring_at_the_target_up_to_rounding(
    fixator, pose, path_of, rules, schedule_of, angles, offset, moving, step
):
    target = pose(np.add((0.0, 0.0, 185.0), offset), angles)
    schedule = schedule_of(path_of(pose(), target, moving), rules(strut_step_mm=step))
    end = forward_kinematics(schedule.rows[-1].strut_mm, fixator, start=target).pose
    middle = 0.5 * path_of(target, target).start.inverse().position_mm
    error = np.linalg.norm(end.apply(middle) - target.apply(middle))
    assert error < 1.05 * _worst_shift_mm(target, middle, step, fixator)
    assert end.difference(schedule.end)[0] < 1e-9
    assert end.difference(target)[1] == pytest.approx(schedule.end_error_rad, abs=1e-9)


def test_rows_count_days_and_adjustments_over_a_leap_day(path, rules, schedule_of):
    schedule = schedule_of(
        path, rules(start_date=datetime.date(2028, 2, 27), adjustments_per_day=2)
    )
    assert len(schedule.rows) == 1 + 2 * schedule.days
    told = [(row.day, row.adjustment, row.date.isoformat()) for row in schedule.rows[:8]]
    assert told == [
        (0, 0, "2028-02-27"),
        (1, 1, "2028-02-27"),
        (1, 2, "2028-02-27"),
        (2, 1, "2028-02-28"),
        (2, 2, "2028-02-28"),
        (3, 1, "2028-02-29"),
        (3, 2, "2028-02-29"),
        (4, 1, "2028-03-01"),
    ]
    assert schedule.rows[-1].day == schedule.days
    assert schedule.rows[-1].adjustment == 2


@pytest.mark.parametrize("step", [0.5, 1.0])
def test_no_row_drifts_from_its_place_on_the_path(path, rules, fixator, schedule_of, step):
    schedule = schedule_of(path, rules(strut_step_mm=step))
    count = len(schedule.rows) - 1
    rotations, positions = path.poses(np.arange(count + 1) / count)
    for k in range(1, count + 1):
        ideal = strut_lengths(Pose(rotations[k], positions[k]), fixator)
        assert np.abs(np.array(schedule.rows[k].strut_mm) - ideal).max() < step
        assert np.all(np.mod(np.array(schedule.rows[k].strut_mm) / step, 1.0) == 0.0)
    assert schedule.end_error_mm <= schedule.rounding_max_mm
    assert 0.0 < schedule.rounding_max_mm < step


def test_realised_ways_are_those_of_the_rows(path, rules, fixator, schedule_of):
    schedule = schedule_of(path, rules())
    frames = [
        forward_kinematics(row.strut_mm, fixator, start=path.start).pose for row in schedule.rows
    ]
    points = path.watched.points_mm
    longest = max(
        np.linalg.norm(frames[k + 4].apply(points) - frames[k].apply(points), axis=1).max()
        for k in range(len(frames) - 4)
    )
    widest = max(frames[k + 4].difference(frames[k])[1] for k in range(len(frames) - 4))
    assert schedule.realised_max_mm_per_day == pytest.approx(longest, abs=1e-6)
    assert schedule.realised_max_rad_per_day == pytest.approx(widest, abs=1e-8)
    assert schedule.realised_max_mm_per_day <= 1.0 + 0.5


def test_nothing_to_correct_is_a_schedule_of_today_only(pose, path_of, rules, schedule_of):
    schedule = schedule_of(path_of(pose(), pose()), rules())
    assert schedule.nothing_to_correct
    assert len(schedule.rows) == 1
    assert (schedule.days, schedule.end_error_mm, schedule.pace.ruling) == (0, 0.0, "nothing moves")


def test_scale_offset_shifts_readings_and_nothing_else(path, rules, with_strut, schedule_of):
    plain = schedule_of(path, rules(), with_strut())
    offset = schedule_of(path, rules(), with_strut(scale_offset_mm=20.0))
    for a, b in zip(plain.rows, offset.rows, strict=True):
        np.testing.assert_allclose(np.array(a.strut_mm) - 20.0, b.strut_mm, atol=1e-9)


def test_struts_out_of_range_are_all_named_with_day_and_limit(
    pose, path_of, rules, with_strut, schedule_of
):
    path = path_of(pose(), pose((0, 0, 197)))
    with pytest.raises(StrutOutOfRange) as caught:
        schedule_of(path, rules(), with_strut(max_mm=180.0))
    faults = caught.value.faults
    assert [fault.where for fault in faults] == [f"strut {k}" for k in range(1, 7)]
    assert all(fault.hazard == "H27" for fault in faults)
    assert all("on day 12" in fault.what for fault in faults)
    assert all("180 mm" in str(fault.limit) for fault in faults)


def test_a_strut_too_short_today_is_refused_as_today(pose, path_of, rules, with_strut, schedule_of):
    path = path_of(pose(), pose((0, 0, 190)))
    with pytest.raises(StrutOutOfRange, match=r"too short on day 0 \(today\)"):
        schedule_of(path, rules(), with_strut(min_mm=176.0))
    with pytest.raises(StrutOutOfRange, match=r"today"):
        schedule_of(path_of(pose(), pose()), rules(), with_strut(min_mm=176.0))


def test_an_excursion_between_the_rows_is_caught(
    pose, path_of, rules, with_strut, fixator, schedule_of
):
    # strut 2 leans along x only: carried across along y in one day it is shortest half way
    path = path_of(pose((0, -12, 185)), pose((0, 12, 185)))
    fast = rules(adjustments_per_day=1, max_rate_mm_per_day=100.0)
    at_rows = min(strut_lengths(end, fixator)[1] for end in (path.start, path.target))
    half_way = strut_lengths(pose(), fixator)[1]
    assert at_rows - half_way > 0.3
    stroke = stroke_along(path, fixator)
    assert stroke.min_mm[1] == pytest.approx(half_way, abs=1e-9)
    assert stroke.min_at[1] == pytest.approx(0.5, abs=1e-3)
    frame = with_strut(min_mm=0.5 * (half_way + at_rows))
    with pytest.raises(StrutOutOfRange) as caught:
        schedule_of(path, fast, frame)
    assert "strut 2" in {fault.where for fault in caught.value.faults}


@settings(max_examples=15, deadline=None)
@given(angles=st.tuples(turn, turn, turn), offset=st.tuples(shift, shift, shift))
def test_no_dense_sample_exceeds_the_stated_extremes(fixator, pose, path_of, angles, offset):
    path = path_of(
        pose((2.0, -3.0, 180.0), -2 * np.array(angles)),
        pose(np.add((0.0, 0.0, 185.0), offset), angles),
    )
    stroke = stroke_along(path, fixator)
    rotations, positions = path.poses(np.linspace(0, 1, 3001))
    dense = np.array(
        [strut_lengths(Pose(r, p), fixator) for r, p in zip(rotations, positions, strict=True)]
    )
    assert np.all(dense.min(axis=0) >= stroke.min_mm - 1e-9)
    assert np.all(dense.max(axis=0) <= stroke.max_mm + 1e-9)
    np.testing.assert_allclose(dense.min(axis=0), stroke.min_mm, atol=1e-4)
    np.testing.assert_allclose(dense.max(axis=0), stroke.max_mm, atol=1e-4)


def test_a_path_through_a_singular_pose_is_refused(pose, path_of, rules, with_strut, schedule_of):
    path = path_of(pose(angles_deg=(0, 0, 40)), pose(angles_deg=(0, 0, 89)))
    with pytest.raises(Refused) as caught:
        schedule_of(path, rules(), with_strut(min_mm=1.0, max_mm=1000.0))
    assert caught.value.faults[0].hazard == "H31"


def test_an_absurdly_long_schedule_is_refused(path, rules, schedule_of):
    with pytest.raises(Refused) as caught:
        schedule_of(path, rules(max_rate_mm_per_day=0.01))
    assert caught.value.faults[0].code == "absurd-duration"


def test_impossible_rules_are_all_named(path, rules, schedule_of):
    with pytest.raises(InputError) as caught:
        schedule_of(path, rules(adjustments_per_day=0, strut_step_mm=-0.5))
    assert {fault.where for fault in caught.value.faults} == {
        "schedule.adjustments_per_day",
        "schedule.strut_step_mm",
    }


@pytest.mark.parametrize("per_day", [1, 2, 4])
def test_more_adjustments_a_day_do_not_change_the_days(path, rules, schedule_of, per_day):
    schedule = schedule_of(path, rules(adjustments_per_day=per_day))
    assert schedule.days == schedule_of(path, rules()).days
    assert len(schedule.rows) == schedule.days * per_day + 1


def test_both_fragments_strain_the_struts_alike(pose, path_of, rules, schedule_of):
    ends = pose((5, -8, 180), (2, -3, 9)), pose((3, -4, 184), (0, 0, -9))
    by_turn = rules(max_rate_mm_per_day=90.0)
    a, b = (schedule_of(path_of(*ends, moving), by_turn) for moving in ("proximal", "distal"))
    assert a.days == b.days
    np.testing.assert_array_equal(a.stroke.max_mm, b.stroke.max_mm)
    for row, other in zip(a.rows[1:], b.rows[1:], strict=True):
        np.testing.assert_allclose(row.strut_mm, other.strut_mm, atol=0.5 + 1e-9)


@settings(max_examples=15, deadline=None)
@given(
    angles=st.tuples(turn, turn, turn),
    offset=st.tuples(shift, shift, shift),
    step=st.sampled_from([0.5, 1.0]),
)
def test_a_strut_turns_only_the_way_its_length_goes_and_days_keep_the_rate_and_two_steps(
    fixator, pose, path_of, rules, schedule_of, angles, offset, step
):
    path = path_of(pose(), pose(np.add((0.0, 0.0, 185.0), offset), angles))
    schedule = schedule_of(path, rules(strut_step_mm=step))
    assert schedule.realised_max_mm_per_day <= 1.0 + 2.0 * step
    values = np.array([row.strut_mm for row in schedule.rows])
    s = np.arange(len(values)) / max(len(values) - 1, 1)
    rotations, positions = path.poses(s)
    ideal = strut_lengths_batch(rotations=rotations, positions_mm=positions, fixator=fixator)
    assert not np.any(np.diff(values, axis=0) * np.diff(ideal, axis=0) < -1e-9)
