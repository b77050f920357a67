"""Layouts, poses and images of rings for the recognition tests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout


@pytest.fixture
def an_oblique_pose() -> Pose:
    return Pose.from_xyz_fixed(
        position_mm=[-31.0, 212.5, -418.0], angles_rad=np.radians([17.0, -28.0, 133.0])
    )


@pytest.fixture
def an_unequal_layout() -> MarkerLayout:
    """Four markers of different radii and heights, one far out of plane."""
    return MarkerLayout.of(
        radius_mm=[96.0, 104.0, 88.0, 110.0],
        sweep_deg=[5.0, 98.0, 201.0, 290.0],
        height_mm=[20.0, 26.0, 14.0, 45.0],
    )


@pytest.fixture
def a_proximal_layout() -> MarkerLayout:
    return MarkerLayout.of(radius_mm=[100.0] * 3, sweep_deg=[0, 105, 225], height_mm=[20.0] * 3)


@pytest.fixture
def a_distal_layout() -> MarkerLayout:
    return MarkerLayout.of(
        radius_mm=[100.0] * 3, sweep_deg=[15, 105, 230], height_mm=[-30.0] * 3, first_number=4
    )


@pytest.fixture
def image_of_rings(
    an_oblique_pose: Pose,
) -> Callable[..., tuple[np.ndarray, np.ndarray, Pose, Pose]]:
    """Factory of shuffled balls of two rings in an oblique image.

    Returns the centres (M, 3), the place of each true ball (proximal, distal, extra) among them
    and the two ring poses.
    """

    def make(
        proximal: MarkerLayout,
        distal: MarkerLayout,
        *,
        seed: int,
        extra: int = 0,
        noise_mm: float = 0.05,
    ) -> tuple[np.ndarray, np.ndarray, Pose, Pose]:
        rng = np.random.default_rng(seed)
        mechanism = Pose.from_xyz_fixed(
            position_mm=[6.0, -9.0, 176.0], angles_rad=np.radians([6.0, -9.0, 14.0])
        )
        pose_b = an_oblique_pose
        pose_a = pose_b @ mechanism
        balls = np.vstack([pose_a.apply(proximal.points_mm), pose_b.apply(distal.points_mm)])
        balls = balls + noise_mm * rng.normal(size=balls.shape)
        decoys = balls.mean(axis=0) + rng.uniform(-140.0, 140.0, (extra, 3))
        everything = np.vstack([balls, decoys])
        shuffled = rng.permutation(len(everything))
        return everything[shuffled], np.argsort(shuffled), pose_a, pose_b

    return make
