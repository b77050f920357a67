"""G2 to G5, G7 and the side: what the image alone must satisfy."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hexafix.gates.gate import Gate, at_most
from hexafix.geometry import Pose, matrix_from_xyz_fixed
from hexafix.recognition import RING_RMS_LIMIT_MM

DIAMETER_LIMIT_MM = 0.3
"""G3: blur biases the fitted diameter by less; a slice spacing wrong by 4 % gives more."""

CLIPPED_DIAMETER_LIMIT_MM = 1.0
"""G3 for balls denser than the scanner's scale: clipping moves their edge out by 0.3 mm or more, so
that the diameter says little; a wrong scale is then left to G2."""

TILT_LIMIT_DEG = 60.0
"""G5: a ring's axis further than this from the line to the other ring is no fixator on a limb."""

NUMBERING_MARGIN_MM = 0.5
"""G7: least RMS by which any other choice of balls must stand off; for the same balls under other
numbers `number_balls` asks for 5 mm before it returns (H18)."""

LEG_BONES = frozenset({"tibia", "fibula", "femur", "foot", "ankle", "lower leg", "leg"})
"""Bones whose proximal direction is towards the head in a CT, whatever the table position."""

ARM_BONES = frozenset({"humerus", "radius", "ulna", "forearm", "hand", "wrist", "elbow", "arm"})
"""Bones of the arm."""

_LEG_PARTS = frozenset(
    {"LEG", "LOWERLEG", "UPPERLEG", "CALF", "TIBIA", "FIBULA", "TIBIAFIBULA", "TIBFIB", "THIGH"}
    | {"FEMUR", "KNEE", "ANKLE", "FOOT", "TOE", "CALCANEUS", "HEEL", "LOWEREXTREMITY", "LOWERLIMB"}
)
_ARM_PARTS = frozenset(
    {"ARM", "UPPERARM", "FOREARM", "HUMERUS", "ULNA", "RADIUS", "RADIUSULNA", "ELBOW", "WRIST"}
    | {"HAND", "FINGER", "THUMB", "SHOULDER", "UPPEREXTREMITY", "UPPERLIMB"}
)
"""BodyPartExamined of either limb, without blanks and signs."""


def ring_rms(ring: str, rms_mm: float) -> Gate:
    """G2: rigid RMS of a ring's balls against its layout."""
    return at_most(
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


def ball_diameters(
    ring: str, diameters_mm: ArrayLike, nominal_mm: float, *, clipped: bool = False
) -> Gate:
    """G3: scale of the image, by the balls' known diameter; wider if any ball is clipped."""
    worst = float(np.max(np.abs(np.asarray(diameters_mm, float) - nominal_mm)))
    return at_most(
        "G3",
        "ball-diameter",
        f"ball diameters of the {ring} ring against {nominal_mm:g} mm",
        "H23",
        worst,
        CLIPPED_DIAMETER_LIMIT_MM if clipped else DIAMETER_LIMIT_MM,
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
    return at_most(
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
    return at_most(
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


def limbs_agree(bone: str, body_part: str | None) -> Gate:
    """H37: the case's bone against the image's BodyPartExamined, where it names a limb.

    Only an arm for a leg or a leg for an arm is a conflict: many scanners leave the word of a
    protocol there, which tells nothing.
    """
    word = "".join(letter for letter in (body_part or "").upper() if letter.isalpha())
    told = "leg" if word in _LEG_PARTS else "arm" if word in _ARM_PARTS else ""
    wanted = "leg" if bone in LEG_BONES else "arm" if bone in ARM_BONES else ""
    passed = told in ("", wanted) or not wanted
    good = f"both say {told}" if told and wanted else "the image or the case does not tell a limb"
    return Gate(
        "H37",
        "wrong-limb",
        f"limb of the bone in the case ({bone}) against the image's header",
        "H37",
        0.0 if passed else 1.0,
        0.0,
        "conflicts",
        passed,
        good if passed else f"the image's header says {told}",
        "check that image and case belong together",
    )
