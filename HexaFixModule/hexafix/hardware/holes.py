"""Where marker rods can be put: a ring's hole circle, or a list of sites."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, HardwareDefinitionError
from hexafix.hardware.layout import MarkerSite

MAX_HOLES = 144
"""Most holes of a circle, and most sites of a list."""

ROD_HEIGHTS_MM = (20.0, 45.0)
"""Heights of the balls where none are said: one plane, and one 25 mm above it (H01)."""

_CIRCLE = ("count", "radius_mm", "offset_deg", "heights_mm", "occupied")
_SITE = ("radius_mm", "sweep_deg", "height_mm")


@dataclass(frozen=True, slots=True)
class HoleCircle:
    """Evenly spaced holes of a ring.

    Attributes
    ----------
    count : int
        Number of holes, hole 1 first, then with rising sweep angle.
    radius_mm : float
        Distance of the balls from the ring's z axis.
    offset_rad : float
        Sweep angle of hole 1.
    heights_mm : tuple of float
        Heights h at which a ball can stand above any hole, each once, rising.
    occupied : tuple of int
        Numbers of the holes that something else fills.
    """

    count: int
    radius_mm: float
    offset_rad: float = 0.0
    heights_mm: tuple[float, ...] = ROD_HEIGHTS_MM
    occupied: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        faults = _circle_faults(self)
        if faults:
            raise HardwareDefinitionError(*faults)
        object.__setattr__(self, "heights_mm", tuple(sorted({float(h) for h in self.heights_mm})))
        object.__setattr__(self, "occupied", tuple(sorted(set(self.occupied))))

    @property
    def sweep_rad(self) -> NDArray[np.float64]:
        """Sweep angles of the holes, shape (count,), from `offset_rad` up."""
        return self.offset_rad + np.arange(self.count, dtype=float) * (2 * np.pi / self.count)

    @property
    def free(self) -> NDArray[np.bool_]:
        """Which holes are free, shape (count,)."""
        free = np.ones(self.count, bool)
        free[[number - 1 for number in self.occupied]] = False
        return free


@dataclass(frozen=True, slots=True)
class SiteList:
    """Single places for balls, of any radius, angle and height.

    Attributes
    ----------
    sites : tuple of MarkerSite
        Numbered from 1 in the order of the list.
    """

    sites: tuple[MarkerSite, ...]


Places = HoleCircle | SiteList


def places_from_document(document: Any, *, where: str = "holes") -> Places:
    """The places of a parsed ``holes`` object.

    Parameters
    ----------
    document : object
        ``{"count": 36, "radius_mm": 100.0}``, optionally with ``offset_deg``, ``heights_mm`` and
        ``occupied``, or ``{"sites": [{"radius_mm": …, "sweep_deg": …, "height_mm": …}, …]}``.
    where : str
        JSON path, for the faults.

    Raises
    ------
    HardwareDefinitionError
        With every fault found.
    """
    faults: list[Fault] = []
    is_list = isinstance(document, Mapping) and "sites" in document
    entries = _entries(
        document, ("sites",) if is_list else _CIRCLE, ("sites",) if is_list else _CIRCLE[:2],
        where, faults,
    )  # fmt: skip
    places = (_sites if is_list else _circle)(entries, where, faults)
    if faults or places is None:
        raise HardwareDefinitionError(*faults)
    return places


def _circle(entries: Mapping[str, Any], where: str, faults: list[Fault]) -> HoleCircle | None:
    """The circle whose required keys are there."""
    lists: dict[str, list] = {"heights_mm": [], "occupied": []}
    for key in lists.keys() & entries.keys():
        if isinstance(entries[key], list):
            lists[key] = entries[key]
        else:
            faults.append(_fault("wrong-type", "a list is needed", f"{where}.{key}"))
    numbers = [(key, entries[key]) for key in _CIRCLE[1:3] if key in entries]
    for key, value in [*numbers, *(("heights_mm", height) for height in lists["heights_mm"])]:
        if not _is_number(value):
            faults.append(_fault("not-a-number", "a number is needed", f"{where}.{key}", value))
    whole = [(key, entries[key]) for key in _CIRCLE[:1] if key in entries]
    for key, value in [*whole, *(("occupied", number) for number in lists["occupied"])]:
        if not isinstance(value, int) or isinstance(value, bool):
            faults.append(_fault("wrong-type", "a whole number is needed", f"{where}.{key}", value))
    if faults:
        return None
    try:
        return HoleCircle(
            entries["count"],
            float(entries["radius_mm"]),
            math.radians(entries.get("offset_deg", 0.0)),
            tuple(map(float, entries.get("heights_mm", ROD_HEIGHTS_MM))),
            tuple(entries.get("occupied", ())),
        )
    except HardwareDefinitionError as error:
        faults += [
            _fault(f.code, f.what, f"{where}.{f.where}", f.value, f.limit) for f in error.faults
        ]
        return None


def _circle_faults(circle: HoleCircle) -> list[Fault]:
    """What cannot be a hole circle; places without the JSON path before them."""
    faults = []
    if not 3 <= circle.count <= MAX_HOLES:
        faults.append(_fault("out-of-range", "number of holes", "count", circle.count,
                             f"3 to {MAX_HOLES}"))  # fmt: skip
    if not (math.isfinite(circle.radius_mm) and 0.0 < circle.radius_mm <= 5000.0):
        faults.append(_fault("out-of-range", "radius", "radius_mm", circle.radius_mm,
                             "above 0, at most 5000 mm"))  # fmt: skip
    if not math.isfinite(circle.offset_rad):
        faults.append(_fault("not-a-number", "a finite angle is needed", "offset_deg"))
    heights = circle.heights_mm
    if not 1 <= len(heights) <= 8 or not all(
        math.isfinite(h) and abs(h) <= 5000.0 for h in heights
    ):
        faults.append(_fault("out-of-range", "heights of the balls", "heights_mm", heights,
                             "1 to 8 numbers within 5000 mm"))  # fmt: skip
    wrong = [number for number in circle.occupied if not 1 <= number <= circle.count]
    if wrong:
        faults.append(_fault("out-of-range", "there is no such hole", "occupied", wrong,
                             f"1 to {circle.count}"))  # fmt: skip
    return faults


def _sites(entries: Mapping[str, Any], where: str, faults: list[Fault]) -> SiteList | None:
    """The list of sites."""
    rows = entries.get("sites")
    if not isinstance(rows, list) or not 3 <= len(rows) <= MAX_HOLES:
        faults.append(_fault("wrong-shape", "a list of sites is needed", f"{where}.sites", None,
                             f"3 to {MAX_HOLES} sites"))  # fmt: skip
        return None
    sites = []
    for index, row in enumerate(rows):
        place = f"{where}.sites[{index}]"
        values = _entries(row, _SITE, _SITE, place, faults)
        for key, value in values.items():
            if not _is_number(value) or abs(value) > 5000.0:
                faults.append(_fault("not-a-number", "a number within 5000 is needed",
                                     f"{place}.{key}", value))  # fmt: skip
        if values.get("radius_mm") is not None and _is_number(values["radius_mm"]) and (
            values["radius_mm"] <= 0.0
        ):  # fmt: skip
            faults.append(_fault("out-of-range", "too small", f"{place}.radius_mm",
                                 values["radius_mm"], "above 0 mm"))  # fmt: skip
        if not faults:
            t, phi, h = (float(values[key]) for key in _SITE)
            sites.append(MarkerSite(index + 1, t, math.radians(phi), h))
    return None if faults else SiteList(tuple(sites))


def _entries(
    value: Any,
    known: tuple[str, ...],
    needed: tuple[str, ...],
    where: str,
    faults: list[Fault],
) -> Mapping[str, Any]:
    """The object's known entries; unknown and missing keys are faults."""
    if not isinstance(value, Mapping):
        faults.append(_fault("wrong-type", "an object is needed", where, type(value).__name__))
        return {}
    for key in value:
        if key not in known:
            faults.append(
                _fault("unknown-key", "unknown key", f"{where}.{key}", None, ", ".join(known))
            )
    for key in needed:
        if key not in value:
            faults.append(_fault("missing-key", "this key is missing", f"{where}.{key}"))
    return {key: value[key] for key in known if key in value}


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, int | float)
        and not isinstance(value, bool)
        and abs(value) <= 1e300
        and math.isfinite(value)
    )


def _fault(code: str, what: str, where: str, value: Any = None, limit: str | None = None) -> Fault:
    # Only numbers are quoted: a text could name somebody (H51).
    numbers = value if isinstance(value, list | tuple) else [value]
    plain = all(isinstance(number, int | float) for number in numbers)
    shown = None if value is None else repr(value)[:60] if plain else type(value).__name__
    return Fault(code, what, shown, limit, "correct the holes of the ring", "H23", where)
