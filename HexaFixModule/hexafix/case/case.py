"""The case as the chain uses it: frozen values, radians inside."""

from __future__ import annotations

import datetime
import hashlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

from numpy.typing import NDArray

from hexafix.correction.targets import Correction
from hexafix.hardware import Fixator, MarkerLayout
from hexafix.markers import MarkerEdits


@dataclass(frozen=True, slots=True)
class Limb:
    """The limb under correction.

    Attributes
    ----------
    side : {"left", "right"}
        The patient's side.
    bone : str
    """

    side: Literal["left", "right"]
    bone: str


@dataclass(frozen=True, eq=False)
class ScheduleRules:
    """How fast and in which steps the patient turns.

    Attributes
    ----------
    start_date : datetime.date
        Day 1.
    adjustments_per_day : int
    strut_step_mm : float
        The smallest step of the strut's scale.
    max_rate_mm_per_day, max_rate_rad_per_day : float
        Limits of the fastest structure at risk and of the rotation.
    compensation : {"fused", "additive", "none"}
    structures_at_risk_mm : ndarray, shape (M, 3), or None
        LPS mm; points that move with the moving fragment.
    """

    start_date: datetime.date
    adjustments_per_day: int
    strut_step_mm: float
    max_rate_mm_per_day: float
    max_rate_rad_per_day: float
    compensation: Literal["fused", "additive", "none"]
    structures_at_risk_mm: NDArray | None = None


@dataclass(frozen=True, eq=False)
class Case:
    """Everything the user says about one patient's frame.

    Attributes
    ----------
    case_id : str
    limb : Limb
    image_path : Path
        DICOM folder or image file, absolute.
    series_instance_uid : str or None
        The user's choice among several series.
    fixator : Fixator
    ball_diameter_mm : float
    proximal, distal : MarkerLayout
        Layouts of the moving ring {A} and the base ring {B}.
    numbering : mapping of int to ndarray, shape (3,), or None
        The ball centres the user assigned, LPS mm; None for automatic.
    strut_readings_mm : ndarray, shape (6,), or None
        Scale readings today.
    correction : Correction or None
    schedule : ScheduleRules or None
    marker_edits : MarkerEdits
        The user's corrections of the balls found; empty where the case has none.
    ring_front_confirmed : bool or None
        Whether the user compared both rings' front (notch) with the picture (H22); None where the
        case does not tell.
    document : mapping
        The case file's content, the fixator replaced by its whole definition and the image's
        path removed (a path may hold a name).
    case_sha256, fixator_sha256 : str
    """

    case_id: str
    limb: Limb
    image_path: Path
    series_instance_uid: str | None
    fixator: Fixator
    ball_diameter_mm: float
    proximal: MarkerLayout
    distal: MarkerLayout
    numbering: MappingProxyType[int, NDArray] | None
    strut_readings_mm: NDArray | None
    correction: Correction | None
    schedule: ScheduleRules | None
    document: MappingProxyType[str, Any]
    case_sha256: str
    fixator_sha256: str
    marker_edits: MarkerEdits = field(default_factory=MarkerEdits)
    ring_front_confirmed: bool | None = None

    def read_from(self, raw: bytes) -> Case:
        """The same case with the hash of the bytes it was read from."""
        return replace(self, case_sha256=hashlib.sha256(raw).hexdigest())
