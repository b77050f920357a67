"""The safety gates G2 to G9: a value, its limit, and a red gate refuses.

Each function compares numbers that the steps computed and returns one `Gate`; none of them
computes geometry. The limits stand here with the reason for each.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.errors import Fault, Refused
from hexafix.geometry import Pose, matrix_from_xyz_fixed
from hexafix.recognition import RING_RMS_LIMIT_MM

DIAMETER_LIMIT_MM = 0.3
"""G3: blur biases the fitted diameter by less; a slice spacing wrong by 4 % gives more."""

TILT_LIMIT_DEG = 60.0
"""G5: a ring's axis further than this from the line to the other ring is no fixator on a limb."""

STRUT_WARNING_MM = 1.0
STRUT_LIMIT_MM = 2.0
"""G6: CT and reading of one strut (H24)."""

RECOGNITION_LIMIT_MM = 1.5
RECOGNITION_LIMIT_DEG = 1.0
"""G6: |ΔX_r| beyond which compensation would hide a gross error (H33)."""

NUMBERING_MARGIN_MM = 0.5
"""G7: least RMS by which any other choice of balls must stand off; for the same balls under other
numbers `number_balls` asks for 5 mm before it returns (H18)."""

CONDITION_LIMIT = 100.0
"""G8: condition number of the strut Jacobian (rotations scaled by the joint radius), H31."""

BASIN_LIMIT_MM = 1e-6
"""G8: second starts of the forward kinematics must agree this well (H30)."""

RECOMPUTED_LIMIT_MM = 0.2
RECOMPUTED_LIMIT_DEG = 0.1
"""G9: pose from the printed rows by another road against the plan."""

LEG_BONES = frozenset({"tibia", "fibula", "femur", "foot", "ankle", "lower leg", "leg"})
"""Bones whose proximal direction is towards the head in a CT, whatever the table position."""


@dataclass(frozen=True, slots=True)
class Gate:
    """One check with its figure.

    Attributes
    ----------
    gate : str
        ``G2`` to ``G9``, or the hazard where it belongs to no numbered gate.
    code : str
        Kebab-case name of the fault it finds.
    name : str
        What is compared.
    hazard : str
    value, limit : float
    unit : str
    passed : bool
    message : str
        One sentence for people.
    next_step : str
        What to do when it is red.
    """

    gate: str
    code: str
    name: str
    hazard: str
    value: float
    limit: float
    unit: str
    passed: bool
    message: str
    next_step: str

    def as_json(self) -> dict[str, Any]:
        """The gate as it stands in ``plan.json``."""
        return {key: getattr(self, key) for key in self.__slots__}

    def as_fault(self) -> Fault:
        """The fault a red gate becomes."""
        return Fault(
            self.code,
            f"{self.gate} {self.name}: {self.message}",
            value=f"{self.value:.4g} {self.unit}".strip(),
            limit=f"{self.limit:.4g} {self.unit}".strip(),
            next_step=self.next_step,
            hazard=self.hazard,
        )


def decide(gates: Iterable[Gate]) -> None:
    """Refuse if any gate is red.

    Raises
    ------
    Refused
        With one fault per red gate.
    """
    red = [gate.as_fault() for gate in gates if not gate.passed]
    if red:
        raise Refused(*red)


def _at_most(
    gate: str,
    code: str,
    name: str,
    hazard: str,
    value: float,
    limit: float,
    unit: str,
    **words: str,
) -> Gate:
    passed = bool(np.isfinite(value) and value <= limit)
    message = words["good"] if passed else words["bad"]
    return Gate(gate, code, name, hazard, float(value), limit, unit, passed, message, words["next"])


def ring_rms(ring: str, rms_mm: float) -> Gate:
    """G2: rigid RMS of a ring's balls against its layout."""
    return _at_most(
        "G2",
        "ring-rms",
        f"rigid RMS of the {ring} ring",
        "H01",
        rms_mm,
        RING_RMS_LIMIT_MM,
        "mm",
        good="the balls lie as the layout says",
        bad="the balls do not lie as the layout says: mirrored, sheared or scaled image, wrong "
        "numbers or another layout",
        next="check the layout in the case and the image's geometry",
    )


def ball_diameters(ring: str, diameters_mm: ArrayLike, nominal_mm: float) -> Gate:
    """G3: scale of the image, by the balls' known diameter."""
    worst = float(np.max(np.abs(np.asarray(diameters_mm, float) - nominal_mm)))
    return _at_most(
        "G3",
        "ball-diameter",
        f"ball diameters of the {ring} ring against {nominal_mm:g} mm",
        "H23",
        worst,
        DIAMETER_LIMIT_MM,
        "mm",
        good="the balls have the size the case says",
        bad="a ball has another size than the case says: wrong scale or other markers",
        next="check ball_diameter_mm and the image's spacing",
    )


def moving_ring_above(mechanism: Pose) -> Gate:
    """G4: the proximal ring lies on the +z side of the distal ring."""
    z = float(mechanism.position_mm[2])
    passed = z > 0.0
    return Gate(
        "G4",
        "rings-swapped",
        "z of the proximal ring in the distal ring's frame",
        "H20",
        z,
        0.0,
        "mm (at least)",
        passed,
        "the proximal ring lies above the distal ring"
        if passed
        else "the proximal ring lies below the distal ring: rings exchanged, a ring upside down "
        "or a mirrored image",
        "check which layout belongs to which ring, and the image",
    )


def rings_face_each_other(proximal: Pose, distal: Pose) -> Gate:
    """G5: both ring axes run along the limb, by their angle to the line between the rings."""
    line = proximal.position_mm - distal.position_mm
    line = line / np.linalg.norm(line)
    axes = np.stack([proximal.rotation[:, 2], distal.rotation[:, 2]])
    worst = float(np.degrees(np.max(np.arccos(np.clip(axes @ line, -1.0, 1.0)))))
    return _at_most(
        "G5",
        "ring-axis",
        "angle of the ring axes to the line between the rings",
        "H21",
        worst,
        TILT_LIMIT_DEG,
        "deg",
        good="both ring axes run along the limb",
        bad="a ring axis does not run along the limb: a ring upside down, wrong numbers or a "
        "mirrored image",
        next="check the sign of the marker heights and the numbers",
    )


def angles_rebuild(name: str, pose: Pose) -> Gate:
    """G5: the orientation matrix rebuilt from its X-Y-Z fixed angles is the same matrix."""
    worst = float(np.max(np.abs(matrix_from_xyz_fixed(pose.angles_rad) - pose.rotation)))
    return _at_most(
        "G5",
        "angles-rebuild",
        f"orientation of the {name} rebuilt from its angles",
        "H01",
        worst,
        1e-9,
        "",
        good="angles and matrix agree",
        bad="angles and matrix disagree: the matrix is mirrored or the angles are not unique",
        next="report this case",
    )


def towards_the_head(bone: str, proximal: Pose, distal: Pose) -> Gate | None:
    """G5: on a leg the proximal ring lies nearer the head, and both rings' +z points there.

    Returns
    -------
    Gate or None
        None for an arm, which may lie at any angle in the scanner.
    """
    if bone not in LEG_BONES:
        return None
    line = proximal.position_mm - distal.position_mm
    rise = [line[2] / np.linalg.norm(line), proximal.rotation[2, 2], distal.rotation[2, 2]]
    lowest = float(np.min(rise))
    passed = lowest > 0.0
    return Gate(
        "G5",
        "not-towards-head",
        f"direction of the rings' +z along the body on the {bone}",
        "H21",
        lowest,
        0.0,
        "(cosine, at least)",
        passed,
        "the proximal side lies towards the head"
        if passed
        else "the proximal side lies towards the feet: mirrored image or rings exchanged",
        "check the image's orientation and which layout belongs to which ring",
    )


def struts_agree(differences_mm: ArrayLike, *, better_order: str | None = None) -> Gate:
    """G6: strut lengths by CT against the readings; names the strut that disagrees most.

    Parameters
    ----------
    differences_mm : array_like, shape (6,)
        Length by CT minus length by reading, mm.
    better_order : str or None
        Another order of the readings that fits far better, in words (H25).
    """
    differences = np.asarray(differences_mm, float)
    strut = int(np.argmax(np.abs(differences)))
    worst = float(np.abs(differences[strut]))
    hint = f"; {better_order}" if better_order else ""
    good = (
        f"strut {strut + 1} differs most, read it again"
        if worst > STRUT_WARNING_MM
        else "readings and CT agree"
    )
    return _at_most(
        "G6",
        "strut-order" if better_order else "strut-reading",
        "strut length by CT against its reading",
        "H25" if better_order else "H24",
        worst,
        STRUT_LIMIT_MM,
        "mm",
        good=good,
        bad=f"strut {strut + 1} by CT is {differences[strut]:+.2f} mm from its reading{hint}",
        next=f"read strut {strut + 1} again; if the frame was turned after the scan, scan again",
    )


def recognition_error(distance_mm: float, rotation_rad: float) -> tuple[Gate, Gate]:
    """G6: the recognised pose against the pose from the struts, before compensation uses it."""
    words = {
        "good": "small enough to be compensated",
        "bad": "too large to be a recognition error: compensation would hide a gross error",
        "next": "read all struts again and check layout and numbers",
    }
    return (
        _at_most(
            "G6",
            "recognition-error",
            "position of the recognised pose against the struts'",
            "H33",
            distance_mm,
            RECOGNITION_LIMIT_MM,
            "mm",
            **words,
        ),
        _at_most(
            "G6",
            "recognition-error",
            "orientation of the recognised pose against the struts'",
            "H33",
            float(np.degrees(rotation_rad)),
            RECOGNITION_LIMIT_DEG,
            "deg",
            **words,
        ),
    )


def numbering_unique(margin_mm: float, settled_by: str) -> Gate:
    """G7: how far the best wrong numbering stands off."""
    passed = bool(margin_mm >= NUMBERING_MARGIN_MM or settled_by == "strut-readings")
    text = {
        "layout": "only one numbering fits",
        "strut-readings": "the layout alone fits several numberings; the strut readings decided",
        "user": "the numbers are the user's",
    }
    return Gate(
        "G7",
        "numbering-ambiguous",
        "RMS by which the best wrong numbering stands off",
        "H18",
        float(margin_mm),
        NUMBERING_MARGIN_MM,
        "mm (at least)",
        passed,
        text[settled_by] if passed else "another numbering fits nearly as well",
        "move a marker so that the layout is unique",
    )


def forward_basin(worst_mm: float, starts: int) -> Gate:
    """G8: second starts of the forward kinematics reach the same pose."""
    return _at_most(
        "G8",
        "assembly-mode",
        f"forward kinematics from {starts} other starts",
        "H30",
        worst_mm,
        BASIN_LIMIT_MM,
        "mm",
        good="all starts reach the same pose",
        bad="other starts reach another assembly of the mechanism",
        next="check the readings and the fixator definition",
    )


def well_conditioned(condition_number: float) -> Gate:
    """G8: distance from a singular pose along the whole path."""
    return _at_most(
        "G8",
        "near-singular",
        "largest condition number along the path",
        "H31",
        condition_number,
        CONDITION_LIMIT,
        "",
        good="the path stays clear of singular poses",
        bad="the path comes near a singular pose, where struts no longer hold the ring",
        next="choose another target or mount the rings otherwise",
    )


def recomputed(distance_mm: float, rotation_deg: float) -> tuple[Gate, Gate]:
    """G9: the finished schedule recomputed by another road."""
    words = {
        "good": "an independent computation reaches the planned pose from the printed rows",
        "bad": "an independent computation does not reach the planned pose from the printed rows",
        "next": "do not use this plan; report the case",
    }
    name = "recomputed from the printed rows"
    return (
        _at_most("G9", "recomputation", f"position {name}", "H41", distance_mm,
                 RECOMPUTED_LIMIT_MM, "mm", **words),
        _at_most("G9", "recomputation", f"orientation {name}", "H41", rotation_deg,
                 RECOMPUTED_LIMIT_DEG, "deg", **words),
    )  # fmt: skip


def layout_rule(ring: str, rule: str, smallest_deg: float, *, relaxed_accepted: bool) -> Gate:
    """H17: the included angles of a ring's markers, Section 4.3.2."""
    passed = rule == "preferred" or (rule == "relaxed" and relaxed_accepted)
    message = {
        "preferred": "the included angles keep the rule",
        "relaxed": "the included angles keep only the relaxed rule"
        + (", which the user accepted" if relaxed_accepted else ""),
        "violated": "the included angles break both rules",
    }[rule]
    return Gate(
        "H17",
        f"layout-{rule}",
        f"smallest included angle of the {ring} ring",
        "H17",
        float(smallest_deg),
        45.0,
        "deg (at least)",
        passed,
        message,
        "move a marker (hexafix check-layout proposes where)"
        + ("; or accept it with --accept-relaxed-layout" if rule == "relaxed" else ""),
    )


def sides_agree(side: str, laterality: str | None) -> Gate:
    """H37: the case's side against the image's Laterality, where the image tells it."""
    told = {"L": "left", "R": "right"}.get(laterality or "", "")
    passed = told in ("", side)
    return Gate(
        "H37",
        "wrong-side",
        f"side in the case ({side}) against the image's header",
        "H37",
        0.0 if passed else 1.0,
        0.0,
        "conflicts",
        passed,
        ("the image does not tell a side" if not told else "both say the same side")
        if passed
        else f"the image's header says {told}",
        "check that image and case belong together",
    )


def red(gates: Sequence[Gate]) -> tuple[Gate, ...]:
    """The gates that refuse."""
    return tuple(gate for gate in gates if not gate.passed)
