"""Layouts for the accuracy tests."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hexafix.hardware import MarkerLayout


@pytest.fixture
def layout_at() -> Callable[..., MarkerLayout]:
    """Factory of layouts at given sweep angles; the paper's radius and height by default."""

    def make(sweep_deg, first_number=1, height_mm=20.0, radius_mm=100.0) -> MarkerLayout:
        count = len(sweep_deg)
        return MarkerLayout.of(
            radius_mm=np.broadcast_to(radius_mm, count),
            sweep_deg=sweep_deg,
            height_mm=np.broadcast_to(height_mm, count),
            first_number=first_number,
        )

    return make
