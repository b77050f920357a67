"""Every clinical scenario, numbered."""

from __future__ import annotations

from hexafix.scenarios import (
    corrections,
    limbs,
    markers,
    quality,
    refused_cases,
    refused_images,
    scanner,
)
from hexafix.scenarios.scenario import Scenario

CATALOGUE: tuple[Scenario, ...] = (
    *limbs.SCENARIOS,
    *scanner.SCENARIOS,
    *quality.SCENARIOS,
    *markers.SCENARIOS,
    *corrections.SCENARIOS,
    *refused_images.SCENARIOS,
    *refused_cases.SCENARIOS,
)
"""In the order of their numbers."""
