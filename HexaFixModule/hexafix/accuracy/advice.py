"""Better layouts: the same rings with a marker or two moved to other angles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.accuracy.advised import AdviceRules, RingPlaces, RingTask
from hexafix.accuracy.advisor import advise
from hexafix.accuracy.fewest_moves import fewest_moves
from hexafix.accuracy.jacobian import isotropic_covariances, volume_error
from hexafix.accuracy.layout_candidates import MARKERS
from hexafix.accuracy.layout_check import (
    PREFERRED_DEG,
    UNIQUENESS_TARGET_MM,
    LayoutCheck,
    LayoutVerdict,
    angle_rule,
    check_layout,
    exchange_rms_mm,
)
from hexafix.accuracy.uniqueness import (
    around_ring,
    best_relabelling,
    numberings_around,
    wrong_numberings,
)
from hexafix.errors import LayoutRejected
from hexafix.hardware import MarkerLayout, MarkerSite
from hexafix.recognition.choices import UNIQUENESS_LIMIT_MM
from hexafix.recognition.least_squares import IMAGE_SIGMA_MM, INSTALLATION_SIGMA_MM
from hexafix.recognition.rigid import rigid_rms_mm

STEP_DEG, PAIR_STEP_DEG = 5, 15
"""Steps of the angles when one marker or two are moved."""

MAX_TESTED = 150
"""Most accurate candidates tested for uniqueness."""


@dataclass(frozen=True, eq=False)
class Suggestion:
    """A better layout of one ring.

    Attributes
    ----------
    layout : MarkerLayout
    moves : tuple of (int, float, float)
        Marker number, its angle now and its new angle, degrees.
    uniqueness_mm : float
        RMS of the best wrong numbering, or of the other ring taken for this one.
    error_mm, error_rad : float
        Expected volume error of the least-squares pose.
    move_words : tuple of str
        The moves in words where heights change too.
    """

    layout: MarkerLayout
    moves: tuple[tuple[int, float, float], ...]
    uniqueness_mm: float
    error_mm: float
    error_rad: float
    move_words: tuple[str, ...] = ()

    @property
    def words(self) -> str:
        """The suggestion as one sentence."""
        words = self.move_words or [
            f"marker {number} from {old:g} to {new:g} degrees" for number, old, new in self.moves
        ]
        moved = " and ".join(f"move {move}" for move in words)
        return (
            f"{moved}: unique by {self.uniqueness_mm:.1f} mm, predicted error"
            f" {self.error_mm:.2f} mm, {np.degrees(self.error_rad):.2f} degrees"
        )


def check_layouts(
    proximal: MarkerLayout,
    distal: MarkerLayout,
    *,
    sigma_image_mm: float = IMAGE_SIGMA_MM,
    sigma_installation_mm: ArrayLike = INSTALLATION_SIGMA_MM,
    places: tuple[RingPlaces | None, RingPlaces | None] = (None, None),
) -> LayoutCheck:
    """Check both rings' layouts and advise better ones.

    Parameters
    ----------
    proximal, distal : MarkerLayout
    sigma_image_mm, sigma_installation_mm
        As in `check_layout`.
    places : pair of RingPlaces or None
        Where each ring can carry markers; without, markers are moved to any angle.
    """
    verdicts = [
        check_layout(
            layout, sigma_image_mm=sigma_image_mm, sigma_installation_mm=sigma_installation_mm
        )
        for layout in (proximal, distal)
    ]
    exchange = exchange_rms_mm(proximal, distal)
    sigma = float(
        np.sqrt(sigma_image_mm**2 + np.mean(np.square(np.asarray(sigma_installation_mm, float))))
    )
    advice: list[str] = []
    built = proximal
    for side, layout, verdict, known in zip(
        ("proximal", "distal"), (proximal, distal), verdicts, places, strict=True
    ):
        other = built if side == "distal" else None
        reasons = _reasons(verdict)
        if other is not None and exchange is not None and exchange < UNIQUENESS_LIMIT_MM:
            reasons.append(f"it can be taken for the proximal ring (RMS {exchange:.2f} mm)")
        if not reasons:
            continue
        if known is not None and MARKERS[0] <= len(layout) <= MARKERS[1]:
            better = best_on_places(layout, known, other=other, sigma_mm=sigma)
            missing = "the free places allow no better layout; add a marker or free a hole"
        else:
            better = better_layout(layout, other=other, sigma_mm=sigma)
            missing = "no better angles were found; add a marker"
        proposal = better.words if better else missing
        advice.append(f"{side} ring: {'; '.join(reasons)}; {proposal}")
        if side == "proximal" and better is not None:
            built = better.layout
    flat = [
        side
        for side, v in zip(("proximal", "distal"), verdicts, strict=True)
        if v.mirror_mm < UNIQUENESS_LIMIT_MM
    ]
    if len(flat) == 2:
        advice.append(
            "neither ring can show a mirrored image: a fourth marker 25 mm out of the plane of the"
            " others, on one ring, would"
        )
    return LayoutCheck(verdicts[0], verdicts[1], exchange, tuple(advice))


def best_on_places(
    layout: MarkerLayout, known: RingPlaces, *, other: MarkerLayout | None, sigma_mm: float
) -> Suggestion | None:
    """The best layout that moves one marker to a free place, or two, or as many as it takes."""
    task = RingTask("ring", known.places, len(layout), known.target, layout)
    rules = AdviceRules(sigma_image_mm=sigma_mm, sigma_installation_mm=0.0)
    ring = None
    for mirror in (True, False) if len(layout) > MARKERS[0] else (False,):
        ring = ring or fewest_moves(task, rules, mirror=mirror, other=other)
    if ring is None:
        try:
            ring = advise([task], rules=rules, top=1, other=other).proposals[0].rings[0]
        except LayoutRejected:
            return None
    exchange = None if other is None else exchange_rms_mm(ring.layout, other)
    unique = ring.verdict.uniqueness_mm
    return Suggestion(
        ring.layout,
        tuple((move.number, move.from_deg, move.to_deg) for move in ring.moves),
        unique if exchange is None else min(unique, exchange),
        ring.verdict.predicted_error_mm or np.nan,
        ring.verdict.predicted_error_rad or np.nan,
        tuple(move.words for move in ring.moves),
    )


def _reasons(verdict: LayoutVerdict) -> list[str]:
    """What a ring's own layout lacks."""
    reasons = []
    if verdict.uniqueness_mm < UNIQUENESS_LIMIT_MM:
        reasons.append(
            f"not unique: {verdict.uniqueness_words} fit with RMS {verdict.uniqueness_mm:.2f} mm"
            f" (limit {UNIQUENESS_LIMIT_MM:g} mm)"
        )
    if verdict.rule != "preferred":
        angles = ", ".join(f"{a:.0f}" for a in np.degrees(verdict.included_angles_rad))
        reasons.append(f"included angles {angles} degrees do not meet {PREFERRED_DEG:g} degrees")
    return reasons


def better_layout(
    layout: MarkerLayout, *, other: MarkerLayout | None = None, sigma_mm: float
) -> Suggestion | None:
    """The most accurate unique layout with one marker moved, or two.

    Parameters
    ----------
    layout : MarkerLayout
    other : MarkerLayout, optional
        The other ring's layout, which must not be taken for this one.
    sigma_mm : float
        Image and installation error together, along each axis.
    """
    count = len(layout)
    for together, step in ((1, STEP_DEG), (2, PAIR_STEP_DEG)):
        if together == 2 and count > 6:
            break
        sweeps = np.vstack(
            [_moved(layout, list(which), step) for which in combinations(range(count), together)]
        )
        found = _first_unique(layout, sweeps, other, sigma_mm)
        if found is not None:
            return found
    return None


def _moved(layout: MarkerLayout, which: list[int], step_deg: int) -> NDArray[np.float64]:
    """Sweep angles with some markers at every multiple of the step, shape (K, N), degrees."""
    now = np.degrees([site.sweep_rad for site in layout.sites])
    grid = np.arange(0, 360, step_deg, dtype=float)
    places = np.stack(np.meshgrid(*[grid] * len(which), indexing="ij"), -1).reshape(-1, len(which))
    sweeps = np.tile(now, (len(places), 1))
    sweeps[:, which] = places
    return sweeps


def _first_unique(
    layout: MarkerLayout, sweeps_deg: NDArray[np.float64], other: MarkerLayout | None, sigma: float
) -> Suggestion | None:
    """The most accurate candidate that is unique; sweeps (K, N), degrees."""
    around = np.sort(np.mod(sweeps_deg, 360.0), axis=1)
    gaps = np.diff(np.concatenate([around, around[:, :1] + 360.0], axis=1), axis=1)
    # With many markers an even ring has gaps below 45°; half of the even gap keeps them apart.
    sweeps = sweeps_deg[gaps.min(axis=1) >= min(PREFERRED_DEG, 180.0 / len(layout)) - 1e-6]
    if len(sweeps) == 0:
        return None
    t = np.array([site.radius_mm for site in layout.sites])
    h = np.array([site.height_mm for site in layout.sites])
    phi = np.radians(sweeps)
    points = np.stack([t * np.cos(phi), t * np.sin(phi), np.broadcast_to(h, phi.shape)], axis=-1)
    error_mm, error_rad = volume_error(isotropic_covariances(points, sigma))
    now = np.degrees([site.sweep_rad for site in layout.sites])
    far = np.abs(np.mod(sweeps - now + 180.0, 360.0) - 180.0).sum(axis=1)
    # Millimetres and degrees weigh alike, as at 57 mm; the shortest way breaks ties.
    score = np.round(error_mm + np.degrees(error_rad), 6)
    tested = np.lexsort((far, score))[:MAX_TESTED]
    for k in tested[_guessed_rms(points[tested], phi[tested], other) >= UNIQUENESS_TARGET_MM]:
        candidate = MarkerLayout(
            tuple(
                MarkerSite(site.number, site.radius_mm, float(angle), site.height_mm)
                for site, angle in zip(layout.sites, phi[k], strict=True)
            )
        )
        unique = best_relabelling(candidate)[0]
        exchange = exchange_rms_mm(candidate, other) if other is not None else None
        unique = unique if exchange is None else min(unique, exchange)
        if unique < UNIQUENESS_TARGET_MM or angle_rule(candidate) != "preferred":
            continue
        moves = tuple(
            (site.number, float(round(old, 6)), float(round(new, 6)))
            for site, old, new in zip(layout.sites, now, sweeps[k], strict=True)
            if abs(old - new) > 1e-6
        )
        return Suggestion(candidate, moves, unique, float(error_mm[k]), float(error_rad[k]))
    return None


def _guessed_rms(
    points: NDArray[np.float64], sweep_rad: NDArray[np.float64], other: MarkerLayout | None
) -> NDArray[np.float64]:
    """RMS of the likeliest wrong numberings, shape (K,), mm: never below the true uniqueness.

    Points (K, N, 3) in the ring frame, mm, sweep angles (K, N).
    """
    tried = wrong_numberings(sweep_rad)
    rows = np.arange(len(points))[:, None, None]
    rms = rigid_rms_mm(points_mm=points[rows, tried], layout_mm=points[:, None]).min(axis=1)
    if other is None or len(other) != points.shape[1]:
        return rms
    around = around_ring(np.array([[site.sweep_rad for site in other.sites]]))
    ring = around_ring(sweep_rad)
    tried = numberings_around(ring, np.broadcast_to(around, ring.shape))
    exchanged = rigid_rms_mm(points_mm=points[rows, tried], layout_mm=other.points_mm)
    return np.minimum(rms, exchanged.min(axis=1))
