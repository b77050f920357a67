"""From ``case.json`` to a `Case`, naming every fault at once with its JSON path."""

from __future__ import annotations

import hashlib
import json
import re
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from pydantic import BaseModel, ValidationError

from hexafix.case import checks
from hexafix.case.case import Case, Limb, ScheduleRules
from hexafix.case.schema import VERSION_2_KEYS, CaseFile, LayoutFile, case_schema
from hexafix.correction.targets import (
    Correction,
    FragmentMotion,
    Landmarks,
    TargetPose,
)
from hexafix.errors import Fault, InputError
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, MarkerLayout, MarkerSite
from hexafix.hardware.definition import fixator_from_document, shipped_fixators
from hexafix.markers import MarkerEdits
from hexafix.paths import resources
from hexafix.strict_json import parse_json_object, read_json_object


def load_case(path: Path, *, needs_image: bool = True, plannable: bool = True) -> Case:
    """Read a case file.

    Parameters
    ----------
    path : Path
        The case file; its image and fixator paths are relative to it.
    needs_image : bool
        Whether the image must be there.
    plannable : bool
        Whether readings, correction and schedule must be given.

    Raises
    ------
    InputError
        With every fault found, each at its JSON path.
    """
    raw, folder = load_raw_case(path)
    return case_from_document(raw, folder=folder, needs_image=needs_image, plannable=plannable)


def load_raw_case(path: Path) -> tuple[bytes, Path]:
    """The bytes of a case file, perhaps unfinished, and the folder where its paths start.

    Raises
    ------
    InputError
        If the file cannot be read or holds no JSON object.
    """
    path = file_of_case(path)
    raw, _ = read_json_object(path, what="case file")
    return raw, path.resolve().parent


def file_of_case(path: Path) -> Path:
    """The file itself, or the ``case.json`` of the folder given."""
    path = Path(path)
    inside = path / "case.json"
    return inside if path.is_dir() and inside.is_file() else path


def case_from_document(
    raw: bytes, *, folder: Path, needs_image: bool = True, plannable: bool = True
) -> Case:
    """A case from the bytes of a case file that lies in `folder`; see `load_case`."""
    parsed = _parse(raw, folder=folder, needs_image=needs_image, plannable=plannable)
    if parsed.faults or parsed.fixator is None or parsed.image is None:
        raise InputError(*parsed.faults)
    model = case_schema(parsed.content).model_validate_json(raw)
    return _build(
        model,
        image=parsed.image,
        fixator=parsed.fixator,
        definition=parsed.definition,
        raw=raw,
    )


def draft_faults(raw: bytes, *, folder: Path) -> tuple[Fault, ...]:
    """Everything that keeps a case from being planned, each with its JSON path; never raises.

    Parameters
    ----------
    raw : bytes
        The case file, perhaps unfinished.
    folder : Path
        Where its image and fixator paths start.
    """
    try:
        return tuple(_parse(raw, folder=folder, needs_image=True, plannable=True).faults)
    except InputError as error:
        return error.faults


@dataclass(frozen=True, eq=False)
class _Parsed:
    """A case file's content, its faults, and what was found by them."""

    content: dict[str, Any]
    faults: list[Fault]
    fixator: Fixator | None
    definition: dict[str, Any]
    image: Path | None


def _parse(raw: bytes, *, folder: Path, needs_image: bool, plannable: bool) -> _Parsed:
    """All faults of a case file at once."""
    content = parse_json_object(raw, what="case file", where="case.json")
    faults, broken = schema_faults(case_schema(content), raw)
    fixator, definition, more = resolve_fixator(content, broken, folder)
    faults += more
    faults += _cross_faults(content, broken, fixator)
    image = image_path(content, broken, folder)
    if needs_image and image is not None and not image.exists():
        faults.append(
            Fault(
                "image-missing",
                "there is no image at this path",
                where="image.path",
                next_step="give the DICOM folder or image file relative to the case file",
            )
        )
    if plannable:
        faults += [
            Fault(
                "needed-for-a-plan",
                "a plan needs this part of the case",
                where=key,
                next_step=f"add {key}",
            )
            for key in ("strut_readings_mm", "correction", "schedule")
            if content.get(key) is None and key not in broken
        ]
        if content.get("readings_to_repeat") is True:
            faults.append(
                Fault(
                    "readings-to-repeat",
                    "the strut readings were typed at a workstation, and only once",
                    where="readings_to_repeat",
                    hazard="H24",
                    next_step="open the case at a workstation, enter the six readings a second "
                    "time and save it",
                )
            )
    return _Parsed(content, faults, fixator, definition, image)


def load_layouts(path: Path) -> tuple[MarkerLayout, MarkerLayout]:
    """Proximal and distal layout from a case file or a layout file.

    Raises
    ------
    InputError
        With every fault found.
    """
    path = file_of_case(path)
    raw, content = read_json_object(path, what="layout file")
    if "case_id" in content or "markers" in content:
        case = load_case(path, needs_image=False, plannable=False)
        return case.proximal, case.distal
    faults, broken = schema_faults(LayoutFile, raw)
    if not broken & {"proximal", "distal"}:
        faults += checks.marker_faults(content, where="")
    if faults:
        raise InputError(*faults)
    model = LayoutFile.model_validate_json(raw)
    return layout_of(model.proximal), layout_of(model.distal)


def schema_faults(schema: type[BaseModel], raw: bytes) -> tuple[list[Fault], set[str]]:
    """Faults against the schema, and the top-level keys that hold one."""
    try:
        schema.model_validate_json(raw)
    except ValidationError as error:
        rows = error.errors(include_url=False)
        faults = []
        for row in rows:
            unknown = row["type"] == "extra_forbidden"
            value = None if row["type"] == "missing" or unknown else _shown(row)
            faults.append(
                Fault(
                    "unknown-key" if unknown else "case-value",
                    "this key is not known" if unknown else _said(row),
                    value=value,
                    where=_json_path(row["loc"]),
                    hazard="H55",
                    next_step="remove it or correct its spelling" if unknown else None,
                )
            )
        return faults, {str(row["loc"][0]) for row in rows if row["loc"]}
    return [], set()


def _said(row: Any) -> str:
    """Pydantic's words, except where they quote the input."""
    if row["type"] == "union_tag_invalid":
        return f"kind must be one of {row['ctx']['expected_tags']}"
    return row["msg"]


def _shown(row: Any) -> str:
    """A wrong value that can name nobody: a number or a date's digits, else its size (H51)."""
    given = row["input"]
    if given is None or isinstance(given, bool | int | float):
        return repr(given)[:60]
    if row["type"].startswith("date_") and re.fullmatch(r"[0-9./-]{1,12}", str(given)):
        return str(given)
    kind = {str: "a text", list: "a list", dict: "an object"}.get(type(given), "a value")
    return f"{kind} of length {len(given)}" if isinstance(given, str | list | dict) else kind


def _json_path(location: tuple[int | str, ...]) -> str:
    """``markers.proximal[0].radius_mm`` from pydantic's location."""
    kinds = {"target-pose", "fragment-motion", "landmarks", "deformity", "dict[str,any]", "str"}
    text = ""
    for part in location:
        if isinstance(part, int):
            text += f"[{part}]"
        elif part not in kinds and part != "[key]":
            text += f".{part}" if text else part
    return text


def resolve_fixator(
    content: dict[str, Any], broken: set[str], folder: Path
) -> tuple[Fixator | None, dict[str, Any], list[Fault]]:
    """The fixator by shipped id, path or definition, that definition, and its faults."""
    if "fixator" in broken or "fixator" not in content:
        return None, {}, []
    given = content["fixator"]
    try:
        if isinstance(given, str):
            if given in shipped_fixators():
                file = resources() / "Hardware" / "Frames" / f"{given}.json"
            elif (folder / given).is_file():
                file = folder / given
            else:
                raise InputError.of(
                    "fixator-unknown",
                    "neither a shipped fixator nor a file",
                    limit="one of " + ", ".join(shipped_fixators()) + ", or a path",
                    hazard="H23",
                )
            _, given = read_json_object(file, what="fixator definition")
        return fixator_from_document(given), given, []
    except InputError as error:
        return (
            None,
            {},
            [
                Fault(
                    fault.code,
                    fault.what,
                    value=fault.value,
                    limit=fault.limit,
                    next_step=fault.next_step,
                    hazard=fault.hazard or "H23",
                    where=fault.where or "fixator",
                )
                for fault in error.faults
            ],
        )


def _cross_faults(
    content: dict[str, Any], broken: set[str], fixator: Fixator | None
) -> list[Fault]:
    """Faults between parts, for all parts whose own schema holds."""
    faults: list[Fault] = []
    if "markers" not in broken:
        faults += checks.marker_faults(content["markers"])
        if content.get("numbering") and "numbering" not in broken:
            faults += checks.numbering_faults(content["numbering"], content["markers"])
    if content.get("strut_readings_mm") and "strut_readings_mm" not in broken and fixator:
        faults += checks.reading_faults(content["strut_readings_mm"], fixator)
    if content.get("correction") and "correction" not in broken:
        faults += checks.correction_faults(content["correction"])
    return faults


def image_path(content: dict[str, Any], broken: set[str], folder: Path) -> Path | None:
    """Where the case's image lies, absolute."""
    if "image" in broken or "image" not in content:
        return None
    return (folder / content["image"]["path"]).resolve()


def layout_of(markers: list[Any]) -> MarkerLayout:
    """The layout of `schema.Marker` rows, radians inside."""
    sites = [
        MarkerSite(m.number, m.radius_mm, float(np.radians(m.sweep_deg)), m.height_mm)
        for m in markers
    ]
    return MarkerLayout(tuple(sorted(sites, key=lambda site: site.number)))


def marker_edits_of(part: Any) -> MarkerEdits:
    """The edits of `schema.MarkerEditsPart`; none where there is no such part."""
    if part is None:
        return MarkerEdits()
    return MarkerEdits(
        added_lps_mm=np.array(part.added_lps_mm, float),
        removed_lps_mm=np.array(part.removed_lps_mm, float),
    )


def correction_of(kind: Any) -> Correction | None:
    """The domain value of one correction kind, radians inside."""
    if kind is None:
        return None
    if kind.kind == "target-pose":
        return TargetPose(
            Pose.from_xyz_fixed(
                position_mm=kind.position_mm, angles_rad=np.radians(kind.angles_deg)
            )
        )
    if kind.kind == "fragment-motion":
        return FragmentMotion(moving=kind.moving, motion=Pose.from_matrix(kind.matrix_lps))
    if kind.kind == "landmarks":
        return Landmarks(
            moving=kind.moving,
            moving_points_mm=np.array(kind.moving_points_lps_mm),
            fixed_points_mm=np.array(kind.fixed_points_lps_mm),
        )
    return checks.deformity_of(kind.model_dump())


def rules_of(schedule: Any) -> ScheduleRules | None:
    """The schedule's rules, radians inside."""
    if schedule is None:
        return None
    points = schedule.structures_at_risk_lps_mm
    return ScheduleRules(
        start_date=schedule.start_date,
        adjustments_per_day=schedule.adjustments_per_day,
        strut_step_mm=schedule.strut_step_mm,
        max_rate_mm_per_day=schedule.max_rate_mm_per_day,
        max_rate_rad_per_day=float(np.radians(schedule.max_rate_deg_per_day)),
        compensation=schedule.compensation,
        structures_at_risk_mm=None if points is None else np.array(points, float),
    )


def _build(
    model: CaseFile, *, image: Path, fixator: Fixator, definition: dict[str, Any], raw: bytes
) -> Case:
    document = json.loads(model.model_dump_json())
    document["fixator"] = definition
    document["image"] = {"path": None, "series_instance_uid": None}
    for key in VERSION_2_KEYS:
        if document.get(key, ...) is None:
            del document[key]
    numbering = None
    if model.numbering:
        numbering = MappingProxyType(
            {int(number): np.array(point, float) for number, point in model.numbering.items()}
        )
    canonical = json.dumps(definition, sort_keys=True, separators=(",", ":"))
    return Case(
        case_id=model.case_id,
        limb=Limb(model.limb.side, model.limb.bone),
        image_path=image,
        series_instance_uid=model.image.series_instance_uid,
        fixator=fixator,
        ball_diameter_mm=model.markers.ball_diameter_mm,
        proximal=layout_of(model.markers.proximal),
        distal=layout_of(model.markers.distal),
        numbering=numbering,
        strut_readings_mm=None
        if model.strut_readings_mm is None
        else np.array(model.strut_readings_mm, float),
        correction=correction_of(model.correction),
        schedule=rules_of(model.schedule),
        document=MappingProxyType(document),
        case_sha256=hashlib.sha256(raw).hexdigest(),
        fixator_sha256=hashlib.sha256(canonical.encode()).hexdigest(),
        marker_edits=marker_edits_of(getattr(model, "marker_edits", None)),
        ring_front_confirmed=getattr(model, "ring_front_confirmed", None),
    )
