from itertools import product

import numpy as np
import pytest
from hexafix.correction.path import path_parameters
from hexafix.correction.rounding import ROTATION_WEIGHT_MM, displacements, round_rows
from hexafix.errors import StrutOutOfRange
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, Ring, StrutType
from hexafix.kinematics import (
    forward_kinematics,
    forward_kinematics_batch,
    strut_lengths,
    strut_lengths_batch,
)


def rows(random_pose, count, seed, **spread):
    rng = np.random.default_rng(seed)
    poses = [random_pose(rng, **spread) for _ in range(count)]
    return poses, np.array([p.rotation for p in poses]), np.array([p.position_mm for p in poses])


@pytest.mark.parametrize("step", [1.0, 0.5])
def test_the_choice_is_the_best_of_all_64_by_exact_kinematics(fixator, random_pose, step):
    poses, r, p = rows(random_pose, 6, seed=1)
    point = np.array([4.0, -7.0, -90.0])
    found = round_rows(
        rotations=r,
        positions_mm=p,
        interest_in_a_mm=np.broadcast_to(point, (6, 1, 3)),
        fixator=fixator,
        step_mm=step,
    )
    for k, pose in enumerate(poses):
        below = np.floor(strut_lengths(pose, fixator) / step)
        best = min(
            (
                _cost(
                    pose, forward_kinematics(step * (below + choice), fixator, start=pose), point
                ),
                tuple(step * (below + choice)),
            )
            for choice in product((0, 1), repeat=6)
        )
        assert tuple(found.readings_mm[k]) == best[1]


def _cost(pose, solution, point):
    moved = np.linalg.norm(pose.apply(point) - solution.pose.apply(point))
    return np.hypot(moved, ROTATION_WEIGHT_MM * pose.difference(solution.pose)[1])


def test_the_stated_errors_are_those_of_the_readings(fixator, random_pose):
    poses, r, p = rows(random_pose, 5, seed=2)
    points = np.broadcast_to([[0.0, 0.0, -90.0], [10.0, 0.0, -80.0]], (5, 2, 3))
    found = round_rows(
        rotations=r, positions_mm=p, interest_in_a_mm=points, fixator=fixator, step_mm=0.5
    )
    for k, pose in enumerate(poses):
        real = forward_kinematics(found.readings_mm[k], fixator, start=pose).pose
        moved = np.linalg.norm(real.apply(points[k]) - pose.apply(points[k]), axis=1)
        assert found.shift_mm[k] == pytest.approx(moved.max(), abs=1e-9)
        assert found.turn_rad[k] == pytest.approx(pose.difference(real)[1], abs=1e-9)
        np.testing.assert_allclose(found.rotations[k], real.rotation, atol=1e-9)


def test_it_nearly_halves_what_plain_rounding_costs_at_a_fracture(random_pose):
    """180 mm joint circle, 150 mm gap, whole millimetres: 0.75 mm plain, 0.43 mm best of 64."""
    angles = np.radians([12, 108, 132, 228, 252, 348])
    top = 90.0 * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1)
    turned = angles + np.radians([36, -36, 36, -36, 36, -36])
    base = 90.0 * np.stack([np.cos(turned), np.sin(turned), 0 * turned], axis=1)
    frame = Fixator("f", "f", "f", Ring(top, 8, 110), Ring(base, 8, 110), StrutType(50, 400))
    _, r, p = rows(random_pose, 300, seed=3, height=150.0)
    fracture = np.broadcast_to([0.0, 0.0, -75.0], (300, 1, 3))
    found = round_rows(
        rotations=r, positions_mm=p, interest_in_a_mm=fracture, fixator=frame, step_mm=1.0
    )
    lengths = [strut_lengths(Pose(*pose), frame) for pose in zip(r, p, strict=True)]
    plain = forward_kinematics_batch(np.round(lengths), frame, start_rotations=r, start_positions=p)
    by_plain = displacements(
        points_in_a_mm=fracture,
        from_rotations=r,
        from_positions=p,
        to_rotations=plain.rotations,
        to_positions=plain.positions_mm,
    )
    assert by_plain.mean() == pytest.approx(0.75, abs=0.15)
    assert found.shift_mm.mean() == pytest.approx(0.43, abs=0.08)
    assert found.shift_mm.mean() < 0.65 * by_plain.mean()
    assert np.degrees(found.turn_rad.mean()) == pytest.approx(0.31, abs=0.04)


def test_readings_are_whole_steps_after_the_scale_offset(with_strut, random_pose):
    fixator = with_strut(scale_offset_mm=12.3)
    poses, r, p = rows(random_pose, 20, seed=4)
    found = round_rows(
        rotations=r,
        positions_mm=p,
        interest_in_a_mm=np.zeros((20, 1, 3)),
        fixator=fixator,
        step_mm=0.1,
    )
    np.testing.assert_array_equal(found.readings_mm, np.round(found.steps * 0.1, 1))
    lengths = np.array([strut_lengths(pose, fixator) for pose in poses])
    assert np.abs(found.readings_mm + 12.3 - lengths).max() < 0.1


def test_whole_readings_stay_as_they_are(fixator, random_pose):
    poses, _, _ = rows(random_pose, 1, seed=5)
    readings = np.round(strut_lengths(poses[0], fixator))
    pose = forward_kinematics(readings, fixator, start=poses[0]).pose
    found = round_rows(
        rotations=pose.rotation[None],
        positions_mm=pose.position_mm[None],
        interest_in_a_mm=np.zeros((1, 1, 3)),
        fixator=fixator,
        step_mm=1.0,
    )
    np.testing.assert_array_equal(found.readings_mm[0], readings)


def test_no_reading_is_rounded_out_of_the_stroke(with_strut, random_pose):
    poses, r, p = rows(random_pose, 40, seed=6)
    for pose, rotation, position in zip(poses, r, p, strict=True):
        lengths = strut_lengths(pose, with_strut())
        tight = with_strut(min_mm=lengths.min() - 0.01, max_mm=1000.0)
        found = round_rows(
            rotations=rotation[None],
            positions_mm=position[None],
            interest_in_a_mm=np.zeros((1, 1, 3)),
            fixator=tight,
            step_mm=1.0,
        )
        assert found.readings_mm.min() >= tight.strut.min_mm


def test_a_stroke_without_a_settable_reading_is_refused(with_strut, pose):
    fixator = with_strut(min_mm=175.05, max_mm=175.2)
    poses = np.array([pose().rotation] * 2), np.array([pose().position_mm] * 2)
    with pytest.raises(StrutOutOfRange) as caught:
        round_rows(
            rotations=poses[0],
            positions_mm=poses[1],
            interest_in_a_mm=np.zeros((2, 1, 3)),
            fixator=fixator,
            step_mm=1.0,
        )
    assert caught.value.faults[0].hazard == "H27"


@pytest.mark.parametrize("step", [0.5, 1.0])
def test_no_strut_is_turned_back_and_a_days_way_is_shortened(fixator, random_pose, path_of, step):
    rng = np.random.default_rng(9)
    path = path_of(random_pose(rng), random_pose(rng))
    s = path_parameters(int(np.ceil(path.ways_mm.max())), 4)
    rotations, positions = path.poses(s)
    watched = path.in_proximal(path.watched.points_mm, s)
    common = {
        "rotations": rotations,
        "positions_mm": positions,
        "interest_in_a_mm": path.in_proximal(path.interest_mm, s),
        "fixator": fixator,
        "step_mm": step,
    }
    free = round_rows(**common)
    kept = round_rows(**common, watched_in_a_mm=watched, most_way_mm=1.0 + step, rows_a_day=4)

    def longest(found):
        return displacements(
            points_in_a_mm=watched[4:],
            from_rotations=found.rotations[:-4],
            from_positions=found.positions_mm[:-4],
            to_rotations=found.rotations[4:],
            to_positions=found.positions_mm[4:],
        ).max()

    def turned_back(found):
        ideal = strut_lengths_batch(rotations=rotations, positions_mm=positions, fixator=fixator)
        turns = np.diff(found.readings_mm[1:], axis=0)
        return np.sum(turns * np.diff(ideal[1:], axis=0) < -1e-12)

    assert turned_back(kept) == 0 < turned_back(free)
    assert longest(kept) < longest(free)
    assert kept.shift_mm.mean() < 1.35 * free.shift_mm.mean()
