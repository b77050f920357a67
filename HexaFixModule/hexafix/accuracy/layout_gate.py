"""Which layouts are refused (H16, H17, H18, H20)."""

from __future__ import annotations

import numpy as np

from hexafix.accuracy.layout_check import (
    PREFERRED_DEG,
    RELAXED_MIN_DEG,
    RELAXED_SPREAD_DEG,
    LayoutCheck,
    LayoutVerdict,
)
from hexafix.errors import Fault
from hexafix.recognition.choices import UNIQUENESS_LIMIT_MM
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM


def layout_faults(
    check: LayoutCheck, *, accept_relaxed: bool = False, numbering_settled: bool = False
) -> tuple[Fault, ...]:
    """Every reason to refuse the layouts of both rings.

    Parameters
    ----------
    check : LayoutCheck
    accept_relaxed : bool
        The surgeon accepted the relaxed rule, with the predicted error on record (H17).
    numbering_settled : bool
        Strut readings or the user settle the numbers, so symmetric layouts may pass (H18, H20).
    """
    faults: list[Fault] = []
    for side, verdict in (("proximal", check.proximal), ("distal", check.distal)):
        faults += _ring_faults(side, verdict, accept_relaxed, numbering_settled)
    if (
        not numbering_settled
        and check.exchange_mm is not None
        and check.exchange_mm < UNIQUENESS_LIMIT_MM
    ):
        faults.append(
            Fault(
                "rings-alike",
                "the two rings' layouts can be taken for each other",
                f"RMS {check.exchange_mm:.2f} mm",
                f"{UNIQUENESS_LIMIT_MM:g} mm",
                "build the rings with different angles, see the advice of check-layout",
                "H20",
                "markers",
            )
        )
    return tuple(faults)


def _ring_faults(
    side: str, verdict: LayoutVerdict, accept_relaxed: bool, numbering_settled: bool
) -> list[Fault]:
    faults = []
    where = f"markers.{side}"
    if verdict.triangle_height_mm < MIN_TRIANGLE_HEIGHT_MM:
        faults.append(
            Fault(
                "collinear-markers",
                "the markers lie nearly on one line",
                f"triangle height {verdict.triangle_height_mm:.2f} mm",
                f"{MIN_TRIANGLE_HEIGHT_MM:g} mm",
                "spread the markers around the ring",
                "H16",
                where,
            )
        )
    if verdict.rule == "violated" or (verdict.rule == "relaxed" and not accept_relaxed):
        angles = ", ".join(f"{a:.1f}" for a in np.degrees(verdict.included_angles_rad))
        limit = f"minimum and median {PREFERRED_DEG:g}°"
        if accept_relaxed:
            limit = (
                f"minimum {RELAXED_MIN_DEG:g}°, maximum - median at most {RELAXED_SPREAD_DEG:g}°"
            )
        faults.append(
            Fault(
                f"angle-rule-{verdict.rule}",
                "the included angles do not meet the layout rule",
                f"{angles}°",
                limit,
                "move a marker, see the advice of check-layout",
                "H17",
                where,
            )
        )
    if not numbering_settled and verdict.uniqueness_mm < UNIQUENESS_LIMIT_MM:
        faults.append(
            Fault(
                "layout-ambiguous",
                f"the numbers cannot be told apart: {verdict.uniqueness_words} fit too",
                f"RMS {verdict.uniqueness_mm:.2f} mm",
                f"{UNIQUENESS_LIMIT_MM:g} mm",
                "move a marker, see the advice of check-layout",
                "H18",
                where,
            )
        )
    return faults
