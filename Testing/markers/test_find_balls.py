from __future__ import annotations

import numpy as np
from hexafix.markers import find_balls


def test_a_ball_with_its_rod_is_found_and_nothing_else(crop_with_ball):
    for seed in range(5):
        volume, truth = crop_with_ball(seed)
        found = find_balls(volume, ball_diameter_mm=10.0)
        assert len(found.balls) == 1
        assert np.linalg.norm(found.balls[0].center_mm - truth.center_mm) < 0.02
        assert abs(found.balls[0].diameter_mm - 10.0) < 0.03
