"""What counts as clipped: the scanner's ceiling, never the brightest voxel of the noise."""

import numpy as np
import pytest
from hexafix.markers.crop import Crop
from hexafix.phantom.local import Scene, render_ball

COARSE = {"spacing_mm": (1.15, 1.1, 1.45), "noise_hu": 25.0}
"""Few voxels in the core: one of them is a share that would count."""


def clipped_share(scene: Scene, seed: int) -> float:
    volume, truth = render_ball(scene, np.random.default_rng(seed))
    return Crop.around(volume, truth.center_mm, 9.0).core(truth.center_mm, 3.0)[2]


def test_noise_alone_clips_no_ball():
    shares = [clipped_share(Scene(**COARSE), seed) for seed in range(24)]
    assert shares == [0.0] * 24


@pytest.mark.parametrize("seed", range(3))
def test_a_ball_denser_than_the_scale_is_clipped_through(seed):
    assert clipped_share(Scene(**COARSE, ball_hu=8000.0), seed) == 1.0
