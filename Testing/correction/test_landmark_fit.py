import numpy as np
import pytest
from hexafix.correction import FragmentMotion, Landmarks, TargetPose, fit_landmarks, planned_motion
from hexafix.errors import InputError, Refused
from hexafix.geometry import Pose
from scipy.spatial.transform import Rotation

POINTS = np.array([[0, 0, 0], [40, 0, 5], [0, 35, -5], [10, 10, 60.0]])
MOTION = Pose.from_xyz_fixed(
    position_mm=[12.0, -30.0, 44.0], angles_rad=np.radians([10.0, -25.0, 130.0])
)


def test_exact_pairs_give_back_the_motion():
    fit = fit_landmarks(Landmarks("distal", POINTS, MOTION.apply(POINTS)))
    assert fit.motion.moving == "distal"
    np.testing.assert_allclose(fit.motion.motion.matrix, MOTION.matrix, atol=1e-9)
    assert fit.rms_mm < 1e-9


def test_three_pairs_are_enough():
    fit = fit_landmarks(Landmarks("proximal", POINTS[:3], MOTION.apply(POINTS[:3])))
    np.testing.assert_allclose(fit.motion.motion.matrix, MOTION.matrix, atol=1e-9)


def test_noisy_pairs_are_fitted_like_another_library_does():
    rng = np.random.default_rng(1)
    fixed = MOTION.apply(POINTS) + rng.normal(0, 0.8, POINTS.shape)
    fit = fit_landmarks(Landmarks("distal", POINTS, fixed))
    other, rssd = Rotation.align_vectors(fixed - fixed.mean(axis=0), POINTS - POINTS.mean(axis=0))
    np.testing.assert_allclose(fit.motion.motion.rotation, other.as_matrix(), atol=1e-9)
    assert fit.rms_mm == pytest.approx(rssd / 2.0, abs=1e-9)
    assert fit.residuals_mm.shape == (4,)


@pytest.mark.parametrize("side", ["moving", "fixed"])
def test_points_in_one_line_are_refused(side):
    line = np.outer([0.0, 20.0, 50.0, 80.0], [1.0, 2.0, 2.0])
    line[0, 1] += 1.0
    pair = (line, POINTS) if side == "moving" else (POINTS, line)
    with pytest.raises(InputError) as caught:
        fit_landmarks(Landmarks("distal", *pair))
    fault = caught.value.faults[0]
    assert fault.code == "landmarks-collinear"
    assert fault.where == f"correction.{side}_points_lps_mm"


def test_mirrored_landmarks_are_refused():
    mirrored = MOTION.apply(POINTS * [-1.0, 1.0, 1.0])
    with pytest.raises(Refused) as caught:
        fit_landmarks(Landmarks("distal", POINTS, mirrored))
    assert caught.value.faults[0].code == "landmarks-mirrored"
    assert caught.value.faults[0].hazard == "H01"


def test_pairs_in_a_wrong_order_are_refused():
    with pytest.raises(Refused) as caught:
        fit_landmarks(Landmarks("distal", POINTS[:3], MOTION.apply(POINTS[[1, 3, 0]])))
    assert caught.value.faults[0].code == "landmarks-disagree"


@pytest.mark.parametrize(
    ("moving", "fixed"),
    [
        (POINTS[:2], POINTS[:2]),
        (POINTS, POINTS[:3]),
        (POINTS[:, :2], POINTS[:, :2]),
        (POINTS, np.where(POINTS == 60.0, np.nan, POINTS)),
    ],
    ids=["two pairs", "unequal", "flat", "nan"],
)
def test_pairs_that_are_no_pairs_are_input_errors(moving, fixed):
    with pytest.raises(InputError) as caught:
        Landmarks("distal", moving, fixed)
    assert caught.value.faults[0].code == "landmark-pairs"


def test_landmarks_are_planned_as_their_fit():
    planned = planned_motion(Landmarks("distal", POINTS, MOTION.apply(POINTS)), side="left")
    assert isinstance(planned, FragmentMotion)
    np.testing.assert_allclose(planned.motion.matrix, MOTION.matrix, atol=1e-9)


def test_a_motion_and_a_target_are_planned_as_they_are():
    motion, target = FragmentMotion("distal", MOTION), TargetPose(MOTION)
    assert planned_motion(motion, side="left") is motion
    assert planned_motion(target, side="left") is target
    assert target.moving == "proximal"
