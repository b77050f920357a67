"""Why a present layout is weaker than an advised one, in words."""

from __future__ import annotations

import numpy as np

from hexafix.accuracy.advised import AdviceRules, AssessedRing, Weakness
from hexafix.accuracy.layout_check import PREFERRED_DEG
from hexafix.recognition.choices import UNIQUENESS_LIMIT_MM
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM

WORTH_SAYING = 0.01
"""Share by which a predicted error must be larger to be named."""


def keeps_rules(
    ring: AssessedRing, rules: AdviceRules, *, exchange_mm: float | None, mirror: bool
) -> bool:
    """Whether a layout keeps what proposals keep, apart from the room they leave for building.

    Parameters
    ----------
    ring : AssessedRing
    rules : AdviceRules
    exchange_mm : float or None
        RMS of this ring taken for the other.
    mirror : bool
        Whether the proposals can show a mirrored image.
    """
    verdict = ring.verdict
    allowed = ("preferred", "relaxed") if rules.relaxed else ("preferred",)
    return (
        verdict.rule in allowed
        and verdict.triangle_height_mm >= MIN_TRIANGLE_HEIGHT_MM
        and verdict.uniqueness_mm >= UNIQUENESS_LIMIT_MM
        and (exchange_mm is None or exchange_mm >= UNIQUENESS_LIMIT_MM)
        and (not mirror or verdict.mirror_mm >= UNIQUENESS_LIMIT_MM)
    )


def weaknesses(
    ring: AssessedRing,
    best: AssessedRing,
    rules: AdviceRules,
    *,
    exchange_mm: float | None,
    mirror: bool,
) -> tuple[Weakness, ...]:
    """What a present ring lacks against the best proposal, the gravest first; as `keeps_rules`."""
    verdict, found = ring.verdict, []
    if verdict.triangle_height_mm < MIN_TRIANGLE_HEIGHT_MM:
        words = (
            f"the markers lie nearly on one line (triangle height {verdict.triangle_height_mm:.1f}"
            f" mm, limit {MIN_TRIANGLE_HEIGHT_MM:g} mm)"
        )
        found.append(Weakness("line", words, True))
    if verdict.rule != "preferred":
        refused = verdict.rule == "violated" or not rules.relaxed
        found.append(Weakness("sweep-gap", _gap_words(ring), refused))
    if verdict.uniqueness_mm < rules.margin_mm:
        words = (
            f"{verdict.uniqueness_words} fit with RMS {verdict.uniqueness_mm:.2f} mm (limit"
            f" {UNIQUENESS_LIMIT_MM:g} mm, advised {best.verdict.uniqueness_mm:.2f} mm)"
        )
        refused = verdict.uniqueness_mm < UNIQUENESS_LIMIT_MM
        found.append(Weakness("relabelling", words, refused))
    if exchange_mm is not None and exchange_mm < rules.margin_mm:
        words = (
            f"the rings can be taken for each other with RMS {exchange_mm:.2f} mm (limit"
            f" {UNIQUENESS_LIMIT_MM:g} mm)"
        )
        found.append(Weakness("exchange", words, exchange_mm < UNIQUENESS_LIMIT_MM))
    if mirror and verdict.mirror_mm < UNIQUENESS_LIMIT_MM:
        words = (
            f"a mirrored image fits with RMS {verdict.mirror_mm:.2f} mm: the markers are coplanar"
            f" or symmetric (extent out of their plane {verdict.out_of_plane_mm:.1f} mm; advised"
            f" RMS {best.verdict.mirror_mm:.2f} mm)"
        )
        found.append(Weakness("mirror", words, False))
    found += _error_weakness(ring, best)
    return tuple(found)


def _gap_words(ring: AssessedRing) -> str:
    """Which markers are too near, or where the ring is empty."""
    sites = sorted(ring.layout.sites, key=lambda site: np.mod(site.sweep_rad, 2 * np.pi))
    gaps = np.degrees(ring.verdict.included_angles_rad)
    smallest = int(np.argmin(gaps))
    numbers = [site.number for site in sites]
    pair = f"{numbers[smallest]} and {numbers[(smallest + 1) % len(numbers)]}"
    rule = "only the relaxed rule" if ring.verdict.rule == "relaxed" else "neither angle rule"
    return (
        f"markers {pair} are {gaps[smallest]:.0f} degrees apart ({PREFERRED_DEG:g} are preferred),"
        f" the largest gap is {gaps.max():.0f} degrees: {rule} is met"
    )


def _error_weakness(ring: AssessedRing, best: AssessedRing) -> list[Weakness]:
    """The predicted errors, where the present ones are larger."""
    now, then = ring.place_error, best.place_error
    if now is None or then is None or now.error_mm <= then.error_mm * (1.0 + WORTH_SAYING):
        return []
    mm = ring.verdict.predicted_error_mm or np.nan, best.verdict.predicted_error_mm or np.nan
    deg = np.degrees(
        [ring.verdict.predicted_error_rad or np.nan, best.verdict.predicted_error_rad or np.nan]
    )
    words = (
        f"predicted error {now.error_mm:.3f} mm at joints and bone against {then.error_mm:.3f} mm"
        f" ({100.0 * (now.error_mm / then.error_mm - 1.0):.0f} % more): joints {now.joints_mm:.3f}"
        f" against {then.joints_mm:.3f} mm, bone {now.bone_mm:.3f} against {then.bone_mm:.3f} mm;"
        f" position {mm[0]:.3f} against {mm[1]:.3f} mm, angle {deg[0]:.3f} against {deg[1]:.3f}"
        f" degrees"
    )
    return [Weakness("predicted-error", words, False)]
