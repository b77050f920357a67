"""The layout check before any CT."""

from __future__ import annotations

from typing import Any

from hexafix.accuracy import check_layouts
from hexafix.hardware import MarkerLayout


def check_case_layout(proximal: MarkerLayout, distal: MarkerLayout) -> dict[str, Any]:
    """What ``hexafix check-layout`` prints, at the paper's image error of 0.3 mm an axis."""
    return {"schema_version": 1, **check_layouts(proximal, distal).as_json()}
