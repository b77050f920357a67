"""Hardware definitions: from JSON to a `Fixator`, strictly, all faults at once."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from hexafix.errors import Fault, HardwareDefinitionError, InputError
from hexafix.hardware.fixator import Fixator, Ring, StrutType
from hexafix.hardware.holes import Places, places_from_document
from hexafix.paths import resources
from hexafix.strict_json import read_json_object

SCHEMA_VERSION = 1
_TOP = ("schema_version", "id", "name", "source", "proximal", "distal", "strut")
_RING = ("joints_mm", "thickness_mm", "outer_radius_mm", "holes")
_STRUT = ("min_mm", "max_mm", "scale_offset_mm")
_OPTIONAL = ("scale_offset_mm", "holes")
LARGEST_MM = 1e5
"""No length or coordinate of a fixator is larger; NaN and infinity are not either."""
CLOSEST_JOINTS_MM = 1.0
"""Two joint centres of a ring nearer than this are a typing error."""


def shipped_fixators() -> tuple[str, ...]:
    """The ids of the definitions that come with HexaFix."""
    return tuple(sorted(path.stem for path in (resources() / "Hardware" / "Frames").glob("*.json")))


def shipped_fixator_names() -> dict[str, str]:
    """What each shipped definition is called, by its id."""
    return {known: shipped_fixator(known).name for known in shipped_fixators()}


def shipped_fixator(fixator_id: str = "generic-6sps-160") -> Fixator:
    """A fixator that comes with HexaFix.

    Raises
    ------
    HardwareDefinitionError
        If there is none with this id.
    """
    known = shipped_fixators()
    if fixator_id not in known:
        raise HardwareDefinitionError.of(
            "unknown-fixator",
            "no shipped hardware definition has this id",
            value=repr(fixator_id),
            limit=", ".join(known),
            next_step="name a shipped id, a path to a definition, or write the definition out",
            hazard="H23",
        )
    return read_fixator(resources() / "Hardware" / "Frames" / f"{fixator_id}.json")


def read_fixator(path: str | Path) -> Fixator:
    """The fixator of a JSON definition file.

    Raises
    ------
    HardwareDefinitionError
        If the file cannot be read, is no strict JSON, or breaks the schema; names every fault.
    """
    file = Path(path)
    try:
        _, document = read_json_object(file, what="hardware definition")
    except InputError as error:
        raise HardwareDefinitionError(*map(_hardware_fault, error.faults)) from error
    return fixator_from_document(document, where=file.name)


def _hardware_fault(fault: Fault) -> Fault:
    """A fault of the file as one of the hardware definition."""
    if fault.code == "file-unreadable":
        return replace(fault, code="hardware-unreadable")
    return replace(
        fault,
        code="hardware-not-json",
        what=f"the hardware definition is not valid JSON: {fault.what}",
        next_step="correct the file with a JSON editor",
    )


def fixator_from_document(document: Any, *, where: str = "fixator") -> Fixator:
    """The fixator of a parsed definition.

    Parameters
    ----------
    document : object
        The parsed JSON; must be an object of the contract's schema, lengths in mm, joint centres
        in the ring frames {A} and {B}.
    where : str
        JSON path or file that holds it, for the faults.

    Raises
    ------
    HardwareDefinitionError
        With every fault found: unknown or missing keys, wrong version, wrong shapes, numbers that
        are not finite or out of range.
    """
    check = _Check()
    top = check.keys(document, _TOP, where)
    version = top.get("schema_version", SCHEMA_VERSION)
    if type(version) is not int or version != SCHEMA_VERSION:  # true and 1.0 equal 1
        check.fault(
            "schema-version",
            "unknown schema version",
            f"{where}.schema_version",
            repr(version),
            str(SCHEMA_VERSION),
        )
    texts = {key: check.text(top, key, where) for key in ("id", "name", "source")}
    rings = {key: check.ring(top.get(key), f"{where}.{key}") for key in _TOP[4:6] if key in top}
    strut = check.strut(top["strut"], f"{where}.strut") if "strut" in top else None
    proximal, distal = rings.get("proximal"), rings.get("distal")
    if check.faults or proximal is None or distal is None or strut is None:
        raise HardwareDefinitionError(*check.faults)
    return Fixator(**texts, proximal=proximal, distal=distal, strut=strut)


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= LARGEST_MM
    )


class _Check:
    """Collects the faults of one definition."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def fault(
        self, code: str, what: str, where: str, value: str | None = None, limit: str | None = None
    ) -> None:
        step = "correct the hardware definition"
        self.faults.append(Fault(code, what, value, limit, step, "H23", where))

    def keys(self, value: Any, known: tuple[str, ...], where: str) -> Mapping[str, Any]:
        """The object's known entries; unknown and missing keys are faults."""
        if not isinstance(value, Mapping):
            self.fault("wrong-type", "an object is needed", where, type(value).__name__)
            return {}
        for key in value:
            if key not in known:
                self.fault("unknown-key", "unknown key", f"{where}.{key}", None, ", ".join(known))
        for key in known:
            if key not in value and key not in _OPTIONAL:
                self.fault("missing-key", "this key is missing", f"{where}.{key}")
        return {key: value[key] for key in known if key in value}

    def text(self, document: Mapping[str, Any], key: str, where: str) -> str:
        value = document.get(key, "")
        if key in document and (not isinstance(value, str) or not value.strip()):
            self.fault("wrong-type", "a text is needed", f"{where}.{key}", repr(value))
        return value if isinstance(value, str) else ""

    def number(self, entries: Mapping[str, Any], key: str, where: str, low: float) -> float:
        """The number `entries[key]`, above `low`; NaN stands for one already faulted."""
        if key not in entries:
            return math.nan
        value = entries[key]
        if not _is_number(value):
            self.fault(
                "not-a-number",
                "a finite number of sensible size is needed",
                f"{where}.{key}",
                repr(value),
            )
            return math.nan
        if value <= low:
            self.fault("out-of-range", "too small", f"{where}.{key}", f"{value} mm", f"> {low} mm")
            return math.nan
        return float(value)

    def ring(self, value: Any, where: str) -> Ring | None:
        entries = self.keys(value, _RING, where)
        before = len(self.faults)
        thickness = self.number(entries, "thickness_mm", where, 0.0)
        radius = self.number(entries, "outer_radius_mm", where, 0.0)
        joints = self.joints(entries["joints_mm"], where) if "joints_mm" in entries else None
        holes = self.holes(entries["holes"], f"{where}.holes") if "holes" in entries else None
        if joints is None or len(self.faults) > before or not math.isfinite(thickness + radius):
            return None
        return Ring(joints, thickness, radius, holes)

    def holes(self, value: Any, where: str) -> Places | None:
        """Where marker rods can be put, if the definition says so."""
        try:
            return places_from_document(value, where=where)
        except HardwareDefinitionError as error:
            self.faults += error.faults
            return None

    def joints(self, value: Any, ring: str) -> np.ndarray | None:
        where = f"{ring}.joints_mm"
        if not isinstance(value, list | tuple) or len(value) != 6:
            got = f"{len(value)} entries" if isinstance(value, list | tuple) else repr(value)
            self.fault("wrong-shape", "six joint centres are needed", where, got, "6 × [x, y, z]")
            return None
        good = True
        for index, row in enumerate(value):
            if not isinstance(row, list | tuple) or len(row) != 3 or not all(map(_is_number, row)):
                good = False
                what = "three finite numbers of sensible size are needed"
                self.fault("wrong-shape", what, f"{where}[{index}]", repr(row), "[x, y, z] mm")
        if not good:
            return None
        joints = np.array(value, float)
        gaps = np.linalg.norm(joints[:, None] - joints[None], axis=-1)[np.triu_indices(6, 1)]
        if gaps.min() < CLOSEST_JOINTS_MM:
            what = "two joint centres of this ring coincide"
            limit = f"≥ {CLOSEST_JOINTS_MM} mm apart"
            self.fault("joints-coincide", what, where, f"{gaps.min():.3f} mm", limit)
            return None
        return joints

    def strut(self, value: Any, where: str) -> StrutType | None:
        entries = self.keys(value, _STRUT, where)
        low = self.number(entries, "min_mm", where, 0.0)
        high = self.number(entries, "max_mm", where, 0.0)
        offset = self.number({"scale_offset_mm": 0.0, **entries}, "scale_offset_mm", where, -1e6)
        if low >= high:
            what = "the shortest length is not below the longest"
            self.fault("out-of-range", what, f"{where}.min_mm", f"{low} mm", f"< {high} mm")
            return None
        return StrutType(low, high, offset) if math.isfinite(low + high + offset) else None
