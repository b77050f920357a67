import numpy as np
import pytest
from hexafix.benchmark.compensation import table
from hexafix.correction import (
    FragmentMotion,
    RecognisedRings,
    TargetPose,
    compensate,
    motion_between,
    subtraction_departure_mm,
    target_of,
)
from hexafix.errors import InputError
from hexafix.geometry import Pose
from scipy.optimize import minimize

SIGMA = np.array([0.17, 0.17, 0.17, 0.0025, 0.0025, 0.0017])


def covariance(rng):
    mix = np.eye(6) + 0.3 * rng.normal(size=(6, 6))
    return np.diag(SIGMA) @ mix @ mix.T @ np.diag(SIGMA)


@pytest.fixture
def scene(random_pose):
    rng = np.random.default_rng(5)
    distal = Pose.from_xyz_fixed(
        position_mm=[40.0, -120.0, 900.0], angles_rad=np.radians([8.0, -12.0, 170.0])
    )
    struts = random_pose(rng)
    true = RecognisedRings(distal @ struts, distal, covariance(rng), covariance(rng))
    seen = RecognisedRings(
        true.proximal @ Pose.exp(SIGMA * rng.normal(size=6)),
        true.distal @ Pose.exp(SIGMA * rng.normal(size=6)),
        true.proximal_covariance,
        true.distal_covariance,
    )
    motion = random_pose(rng, height=0.0)
    return true, seen, struts, motion


def close(a, b, atol=1e-9):
    np.testing.assert_allclose(a.matrix, b.matrix, atol=atol)


@pytest.mark.parametrize("mode", ["fused", "additive", "none"])
@pytest.mark.parametrize("moving", ["proximal", "distal"])
def test_without_recognition_error_every_mode_gives_the_planned_pose(scene, mode, moving):
    true, _, struts, motion = scene
    plan = FragmentMotion(moving, motion)
    target = target_of(plan, compensate(true, theoretical=struts, mode=mode))
    if moving == "proximal":
        expected = true.distal.inverse() @ motion @ true.proximal
    else:
        expected = (motion @ true.distal).inverse() @ true.proximal
    close(target, expected)


@pytest.mark.parametrize("mode", ["fused", "none"])
def test_moving_one_fragment_is_the_inverse_view_of_moving_the_other(scene, mode):
    _, seen, struts, motion = scene
    compensation = compensate(seen, theoretical=struts, mode=mode)
    there = target_of(FragmentMotion("proximal", motion), compensation)
    back = target_of(FragmentMotion("distal", motion.inverse()), compensation)
    close(there, back)
    wrong = target_of(FragmentMotion("distal", motion), compensation)
    assert there.difference(wrong)[0] > 1.0


def test_a_lift_of_the_proximal_fragment_raises_the_proximal_ring():
    upright = RecognisedRings(
        Pose(np.eye(3), np.array([0.0, 0.0, 185.0])), Pose.identity(), np.eye(6), np.eye(6)
    )
    compensation = compensate(upright, theoretical=upright.mechanism)
    up = Pose(np.eye(3), np.array([0.0, 0.0, 5.0]))
    lifted = target_of(FragmentMotion("proximal", up), compensation)
    lowered = target_of(FragmentMotion("distal", up), compensation)
    np.testing.assert_allclose(lifted.position_mm, [0, 0, 190], atol=1e-9)
    np.testing.assert_allclose(lowered.position_mm, [0, 0, 180], atol=1e-9)


def test_fused_rings_agree_with_the_struts_exactly(scene):
    _, seen, struts, _ = scene
    compensation = compensate(seen, theoretical=struts)
    close(compensation.distal.inverse() @ compensation.proximal, struts, atol=1e-10)


def test_the_split_is_the_most_likely_one(scene):
    _, seen, struts, _ = scene
    weight_a = np.linalg.inv(seen.proximal_covariance)
    weight_b = np.linalg.inv(seen.distal_covariance)
    scale = SIGMA

    def unlikelihood(u):
        distal = seen.distal @ Pose.exp(u * scale)
        xi_a = (seen.proximal.inverse() @ distal @ struts).log()
        return xi_a @ weight_a @ xi_a + (u * scale) @ weight_b @ (u * scale)

    general = minimize(unlikelihood, np.zeros(6), method="BFGS", options={"gtol": 1e-9})
    fused = compensate(seen, theoretical=struts)
    ours = (seen.distal.inverse() @ fused.distal).log() / scale
    np.testing.assert_allclose(ours, general.x, atol=2e-3)  # in standard deviations
    assert unlikelihood(ours) <= general.fun * (1 + 1e-5)


def test_a_precise_ring_stays_where_it_was_seen(scene):
    _, seen, struts, _ = scene
    sharp = RecognisedRings(
        seen.proximal, seen.distal, seen.proximal_covariance, 1e-8 * seen.distal_covariance
    )
    compensation = compensate(sharp, theoretical=struts)
    close(compensation.distal, seen.distal, atol=1e-5)
    assert compensation.proximal.difference(seen.proximal)[0] > 0.01


def test_additive_is_the_papers_subtraction_of_pose_vectors(scene):
    _, seen, struts, motion = scene
    plan = FragmentMotion("proximal", motion)
    plain = target_of(plan, compensate(seen, theoretical=struts, mode="none"))
    additive = compensate(seen, theoretical=struts, mode="additive")
    target = target_of(plan, additive)
    error = np.concatenate(
        [
            seen.mechanism.position_mm - struts.position_mm,
            seen.mechanism.angles_rad - struts.angles_rad,
        ]
    )
    np.testing.assert_allclose(additive.pose_vector_difference, error, atol=1e-12)
    np.testing.assert_allclose(target.position_mm, plain.position_mm - error[:3], atol=1e-9)
    np.testing.assert_allclose(target.angles_rad, plain.angles_rad - error[3:], atol=1e-12)


def test_the_departure_of_the_subtraction_is_that_of_the_joints(scene, fixator):
    _, seen, struts, motion = scene
    goal = FragmentMotion("proximal", motion)
    additive = compensate(seen, theoretical=struts, mode="additive")
    # the planned mechanism with the recognition error taken out on the right, by plain matrices
    planned = np.linalg.inv(seen.distal.matrix) @ motion.matrix @ seen.proximal.matrix
    composed = planned @ np.linalg.inv(seen.mechanism.matrix) @ struts.matrix
    joints = np.c_[fixator.proximal.joints_mm, np.ones(6)].T
    apart = (composed - target_of(goal, additive).matrix) @ joints
    expected = np.linalg.norm(apart[:3], axis=0).max()
    assert expected > 0.01
    assert subtraction_departure_mm(goal, additive, fixator) == pytest.approx(expected)
    for other in (goal, TargetPose(struts)):
        fused = compensate(seen, theoretical=struts)
        assert subtraction_departure_mm(other, fused, fixator) == 0.0
    assert subtraction_departure_mm(TargetPose(struts), additive, fixator) == 0.0


def test_the_subtraction_departs_less_the_smaller_the_angles(fixator, random_pose):
    rng = np.random.default_rng(12)
    departures = []
    for deg in (0.5, 5.0, 25.0):
        rings = RecognisedRings(
            random_pose(rng) @ Pose.exp(SIGMA), Pose.identity(), np.eye(6), np.eye(6)
        )
        struts = rings.mechanism @ Pose.exp(-SIGMA)
        turn = np.radians([deg, -deg, deg])
        goal = FragmentMotion("proximal", Pose.from_xyz_fixed(position_mm=[0] * 3, angles_rad=turn))
        additive = compensate(rings, theoretical=struts, mode="additive")
        departures.append(subtraction_departure_mm(goal, additive, fixator))
    assert departures == sorted(departures)
    assert departures[0] < 0.1 < departures[-1]


def test_the_pose_vector_difference_does_not_jump_at_half_a_turn():
    def turned(deg):
        return Pose.from_xyz_fixed(
            position_mm=[0, 0, 185.0], angles_rad=np.radians([0.0, 0.0, deg])
        )

    seen = RecognisedRings(turned(179.9), Pose.identity(), np.eye(6), np.eye(6))
    difference = compensate(seen, theoretical=turned(-179.9), mode="additive")
    assert np.degrees(difference.pose_vector_difference[5]) == pytest.approx(-0.2)
    assert np.degrees(difference.difference_rad) == pytest.approx(0.2)


@pytest.mark.parametrize("mode", ["fused", "additive", "none"])
def test_a_target_pose_is_the_same_in_every_mode(scene, mode):
    _, seen, struts, motion = scene
    compensation = compensate(seen, theoretical=struts, mode=mode)
    assert target_of(TargetPose(motion), compensation) is motion
    assert compensation.start is struts


@pytest.mark.parametrize("moving", ["proximal", "distal"])
def test_the_motion_between_start_and_target_is_the_planned_one(scene, moving):
    _, seen, struts, motion = scene
    fused = compensate(seen, theoretical=struts)
    target = target_of(FragmentMotion(moving, motion), fused)
    again = motion_between(fused, target=target, moving=moving)
    assert again.moving == moving
    close(again.motion, motion, atol=1e-8)


def test_the_difference_between_recognition_and_struts_is_reported(scene):
    true, _, struts, _ = scene
    off = Pose.exp([1.0, 2.0, 2.0, 0.0, 0.0, 0.02])
    seen = RecognisedRings(
        true.proximal @ off, true.distal, true.proximal_covariance, true.distal_covariance
    )
    compensation = compensate(seen, theoretical=struts)
    assert compensation.difference_mm == pytest.approx(off.difference(Pose.identity())[0])
    assert compensation.difference_rad == pytest.approx(0.02)


def test_an_unknown_mode_is_an_input_error(scene):
    _, seen, struts, _ = scene
    with pytest.raises(InputError, match="fused, additive, none"):
        compensate(seen, theoretical=struts, mode="both")


def test_the_adjoint_carries_twists_between_frames(random_pose):
    rng = np.random.default_rng(8)
    frame, twist = random_pose(rng), rng.normal(size=6) * SIGMA
    close(frame @ Pose.exp(twist) @ frame.inverse(), Pose.exp(frame.adjoint @ twist), atol=1e-9)


def test_fused_leaves_less_than_additive_and_additive_less_than_nothing():
    for row in table(cases=60, seed=3):
        assert row["fused"]["mm"] < row["additive"]["mm"] < 0.4 * row["none"]["mm"]
        assert row["fused"]["deg"] < 0.9 * row["additive"]["deg"]
