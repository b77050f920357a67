"""Short slices of `hexafix.benchmark.balls.accuracy`, the goals widened for few placements."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hexafix.benchmark.balls import SITUATIONS
from hexafix.markers import find_balls
from hexafix.phantom.local import render_ball

PLACEMENTS = 8


def errors_of(name):
    scene, goal = SITUATIONS[name]
    rng = np.random.default_rng(20)
    errors, stated, along = [], [], []
    for _ in range(PLACEMENTS):
        volume, truth = render_ball(scene, rng, half_width_mm=10.5)
        (ball,) = find_balls(volume, ball_diameter_mm=scene.ball_diameter_mm).balls
        errors.append(np.linalg.norm(ball.center_mm - truth.center_mm))
        stated.append(np.sqrt(np.trace(ball.covariance_mm2)))
        along.append((ball.center_mm - truth.center_mm) @ truth.rod_direction)
        eigenvalues = np.linalg.eigvalsh(ball.covariance_mm2)
        assert eigenvalues.min() > 0.0
    return np.array(errors), np.array(stated), np.array(along), goal


@pytest.mark.parametrize("name", list(SITUATIONS)[:4])
def test_centres_reach_the_goal_and_state_their_error(name):
    errors, stated, along, goal = errors_of(name)
    rms = np.sqrt(np.mean(errors**2))
    assert rms < 1.2 * goal
    assert abs(along.mean()) < 0.006 + 2.0 * along.std() / np.sqrt(PLACEMENTS)
    assert 0.45 < rms / np.sqrt(np.mean(stated**2)) < 1.8


def test_a_noisier_image_states_a_larger_error(crop_with_ball):
    stated = []
    for noise in (20.0, 120.0):
        volume, _ = crop_with_ball(3, noise_hu=noise)
        (ball,) = find_balls(volume, ball_diameter_mm=10.0).balls
        stated.append(float(np.trace(ball.covariance_mm2)))
    assert stated[1] > 4.0 * stated[0]


def test_streaks_state_a_larger_error(crop_with_ball):
    stated = {0.0: 0.0, 800.0: 0.0}
    for streak, seed in itertools.product(stated, range(4)):
        volume, _ = crop_with_ball(seed, streak_hu=streak)
        (ball,) = find_balls(volume, ball_diameter_mm=10.0).balls
        stated[streak] += float(np.trace(ball.covariance_mm2))
    assert stated[800.0] > 4.0 * stated[0.0]
