"""Rings, their holes and their layouts: what can be said before there is a CT."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexafix.case import checks
from hexafix.case.read import file_of_case, layout_of, load_case, load_layouts, schema_faults
from hexafix.case.schema import RingFile
from hexafix.errors import InputError
from hexafix.hardware import (
    Fixator,
    MarkerLayout,
    Places,
    fixator_from_document,
    places_from_document,
)
from hexafix.strict_json import read_json_object

SIDES = ("proximal", "distal")


@dataclass(frozen=True, eq=False)
class Rings:
    """One ring, or both.

    Attributes
    ----------
    names : tuple of str
        ``("proximal", "distal")``, or ``("ring",)``.
    layouts : tuple of MarkerLayout or None
        What each ring carries now.
    places : tuple of HoleCircle, SiteList or None
        Where each can carry markers, as far as known.
    fixator : Fixator or None
    ball_diameter_mm : float or None
    """

    names: tuple[str, ...]
    layouts: tuple[MarkerLayout | None, ...]
    places: tuple[Places | None, ...]
    fixator: Fixator | None = None
    ball_diameter_mm: float | None = None


def load_rings(path: Path) -> Rings:
    """Read a case, a layout file, a hardware definition or a ring file.

    Raises
    ------
    InputError
        With every fault found.
    """
    path = file_of_case(path)
    raw, content = read_json_object(path, what="ring, layout or case file")
    if "case_id" in content or "limb" in content:
        case = load_case(path, needs_image=False, plannable=False)
        rings = (case.fixator.proximal, case.fixator.distal)
        return Rings(
            SIDES,
            (case.proximal, case.distal),
            tuple(ring.holes for ring in rings),
            case.fixator,
            case.ball_diameter_mm,
        )
    if "strut" in content:
        fixator = fixator_from_document(content)
        rings = (fixator.proximal, fixator.distal)
        return Rings(SIDES, (None, None), tuple(ring.holes for ring in rings), fixator)
    if "holes" in content and "proximal" not in content:
        return _ring(raw, content)
    layouts = load_layouts(path)
    holes = content.get("holes") or {}
    places = tuple(_places(holes.get(side), f"holes.{side}") for side in SIDES)
    return Rings(SIDES, layouts, places, None, content.get("ball_diameter_mm"))


def _ring(raw: bytes, content: dict[str, Any]) -> Rings:
    """A single ring."""
    faults, broken = schema_faults(RingFile, raw)
    if "markers" not in broken and content.get("markers"):
        faults += checks.marker_faults({"markers": content["markers"]}, where="")
    if faults:
        raise InputError(*faults)
    model = RingFile.model_validate_json(raw)
    layout = layout_of(model.markers) if model.markers else None
    places = _places(model.holes, "holes")
    return Rings(("ring",), (layout,), (places,), None, model.ball_diameter_mm)


def _places(document: Any, where: str) -> Places | None:
    return None if document is None else places_from_document(document, where=where)
