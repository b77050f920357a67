"""G6, G8, G9, the rates and the layout: what struts, path and schedule must satisfy."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from hexafix.gates.gate import Gate, at_most
from hexafix.kinematics import MAX_CONDITION

STRUT_WARNING_MM = 1.0
STRUT_LIMIT_MM = 2.0
"""G6: CT and reading of one strut (H24)."""

RECOGNITION_LIMIT_MM = 1.5
RECOGNITION_LIMIT_DEG = 1.0
"""G6: |ΔX_r| beyond which compensation would hide a gross error (H33)."""

SUBTRACTION_WARNING_MM = 0.05
"""Beyond this the plan tells that subtracted pose vectors differ from composed poses (H34)."""

BASIN_LIMIT_MM = 1e-6
"""G8: second starts of the forward kinematics must agree this well (H30)."""

RECOMPUTED_LIMIT_MM = 0.2
RECOMPUTED_LIMIT_DEG = 0.1
"""G9: pose from the printed rows by another road against the plan."""


def struts_agree(differences_mm: ArrayLike, *, better_order: str | None = None) -> Gate:
    """G6: strut lengths by CT against the readings; names the strut that disagrees most.

    Parameters
    ----------
    differences_mm : array_like, shape (6,)
        Length by CT minus length by reading, mm.
    better_order : str or None
        Another order of the readings that fits far better, in words; then no difference above
        `STRUT_WARNING_MM` passes (H25).
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
    return at_most(
        "G6",
        "strut-order" if better_order else "strut-reading",
        "strut length by CT against its reading",
        "H25" if better_order else "H24",
        worst,
        STRUT_WARNING_MM if better_order else STRUT_LIMIT_MM,
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
        at_most(
            "G6",
            "recognition-error",
            "position of the recognised pose against the struts'",
            "H33",
            distance_mm,
            RECOGNITION_LIMIT_MM,
            "mm",
            **words,
        ),
        at_most(
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


def subtraction_near_composition(difference_mm: float) -> Gate:
    """H34: Eq. (32) against composed transforms; tells and never refuses.

    Parameters
    ----------
    difference_mm : float
        Largest distance of a joint of {A} at the target of Eq. (32) from the composed target.
    """
    near = bool(np.isfinite(difference_mm) and difference_mm <= SUBTRACTION_WARNING_MM)
    return Gate(
        "H34",
        "pose-vector-subtraction",
        "target by subtracted pose vectors against composed poses"
        + ("" if near else " - BEYOND ITS LIMIT, take the fused compensation"),
        "H34",
        float(difference_mm),
        SUBTRACTION_WARNING_MM,
        "mm (told)",
        True,
        "angles small enough for the paper's subtraction"
        if near
        else "the angles are too large for the paper's subtraction of pose vectors",
        "choose the fused compensation",
    )


def forward_basin(worst_mm: float, starts: int) -> Gate:
    """G8: second starts of the forward kinematics reach the same pose."""
    return at_most(
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
    return at_most(
        "G8",
        "near-singular",
        "largest condition number along the path",
        "H31",
        condition_number,
        MAX_CONDITION,
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
        at_most("G9", "recomputation", f"position {name}", "H41", distance_mm,
                 RECOMPUTED_LIMIT_MM, "mm", **words),
        at_most("G9", "recomputation", f"orientation {name}", "H41", rotation_deg,
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


def realised_rate(way_mm_per_day: float, max_rate_mm_per_day: float, step_mm: float) -> Gate:
    """H28: way of the fastest point within any day as the struts are really set.

    The path itself keeps the rate everywhere. Whole steps of the struts add about one step, which
    the schedule aims at; two are refused.
    """
    return at_most(
        "H28",
        "realised-rate",
        "largest way of a watched point within a day, struts in whole steps",
        "H28",
        way_mm_per_day,
        max_rate_mm_per_day + 2.0 * step_mm,
        "mm",
        good=f"the rate of {max_rate_mm_per_day:g} mm a day and the struts' whole steps",
        bad="whole steps of the struts move a structure too far within a day",
        next="take a smaller strut step or a lower rate",
    )
