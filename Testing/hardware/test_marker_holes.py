"""A ring's holes are read strictly, and definitions without them stay as they were."""

import json

import numpy as np
import pytest
from hexafix.errors import HardwareDefinitionError
from hexafix.hardware import (
    HoleCircle,
    SiteList,
    fixator_from_document,
    places_from_document,
    shipped_fixator,
)
from hexafix.paths import resources


def faults_of(document) -> dict[str, str]:
    with pytest.raises(HardwareDefinitionError) as caught:
        places_from_document(document)
    return {str(fault.where): fault.code for fault in caught.value.faults}


def test_holes_are_counted_with_the_sweep_angle() -> None:
    holes = places_from_document(
        {"count": 8, "radius_mm": 90, "offset_deg": 10, "heights_mm": [45, 20], "occupied": [2]}
    )
    assert isinstance(holes, HoleCircle)
    assert np.degrees(holes.sweep_rad) == pytest.approx(10.0 + 45.0 * np.arange(8))
    assert holes.free.tolist() == [True, False] + [True] * 6
    assert holes.heights_mm == (20.0, 45.0)


def test_only_count_and_radius_are_needed() -> None:
    assert places_from_document({"count": 36, "radius_mm": 100.0}) == HoleCircle(36, 100.0)


def test_sites_are_numbered_in_their_order() -> None:
    sites = places_from_document(
        {"sites": [{"radius_mm": 90 + k, "sweep_deg": 60 * k, "height_mm": 20} for k in range(4)]}
    )
    assert isinstance(sites, SiteList)
    assert [site.number for site in sites.sites] == [1, 2, 3, 4]
    assert sites.sites[2].sweep_rad == pytest.approx(np.radians(120.0))


def test_all_faults_of_holes_are_named_at_once() -> None:
    assert faults_of({"count": 36.5, "radius_mm": "100", "occupied": 3, "colour": "red"}) == {
        "holes.count": "wrong-type",
        "holes.radius_mm": "not-a-number",
        "holes.occupied": "wrong-type",
        "holes.colour": "unknown-key",
    }
    assert faults_of({}) == {"holes.count": "missing-key", "holes.radius_mm": "missing-key"}
    wrong = {"count": 2, "radius_mm": -1.0, "occupied": [0, 40], "heights_mm": []}
    assert faults_of(wrong) == {
        "holes.count": "out-of-range",
        "holes.radius_mm": "out-of-range",
        "holes.occupied": "out-of-range",
        "holes.heights_mm": "out-of-range",
    }
    assert faults_of([]) == {"holes": "wrong-type"}
    sites = [{"radius_mm": 90, "sweep_deg": 0, "height_mm": 20}] * 2
    assert faults_of({"sites": sites}) == {"holes.sites": "wrong-shape"}
    sites = [*sites, {"radius_mm": 0, "sweep_deg": float("nan"), "size": 1}]
    assert faults_of({"sites": sites}) == {
        "holes.sites[2].radius_mm": "out-of-range",
        "holes.sites[2].sweep_deg": "not-a-number",
        "holes.sites[2].height_mm": "missing-key",
        "holes.sites[2].size": "unknown-key",
    }


def test_a_text_in_place_of_a_number_is_not_quoted() -> None:
    with pytest.raises(HardwareDefinitionError) as caught:
        places_from_document({"count": 36, "radius_mm": "Erika"})
    assert "Erika" not in str(caught.value)


def test_a_definition_may_carry_the_holes_of_its_rings() -> None:
    path = resources() / "Hardware" / "Frames" / "generic-6sps-160.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    without = fixator_from_document(document)
    assert without.proximal.holes == shipped_fixator().proximal.holes
    document["distal"]["holes"] = {"count": 24, "radius_mm": 98.0}
    assert fixator_from_document(document).distal.holes == HoleCircle(24, 98.0)
    document["distal"]["holes"]["count"] = 1
    with pytest.raises(HardwareDefinitionError) as caught:
        fixator_from_document(document, where="fixator")
    assert [fault.where for fault in caught.value.faults] == ["fixator.distal.holes.count"]
