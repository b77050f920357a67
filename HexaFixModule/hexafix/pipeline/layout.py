"""The layout check and the layout advisor, before any CT."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, cast

import numpy as np

from hexafix.accuracy import (
    Advice,
    AdviceRules,
    ErrorTarget,
    RingPlaces,
    RingTask,
    advise,
    check_layouts,
)
from hexafix.accuracy.advised import SPACING_MM
from hexafix.accuracy.layout_check import UNIQUENESS_TARGET_MM
from hexafix.case import Rings
from hexafix.errors import InputError
from hexafix.hardware import HoleCircle, MarkerLayout, Places
from hexafix.hardware.holes import ROD_HEIGHTS_MM

HOLES, RADIUS_MM = 36, 100.0
"""Hole circle where none is known: one hole every 10°."""

MARKER_COUNT = 4
"""Markers a ring where no present layout says otherwise: with three no mirror can be seen."""

FARTHEST_BALLS = 2.0
"""Smallest distance of two balls in ball diameters, so that no image joins them."""


@dataclass(frozen=True, eq=False)
class HoleOptions:
    """What the command line says about the holes; None: as the file says, or the default.

    Attributes
    ----------
    count : int or None
    radius_mm : float or None
    offset_rad : float or None
    heights_mm : tuple of float or None
    occupied : mapping of str to tuple of int
        Occupied holes of each ring by its name.
    """

    count: int | None = None
    radius_mm: float | None = None
    offset_rad: float | None = None
    heights_mm: tuple[float, ...] | None = None
    occupied: Mapping[str, tuple[int, ...]] = field(default_factory=dict)

    @classmethod
    def in_degrees(cls, *, offset_deg: float | None, **others: Any) -> HoleOptions:
        """As given at a door."""
        return cls(offset_rad=None if offset_deg is None else math.radians(offset_deg), **others)


def check_case_layout(
    proximal: MarkerLayout, distal: MarkerLayout, *, rings: Rings | None = None
) -> dict[str, Any]:
    """What ``hexafix check-layout`` prints, at the paper's image error of 0.3 mm an axis.

    Parameters
    ----------
    proximal, distal : MarkerLayout
    rings : Rings, optional
        With the places of the rings, where they are known: then only those are advised.
    """
    known: list[RingPlaces | None] = [None, None]
    if rings is not None:
        for k, places in enumerate(rings.places):
            if places is not None:
                known[k] = RingPlaces(places, _target(rings, k, places))
    check = check_layouts(proximal, distal, places=(known[0], known[1]))
    return {"schema_version": 1, **check.as_json()}


def advise_layouts(
    rings: Rings,
    *,
    count: int | None = None,
    holes: HoleOptions | None = None,
    only: Literal["proximal", "distal"] | None = None,
    top: int = 5,
    relaxed: bool = False,
    margin_mm: float | None = None,
) -> Advice:
    """The best layouts of the rings' free holes: what ``hexafix advise`` says.

    Parameters
    ----------
    rings : Rings
    count : int, optional
        Markers a ring; without, as many as the ring has, else `MARKER_COUNT`.
    holes : HoleOptions, optional
    only : str, optional
        Advise this ring alone; the other keeps its layout.
    top : int
    relaxed : bool
    margin_mm : float, optional
        Without, `UNIQUENESS_TARGET_MM`.

    Raises
    ------
    InputError
        If the options contradict what the file says.
    LayoutRejected
        If the holes allow no layout.
    """
    holes = holes or HoleOptions()
    tasks = [
        _task(rings, k, count, _places(rings, k, holes))
        for k, name in enumerate(rings.names)
        if only in (None, name)
    ]
    if not tasks:
        raise InputError.of(
            "no-such-ring", "the file has no such ring", value=only, limit=", ".join(rings.names)
        )
    other = None
    if only is not None:
        other = rings.layouts[1 - rings.names.index(only)]
    ball = rings.ball_diameter_mm
    rules = AdviceRules(
        relaxed=relaxed,
        margin_mm=UNIQUENESS_TARGET_MM if margin_mm is None else margin_mm,
        spacing_mm=SPACING_MM if ball is None else FARTHEST_BALLS * ball,
    )
    return advise(_numbered(tasks), rules=rules, top=top, other=other)


def advice_document(advice: Advice) -> dict[str, Any]:
    """The advice as the JSON document of ``hexafix advise``."""
    document = {"schema_version": 1, **advice.as_json()}
    for report in advice.rings:
        places = report.task.places
        ring: dict[str, Any] = document["rings"][report.task.name]
        if isinstance(places, HoleCircle):
            ring["holes"] = {
                "count": places.count,
                "radius_mm": places.radius_mm,
                "offset_deg": round(float(np.degrees(places.offset_rad)), 9),
                "heights_mm": list(places.heights_mm),
                "occupied": list(places.occupied),
            }
        else:
            ring["holes"] = {
                "sites": [
                    {
                        "radius_mm": site.radius_mm,
                        "sweep_deg": round(float(np.degrees(site.sweep_rad)), 9),
                        "height_mm": site.height_mm,
                    }
                    for site in places.sites
                ]
            }
    return document


def _task(rings: Rings, k: int, count: int | None, places: Places) -> RingTask:
    layout = rings.layouts[k]
    if count is None:
        count = MARKER_COUNT if layout is None else len(layout)
    return RingTask(rings.names[k], places, count, _target(rings, k, places), layout)


def _numbered(tasks: Sequence[RingTask]) -> list[RingTask]:
    """First numbers: from 1 on, or those of a ring that stays out of it."""
    first, result = 1, []
    for task in tasks:
        start = first if task.present is None else min(task.present.numbers)
        start = max(start, first)
        result.append(
            RingTask(task.name, task.places, task.count, task.target, task.present, start)
        )
        first = start + task.count
    return result


def _places(rings: Rings, k: int, options: HoleOptions) -> Places:
    """The holes of a ring as the file says, changed by the options, else the defaults."""
    known, layout = rings.places[k], rings.layouts[k]
    occupied = options.occupied.get(rings.names[k])
    given = (options.count, options.radius_mm, options.offset_rad, options.heights_mm, occupied)
    if known is not None and not isinstance(known, HoleCircle):
        if any(value is not None for value in given):
            raise InputError.of(
                "holes-are-listed",
                "the file lists single sites; options for a hole circle do not apply",
                where=f"holes.{rings.names[k]}",
                next_step="leave the options out or give the file a hole circle",
            )
        return known
    if known is None:
        known = HoleCircle(HOLES, _usual_radius(layout), heights_mm=_usual_heights(layout))
    count, radius, offset, heights, taken = (
        there if said is None else said
        for said, there in zip(
            given,
            (known.count, known.radius_mm, known.offset_rad, known.heights_mm, known.occupied),
            strict=True,
        )
    )
    return HoleCircle(
        cast(int, count), cast(float, radius), cast(float, offset),
        cast(tuple[float, ...], heights), cast(tuple[int, ...], taken),
    )  # fmt: skip


def _usual_radius(layout: MarkerLayout | None) -> float:
    """The radius of the present markers, else the default."""
    if layout is None:
        return RADIUS_MM
    return float(np.median([site.radius_mm for site in layout.sites]))


def _usual_heights(layout: MarkerLayout | None) -> tuple[float, ...]:
    """The heights in use; a single one and one above it by as much as the default rods differ."""
    if layout is None:
        return ROD_HEIGHTS_MM
    heights = sorted({site.height_mm for site in layout.sites})
    if len(heights) == 1:
        return (heights[0], heights[0] + ROD_HEIGHTS_MM[1] - ROD_HEIGHTS_MM[0])
    return tuple(heights)


def _target(rings: Rings, k: int, places: Places) -> ErrorTarget:
    """Where the error counts: by the hardware, else on the holes' own circle."""
    side: Literal["proximal", "distal"] = "distal" if rings.names[k] == "distal" else "proximal"
    if rings.fixator is not None:
        ring = rings.fixator.distal if side == "distal" else rings.fixator.proximal
        return ErrorTarget.of_ring(ring, rings.fixator.strut, side)
    if isinstance(places, HoleCircle):
        return ErrorTarget.of_radius(places.radius_mm, side)
    return ErrorTarget.of_radius(float(np.mean([s.radius_mm for s in places.sites])), side)
