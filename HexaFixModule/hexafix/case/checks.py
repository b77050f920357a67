"""Checks between the parts of a case file; each returns its faults with their JSON paths."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from hexafix.correction.targets import Deformity
from hexafix.errors import Fault, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Fixator


def marker_faults(markers: dict[str, Any], where: str = "markers") -> Iterator[Fault]:
    """Numbers used twice; a single ring has its list at ``markers``."""
    prefix = f"{where}." if where else ""
    seen: dict[int, str] = {}
    for ring in ("proximal", "distal", "markers"):
        for place, marker in enumerate(markers.get(ring, ())):
            path = f"{prefix}{ring}[{place}].number"
            if marker["number"] in seen:
                yield Fault(
                    "marker-number-twice",
                    f"the marker number stands at {seen[marker['number']]} too",
                    value=str(marker["number"]),
                    limit="each number once over both rings",
                    where=path,
                    hazard="H19",
                    next_step="number the proximal ring 1..N and the distal ring N+1..2N",
                )
            seen.setdefault(marker["number"], path)


def numbering_faults(numbering: dict[str, list[float]], markers: dict[str, Any]) -> Iterator[Fault]:
    """Numbers assigned by the user that no marker has, and markers left without a ball."""
    known = {str(m["number"]) for ring in ("proximal", "distal") for m in markers[ring]}
    for number in sorted(set(numbering) - known, key=int):
        yield Fault(
            "unknown-number",
            "no marker of the layout has this number",
            value=number,
            where=f"numbering.{number}",
            hazard="H19",
            next_step="remove it or correct the layout",
        )
    for number in sorted(known - set(numbering), key=int):
        yield Fault(
            "number-missing",
            "this marker has no ball assigned",
            value=number,
            limit="every marker, or numbering null for automatic",
            where="numbering",
            hazard="H19",
            next_step=f"add the centre of ball {number}",
        )


def reading_faults(readings_mm: list[float], fixator: Fixator) -> Iterator[Fault]:
    """Readings outside the strut's stroke (wrong unit, wrong offset, typing error)."""
    low = fixator.strut.min_mm - fixator.strut.scale_offset_mm
    high = fixator.strut.max_mm - fixator.strut.scale_offset_mm
    for place, reading in enumerate(readings_mm):
        if not low <= reading <= high:
            yield Fault(
                "strut-reading-out-of-range",
                f"the reading of strut {place + 1} is outside the strut's scale",
                value=f"{reading:g} mm",
                limit=f"{low:g} to {high:g} mm for {fixator.id}",
                where=f"strut_readings_mm[{place}]",
                hazard="H26",
                next_step="read the strut again, in millimetres",
            )


def correction_faults(correction: dict[str, Any]) -> Iterator[Fault]:
    """What the kinds of correction need beyond their schema."""
    kind = correction["kind"]
    if kind == "fragment-motion":
        try:
            Pose.from_matrix(correction["matrix_lps"])
        except InputError as error:
            for fault in error.faults:
                yield Fault(
                    fault.code,
                    fault.what,
                    value=fault.value,
                    limit=fault.limit,
                    next_step=fault.next_step,
                    hazard=fault.hazard,
                    where="correction.matrix_lps",
                )
    elif kind == "landmarks":
        pairs = len(correction["moving_points_lps_mm"]), len(correction["fixed_points_lps_mm"])
        if pairs[0] != pairs[1]:
            yield Fault(
                "landmark-count",
                "moving and fixed landmarks must come in pairs",
                value=f"{pairs[0]} moving, {pairs[1]} fixed",
                where="correction.fixed_points_lps_mm",
                next_step="give one fixed point for each moving point",
            )
    elif kind == "deformity":
        yield from deformity_faults(correction)


def deformity_of(correction: dict[str, Any]) -> Deformity:
    """The deformity of the case file's keys; the moving fragment is distal if not said.

    Raises
    ------
    InputError
        For every amount that is not plausible or lacks its direction in words.
    """
    given = {key: value for key, value in correction.items() if key != "kind"}
    return Deformity(**{"moving": "distal", **given})


def deformity_faults(correction: dict[str, Any]) -> Iterator[Fault]:
    """Amounts without their direction in words, and amounts that are not plausible."""
    try:
        deformity_of(correction)
    except InputError as error:
        yield from error.faults
