from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hexafix.imaging.volume import Volume
from hexafix.phantom.local import LocalTruth, Scene, render_ball


@pytest.fixture
def crop_with_ball() -> Callable[..., tuple[Volume, LocalTruth]]:
    """A rendered ball in a random oblique grid: `crop_with_ball(seed, **scene)`."""

    def make(seed: int, half_width_mm: float = 12.0, **scene) -> tuple[Volume, LocalTruth]:
        generator = np.random.default_rng(seed)
        return render_ball(Scene(**scene), generator, half_width_mm=half_width_mm)

    return make
