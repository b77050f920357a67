import numpy as np
import pytest
from hexafix.correction import (
    RecognisedRings,
    compensate,
    reading_covariance,
    reading_resolution_mm,
)
from hexafix.geometry import Pose
from hexafix.kinematics import forward_kinematics, strut_lengths

SIGMA = np.array([0.06, 0.06, 0.05, 5e-4, 5e-4, 4e-4])
"""A ring's pose error as a fine CT gives it, mm and radians."""


def a_case(rng, random_pose, fixator, step):
    """True mechanism, recognised rings and the struts' pose from rounded readings."""
    true, base = random_pose(rng), random_pose(rng)
    noise = rng.normal(size=(2, 6)) * SIGMA
    covariance = np.diag(SIGMA**2)
    rings = RecognisedRings(
        base @ true @ Pose.exp(noise[0]), base @ Pose.exp(noise[1]), covariance, covariance
    )
    readings = np.round(strut_lengths(true, fixator) / step) * step
    struts = forward_kinematics(readings, fixator, start=true).pose
    return true, rings, struts


def test_readings_as_fine_as_exact_give_the_papers_case(fixator, random_pose):
    rng = np.random.default_rng(3)
    _, rings, struts = a_case(rng, random_pose, fixator, 0.5)
    fine = reading_covariance(struts, fixator, resolution_mm=1e-6)
    weighed = compensate(rings, theoretical=struts, theoretical_covariance=fine)
    exact = compensate(rings, theoretical=struts)
    assert weighed.proximal.difference(exact.proximal)[0] < 1e-6
    assert weighed.distal.difference(exact.distal)[0] < 1e-6


@pytest.mark.parametrize("step", [0.5, 1.0])
def test_coarse_readings_weighed_beat_readings_believed_and_readings_ignored(
    fixator, random_pose, step
):
    rng = np.random.default_rng(4)
    errors = []
    for _ in range(60):
        true, rings, struts = a_case(rng, random_pose, fixator, step)
        covariance = reading_covariance(struts, fixator, resolution_mm=step)
        modes = [
            compensate(rings, theoretical=struts, theoretical_covariance=covariance),
            compensate(rings, theoretical=struts),
            compensate(rings, theoretical=struts, mode="none"),
        ]
        errors.append([(c.distal.inverse() @ c.proximal).difference(true)[0] for c in modes])
    weighed, believed, ignored = np.sqrt(np.mean(np.square(errors), axis=0))
    assert weighed < 0.95 * min(believed, ignored)


def test_the_covariance_is_that_of_rounded_readings(fixator, random_pose):
    rng = np.random.default_rng(5)
    true = random_pose(rng)
    lengths = strut_lengths(true, fixator)
    drawn = [
        (
            true.inverse()
            @ forward_kinematics(lengths + rng.uniform(-0.25, 0.25, 6), fixator, start=true).pose
        ).log()
        for _ in range(1500)
    ]
    stated = reading_covariance(true, fixator, resolution_mm=0.5)
    ratio = np.std(drawn, axis=0) / np.sqrt(np.diag(stated))
    assert np.all(np.abs(ratio - 1.0) < 0.1)


@pytest.mark.parametrize(
    ("readings", "step", "resolution"),
    [
        ([190.0, 191.5, 180.0, 175.5, 160.0, 181.0], 0.5, 0.5),
        ([190.0, 191.0, 180.0, 175.0, 160.0, 181.0], 0.5, 0.5),
        ([190.2, 191.0, 180.0, 175.0, 160.0, 181.0], 0.5, 0.1),
        ([190.23, 191.0, 180.0, 175.0, 160.0, 181.0], 0.5, 0.01),
        ([190.23456, 191.0, 180.0, 175.0, 160.0, 181.0], 0.5, 0.001),
        ([190.0, 191.0, 180.0, 175.0, 160.0, 181.0], 1.0, 1.0),
        ([190.5, 191.0, 180.0, 175.0, 160.0, 181.0], 1.0, 0.5),
    ],
)
def test_the_resolution_is_the_step_or_the_decimals_written(readings, step, resolution):
    assert reading_resolution_mm(readings, step_mm=step) == pytest.approx(resolution)
