"""Parts of a case that is not finished: each step of the work needs only some of them."""

from __future__ import annotations

import json
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, TypeAdapter, ValidationError

from hexafix.case import checks, schema
from hexafix.case.case import Case, Limb, ScheduleRules
from hexafix.case.read import (
    case_from_document,
    correction_of,
    image_path,
    layout_of,
    marker_edits_of,
    resolve_fixator,
    rules_of,
)
from hexafix.correction.targets import Correction
from hexafix.errors import InputError
from hexafix.hardware import Fixator, MarkerLayout
from hexafix.markers import MarkerEdits
from hexafix.strict_json import parse_json_object

OPTIONAL_KEYS = (
    "numbering",
    "strut_readings_mm",
    "correction",
    "schedule",
    "marker_edits",
    "ring_front_confirmed",
    "readings_to_repeat",
)
"""Keys without which a case can be recognised."""

_LAYOUT = Annotated[list[schema.Marker], Field(min_length=3, max_length=24)]
_READINGS = Annotated[list[schema.Mm], Field(min_length=6, max_length=6)]
_NUMBER = Annotated[str, Field(pattern=r"^[1-9][0-9]?$")]
_STRICT: Any = {"strict": True, "allow_inf_nan": False}


@dataclass(frozen=True, eq=False)
class CaseParts:
    """What is right of a case that may be unfinished; None where a part is missing or wrong.

    Attributes
    ----------
    case_id : str or None
    limb : Limb or None
    image_path : Path or None
        Absolute; there may be no image.
    series_instance_uid : str or None
    fixator : Fixator or None
    ball_diameter_mm : float or None
    marker_edits : MarkerEdits or None
        Empty where the case has none; None where they are wrong.
    proximal, distal : MarkerLayout or None
    numbering : mapping of int to ndarray, shape (3,), or None
        What the user assigned so far, LPS mm: perhaps not all numbers; None for automatic.
    strut_readings_mm : ndarray, shape (6,), or None
    correction : Correction or None
    schedule : ScheduleRules or None
    ring_front_confirmed : bool or None
    """

    case_id: str | None = None
    limb: Limb | None = None
    image_path: Path | None = None
    series_instance_uid: str | None = None
    fixator: Fixator | None = None
    ball_diameter_mm: float | None = None
    marker_edits: MarkerEdits | None = field(default_factory=MarkerEdits)
    proximal: MarkerLayout | None = None
    distal: MarkerLayout | None = None
    numbering: Mapping[int, NDArray] | None = None
    strut_readings_mm: NDArray | None = None
    correction: Correction | None = None
    schedule: ScheduleRules | None = None
    ring_front_confirmed: bool | None = None


def parts_of(raw: bytes, *, folder: Path) -> CaseParts:
    """What is right of a case file, part by part; `draft_faults` tells what is wrong.

    Parameters
    ----------
    raw : bytes
        The case file, perhaps unfinished.
    folder : Path
        Where its image and fixator paths start.
    """
    try:
        content = parse_json_object(raw, what="case file", where="case.json")
    except InputError:
        return CaseParts(marker_edits=None)
    markers = content.get("markers")
    markers = markers if isinstance(markers, dict) else {}
    limb = _valid(schema.Limb, content.get("limb"))
    image = _valid(schema.Image, content.get("image"))
    proximal, distal = _layouts(markers)
    fixator = resolve_fixator(content, _broken_fixator(content), folder)[0]
    edits = content.get("marker_edits")
    given_edits = _valid(schema.MarkerEditsPart, edits)
    diameter = Annotated[float, Field(ge=2.0, le=40.0)]
    return CaseParts(
        case_id=_valid(
            Annotated[str, Field(pattern=schema.CASE_ID_PATTERN)], content.get("case_id")
        ),
        limb=None if limb is None else Limb(limb.side, limb.bone),
        image_path=None if image is None else image_path(content, set(), folder),
        series_instance_uid=None if image is None else image.series_instance_uid,
        fixator=fixator,
        ball_diameter_mm=_valid(diameter, markers.get("ball_diameter_mm")),
        marker_edits=None if edits and given_edits is None else marker_edits_of(given_edits),
        proximal=proximal,
        distal=distal,
        numbering=_numbering(content.get("numbering")),
        strut_readings_mm=_readings(content.get("strut_readings_mm"), fixator),
        correction=_correction(content.get("correction")),
        schedule=rules_of(_valid(schema.Schedule, content.get("schedule"))),
        ring_front_confirmed=_valid(bool, content.get("ring_front_confirmed")),
    )


def partial_case(
    raw: bytes, *, folder: Path, keep: Collection[str] = (), needs_image: bool = False
) -> Case:
    """A case read without the parts that a step does not need, though they be wrong.

    Parameters
    ----------
    raw : bytes
        The case file; `Case.case_sha256` is of these bytes.
    folder : Path
        Where its image and fixator paths start.
    keep : collection of str
        Which of `OPTIONAL_KEYS` the step needs; the others are left out.
    needs_image : bool
        Whether the image must be there.

    Raises
    ------
    InputError
        With every fault of the parts that are needed.
    """
    content = parse_json_object(raw, what="case file", where="case.json")
    dropped = set(OPTIONAL_KEYS) - set(keep)
    if not dropped & set(content):
        return case_from_document(raw, folder=folder, needs_image=needs_image, plannable=False)
    kept = {key: value for key, value in content.items() if key not in dropped}
    case = case_from_document(
        json.dumps(kept).encode(), folder=folder, needs_image=needs_image, plannable=False
    )
    return case.read_from(raw)


def _valid(kind: Any, value: Any) -> Any:
    """The value as the schema reads it, None where it does not."""
    if value is None:
        return None
    is_model = isinstance(kind, type) and issubclass(kind, schema.BaseModel)
    try:
        adapter = TypeAdapter(kind, config=None if is_model else _STRICT)
        return adapter.validate_json(json.dumps(value))
    except (ValidationError, ValueError):
        return None


def _layouts(markers: dict[str, Any]) -> tuple[MarkerLayout | None, MarkerLayout | None]:
    """Both layouts; one whose number stands elsewhere too is wrong."""
    rows = {ring: _valid(_LAYOUT, markers.get(ring)) for ring in ("proximal", "distal")}
    numbers = {ring: [m.number for m in found or ()] for ring, found in rows.items()}
    layouts = []
    for ring, other in (("proximal", "distal"), ("distal", "proximal")):
        own = numbers[ring]
        twice = len(set(own)) < len(own) or bool(set(own) & set(numbers[other]))
        layouts.append(None if rows[ring] is None or twice else layout_of(rows[ring]))
    return layouts[0], layouts[1]


def _broken_fixator(content: dict[str, Any]) -> set[str]:
    return set() if isinstance(content.get("fixator"), str | dict) else {"fixator"}


def _numbering(given: Any) -> Mapping[int, NDArray] | None:
    """The numbers assigned so far."""
    points = _valid(dict[_NUMBER, schema.Point], given)
    if not points:
        return None
    return MappingProxyType({int(number): np.array(p, float) for number, p in points.items()})


def _readings(given: Any, fixator: Fixator | None) -> NDArray | None:
    """All six readings, if they are on the struts' scale."""
    values = _valid(_READINGS, given)
    if values is None or (fixator is not None and any(checks.reading_faults(values, fixator))):
        return None
    readings = np.array(values, float)
    readings.setflags(write=False)
    return readings


def _correction(given: Any) -> Correction | None:
    kind = _valid(schema.CorrectionKind, given)
    if kind is None or any(checks.correction_faults(given)):
        return None
    return correction_of(kind)
