"""What the scenarios vary, worked out from each phantom and case rather than from titles."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from hexafix.accuracy import check_layouts
from hexafix.phantom import PhantomSpec
from hexafix.phantom.make import BODY_PART
from hexafix.phantom.posture import PATIENT_POSITIONS, SLICE_PLANES
from hexafix.phantom.scene import build_scene
from hexafix.phantom.spec import CORRECTIONS, RING_HU
from hexafix.phantom.truth import case_document, truth_document
from hexafix.scenarios.scenario import Scenario

AXES: dict[str, tuple[str, ...]] = {
    "side": ("left", "right"),
    "bone": tuple(BODY_PART),
    "frame in the scanner": ("up to 10°", "10° to 30°", "over 30°"),
    "rings to each other": ("up to 15°", "over 15°"),
    "balls a ring": ("3", "4", "5", "6", "7"),
    "counts": ("equal", "unequal"),
    "angle rule": ("preferred", "relaxed"),
    "balls": ("in one plane", "out of plane"),
    "ball radius": ("below 90 mm", "90 to 110 mm", "above 110 mm"),
    "ball diameter": ("below 10 mm", "10 mm", "above 10 mm"),
    "patient position": PATIENT_POSITIONS,
    "slice plane": SLICE_PLANES,
    "slices stored": ("rising", "falling"),
    "gantry": ("straight", "tilted +", "tilted -"),
    "finest voxel edge": ("up to 0.6 mm", "0.6 to 1 mm", "over 1 mm"),
    "slice pitch": ("up to 1 mm", "1 to 1.6 mm", "over 1.6 mm"),
    "slices": ("as thick as their pitch", "overlapping"),
    "point spread": ("sharp", "usual", "smooth"),
    "noise": ("up to 10 HU", "10 to 50 HU", "over 50 HU"),
    "streaks": ("none", "up to 200 HU", "over 200 HU"),
    "metal of the balls": ("aluminium", "steel, saturated", "steel, extended scale"),
    "rings of": tuple(RING_HU),
    "decoys and table": ("there", "none"),
    "correction": CORRECTIONS,
    "moving fragment": ("proximal", "distal"),
    "compensation": ("fused", "additive", "none"),
    "strut step": ("0.25 mm", "0.5 mm", "1 mm"),
    "adjustments a day": ("1", "2", "3", "4"),
    "structures at risk": ("named", "not named"),
    "turn to correct": ("up to 15°", "over 15°"),
    "lengthening": ("up to 20 mm", "over 20 mm"),
    "numbering": ("automatic", "by hand"),
    "stored as": ("dicom", "nrrd", "nifti", "metaimage"),
}
"""Every axis with all its values."""


def axes_of(scenario: Scenario) -> dict[str, set[str]]:
    """Axis by axis the values that a scenario has."""
    spec = scenario.spec()
    scene = build_scene(spec)
    truth = truth_document(spec, scene, []) | {"series_instance_uid": None}
    case = case_document(spec, scene, "ct")
    for change in scenario.case:
        change(case, truth)
    found: dict[str, set[str]] = {}
    for parts in (_of_frame(spec), _of_scan(spec), _of_metal(spec), _of_case(spec, case)):
        for axis, value in parts:
            found.setdefault(axis, set()).add(value)
    found["stored as"] = {scenario.image_format}
    return found


def coverage(scenarios: Sequence[Scenario]) -> dict[str, dict[str, list[str]]]:
    """For every value of every axis the ids of the scenarios that have it."""
    table: dict[str, dict[str, list[str]]] = {
        axis: {value: [] for value in values} for axis, values in AXES.items()
    }
    for scenario in scenarios:
        for axis, values in axes_of(scenario).items():
            for value in values:
                table[axis][value].append(scenario.id)
    return table


def _up_to(value: float, limits: Sequence[float], words: Sequence[str]) -> str:
    """The word of the first limit that a value keeps, else the last word."""
    return next((w for limit, w in zip(limits, words, strict=False) if value <= limit), words[-1])


def _of_frame(spec: PhantomSpec) -> Iterator[tuple[str, str]]:
    yield "side", spec.side
    yield "bone", spec.bone
    lean = np.degrees(np.arccos(np.clip(abs(spec.ring_b_pose.rotation[2, 2]), 0.0, 1.0)))
    yield "frame in the scanner", _up_to(lean, (10.0, 30.0), AXES["frame in the scanner"])
    askew = np.degrees(spec.mechanism_pose.rotation_angle_rad)
    yield "rings to each other", _up_to(askew, (15.0,), AXES["rings to each other"])
    counts = {len(spec.proximal), len(spec.distal)}
    yield "counts", "equal" if len(counts) == 1 else "unequal"
    for layout in (spec.proximal, spec.distal):
        yield "balls a ring", str(len(layout))
        radius = max(site.radius_mm for site in layout.sites)
        yield "ball radius", _up_to(radius, (89.9, 110.0), AXES["ball radius"])
    check = check_layouts(spec.proximal, spec.distal)
    for verdict in (check.proximal, check.distal):
        yield "angle rule", verdict.rule
        yield "balls", "in one plane" if verdict.out_of_plane_mm < 1.0 else "out of plane"
    yield "ball diameter", _up_to(spec.ball_diameter_mm, (9.9, 10.0), AXES["ball diameter"])


def _of_scan(spec: PhantomSpec) -> Iterator[tuple[str, str]]:
    yield "patient position", spec.patient_position
    yield "slice plane", spec.slice_plane
    yield "slices stored", "falling" if spec.slices_reversed else "rising"
    lean = spec.gantry_tilt_rad
    yield "gantry", "straight" if not lean else "tilted +" if lean > 0 else "tilted -"
    finest = min(spec.spacing_mm)
    yield "finest voxel edge", _up_to(finest, (0.6, 1.0), AXES["finest voxel edge"])
    yield "slice pitch", _up_to(spec.spacing_mm[2], (1.0, 1.6), AXES["slice pitch"])
    overlapping = spec.thickness_mm > spec.spacing_mm[2]
    yield "slices", "overlapping" if overlapping else "as thick as their pitch"
    yield "point spread", _up_to(spec.psf_sigma_mm, (0.4, 0.7), AXES["point spread"])
    yield "noise", _up_to(spec.noise_hu, (10.0, 50.0), AXES["noise"])
    yield "streaks", _up_to(spec.streak_hu, (0.0, 200.0), AXES["streaks"])


def _of_metal(spec: PhantomSpec) -> Iterator[tuple[str, str]]:
    dense = spec.ball_hu > 3071.0
    steel = "steel, extended scale" if spec.clip_hu is None else "steel, saturated"
    yield "metal of the balls", steel if dense else "aluminium"
    yield "rings of", spec.ring_material
    yield "decoys and table", "there" if spec.decoys and spec.table else "none"


def _of_case(spec: PhantomSpec, case: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield "correction", spec.correction
    yield "moving fragment", spec.moving
    schedule = case["schedule"]
    yield "compensation", schedule["compensation"]
    yield "strut step", f"{schedule['strut_step_mm']:g} mm"
    yield "adjustments a day", str(schedule["adjustments_per_day"])
    named = schedule.get("structures_at_risk_lps_mm") is not None
    yield "structures at risk", "named" if named else "not named"
    deformity = spec.mechanism_pose.inverse() @ spec.target_pose
    turn = np.degrees(deformity.rotation_angle_rad)
    yield "turn to correct", _up_to(turn, (15.0,), AXES["turn to correct"])
    longer = spec.target_pose.position_mm[2] - spec.mechanism_pose.position_mm[2]
    yield "lengthening", _up_to(longer, (20.0,), AXES["lengthening"])
    yield "numbering", "automatic" if case["numbering"] is None else "by hand"
