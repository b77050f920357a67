"""The case file's schema: what contract and user agree on, key by key."""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

MAX_RATE_MM_PER_DAY = 3.0
"""Hard limit of the rate a case may ask for (H28); usual practice is 1 mm a day."""

MAX_RATE_DEG_PER_DAY = 5.0
"""Hard limit of the rotation rate a case may ask for (H28)."""

CASE_ID_PATTERN = r"^[A-Za-z0-9][A-Za-z0-9 ._-]{0,63}$"
"""Letters that every file system and the prescription's font hold."""

Mm = Annotated[float, Field(ge=-5000.0, le=5000.0)]
Deg = Annotated[float, Field(ge=-360.0, le=360.0)]
PositiveMm = Annotated[float, Field(gt=0.0, le=5000.0)]
Point = Annotated[list[Mm], Field(min_length=3, max_length=3)]
Row = Annotated[list[float], Field(min_length=4, max_length=4)]
Side = Literal["proximal", "distal"]

# not a Literal: to that, true and 1.0 are 1
Version1 = Annotated[int, Field(ge=1, le=1)]
Version1Or2 = Annotated[int, Field(ge=1, le=2)]


class _Strict(BaseModel):
    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, hide_input_in_errors=False
    )


class Limb(_Strict):
    """Which limb: printed on each page and compared with the image's header."""

    side: Literal["left", "right"]
    bone: Annotated[str, Field(pattern=r"^[a-z][a-z -]{1,30}$")]


class Image(_Strict):
    """Where the CT lies, relative to the case file."""

    path: Annotated[str, Field(min_length=1)]
    series_instance_uid: Annotated[str, Field(pattern=r"^[0-9.]{3,64}$")] | None = None


class Marker(_Strict):
    """One marker's installation parameters t, φ, h."""

    number: Annotated[int, Field(ge=1, le=99)]
    radius_mm: PositiveMm
    sweep_deg: Deg
    height_mm: Mm


class Markers(_Strict):
    """The balls and their layout on both rings."""

    ball_diameter_mm: Annotated[float, Field(ge=2.0, le=40.0)]
    proximal: Annotated[list[Marker], Field(min_length=3, max_length=24)]
    distal: Annotated[list[Marker], Field(min_length=3, max_length=24)]


class Holes(_Strict):
    """Where each ring can carry markers; the rings' own schema is in `hexafix.hardware.holes`."""

    proximal: dict[str, Any] | None = None
    distal: dict[str, Any] | None = None


class LayoutFile(_Strict):
    """A layout alone, for ``check-layout`` and ``advise`` before any CT."""

    schema_version: Version1
    proximal: Annotated[list[Marker], Field(min_length=3, max_length=24)]
    distal: Annotated[list[Marker], Field(min_length=3, max_length=24)]
    ball_diameter_mm: Annotated[float, Field(ge=2.0, le=40.0)] | None = None
    holes: Holes | None = None


class RingFile(_Strict):
    """A single ring for ``advise``: its places and, where there is one, its layout."""

    schema_version: Version1
    holes: dict[str, Any]
    markers: Annotated[list[Marker], Field(min_length=3, max_length=24)] | None = None
    ball_diameter_mm: Annotated[float, Field(ge=2.0, le=40.0)] | None = None


class TargetPoseKind(_Strict):
    """{A} in {B} at the end."""

    kind: Literal["target-pose"]
    position_mm: Point
    angles_deg: Annotated[list[Deg], Field(min_length=3, max_length=3)]


class FragmentMotionKind(_Strict):
    """The rigid motion of a bone fragment in image space."""

    kind: Literal["fragment-motion"]
    moving: Side
    matrix_lps: Annotated[list[Row], Field(min_length=4, max_length=4)]


class LandmarksKind(_Strict):
    """Point pairs that the motion brings together."""

    kind: Literal["landmarks"]
    moving: Side
    moving_points_lps_mm: Annotated[list[Point], Field(min_length=3, max_length=200)]
    fixed_points_lps_mm: Annotated[list[Point], Field(min_length=3, max_length=200)]


class DeformityKind(_Strict):
    """The six clinical parameters that the moving fragment has, in words."""

    kind: Literal["deformity"]
    moving: Side = "distal"
    origin_lps_mm: Point
    ap_angulation_deg: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    ap_angulation: Literal["varus", "valgus"] | None = None
    lateral_angulation_deg: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    lateral_angulation: Literal["apex-anterior", "apex-posterior"] | None = None
    axial_rotation_deg: Annotated[float, Field(ge=0.0, le=60.0)] = 0.0
    axial_rotation: Literal["internal", "external"] | None = None
    ap_translation_mm: Annotated[float, Field(ge=0.0, le=150.0)] = 0.0
    ap_translation: Literal["medial", "lateral"] | None = None
    lateral_translation_mm: Annotated[float, Field(ge=0.0, le=150.0)] = 0.0
    lateral_translation: Literal["anterior", "posterior"] | None = None
    axial_translation_mm: Annotated[float, Field(ge=0.0, le=150.0)] = 0.0
    axial_translation: Literal["short", "long"] | None = None


CorrectionKind = Annotated[
    TargetPoseKind | FragmentMotionKind | LandmarksKind | DeformityKind,
    Field(discriminator="kind"),
]


class Schedule(_Strict):
    """How fast and in which steps the patient turns."""

    start_date: datetime.date
    adjustments_per_day: Annotated[int, Field(ge=1, le=8)] = 4
    strut_step_mm: Annotated[float, Field(ge=0.01, le=2.0)] = 0.5
    max_rate_mm_per_day: Annotated[float, Field(gt=0.0, le=MAX_RATE_MM_PER_DAY)] = 1.0
    max_rate_deg_per_day: Annotated[float, Field(gt=0.0, le=MAX_RATE_DEG_PER_DAY)] = 1.0
    compensation: Literal["fused", "additive", "none"] = "fused"
    structures_at_risk_lps_mm: (
        Annotated[list[Point], Field(min_length=1, max_length=200)] | None
    ) = None


class CaseFile(_Strict):
    """The whole case file (``case.json``) of version 1; `EditedCaseFile` adds what 2 knows."""

    schema_version: Version1Or2
    case_id: Annotated[str, Field(pattern=CASE_ID_PATTERN)]
    limb: Limb
    image: Image
    fixator: str | dict[str, Any]
    markers: Markers
    numbering: dict[Annotated[str, Field(pattern=r"^[1-9][0-9]?$")], Point] | None = None
    strut_readings_mm: Annotated[list[Mm], Field(min_length=6, max_length=6)] | None = None
    correction: CorrectionKind | None = None
    schedule: Schedule | None = None


class MarkerEditsPart(_Strict):
    """The user's corrections of the balls found; a ball that was dragged stands in both."""

    added_lps_mm: Annotated[list[Point], Field(max_length=200)] = []
    removed_lps_mm: Annotated[list[Point], Field(max_length=200)] = []


class EditedCaseFile(CaseFile):
    """The case file of version 2: what the user corrects and confirms at a workstation."""

    marker_edits: MarkerEditsPart | None = None
    ring_front_confirmed: bool | None = None
    readings_to_repeat: bool | None = None


VERSION_2_KEYS = ("marker_edits", "ring_front_confirmed", "readings_to_repeat")
"""Keys that version 1 does not know."""


def case_schema(content: Mapping[str, Any]) -> type[CaseFile]:
    """The schema of a case file's own version; 1 where it tells none that is known."""
    return EditedCaseFile if content.get("schema_version") == 2 else CaseFile
