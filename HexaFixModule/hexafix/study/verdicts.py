"""Our verdict on each figure that the paper prints in Section 4."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.study.error_model import absolute_covariances
from hexafix.study.estimates import PAPER_SAMPLES, Estimates, volumes
from hexafix.study.layouts import angle_rules
from hexafix.study.sampling import volume_standard_errors

Array = NDArray[np.float64]

Figures = tuple[float, float, float, float]
"""Exact, sampled, full and least squares, as in `Verdict`."""

LITTLE = 1.1
"""An effect of less than a tenth counts as little."""

UNITS = ((1.0, " mm"), (180.0 / np.pi, "°"))
"""Scale and unit, as it stands behind a number, of position and orientation."""

SURE = 3.0
"""Standard errors beyond which a printed figure counts as not reproduced."""

EQUATION_26 = (
    ("x", 0.165, "mm"),
    ("y", 0.164, "mm"),
    ("z", 0.137, "mm"),
    ("α", 0.103, "°"),
    ("β", 0.106, "°"),
    ("γ", 0.079, "°"),
)
"""Expected errors with three markers as printed."""

REDUCTIONS = (("position", 27.0), ("orientation", 25.0))
"""Percent less error with six markers than with three, as printed (Section 4.3.1)."""

ANGLE_LIMITS = (
    ("preferred", "included angles 45° or more", 0.9, 0.6),
    ("above-preferred", "included angles above 45°", 0.9, 0.6),
    ("relaxed", "minimum 15° or more, maximum - median 150° or less", 1.0, 0.8),
)
"""Rule, its words, limits in mm and degrees, as printed (Section 4.3.2)."""


@dataclass(frozen=True)
class Verdict:
    """One printed figure beside ours.

    Attributes
    ----------
    claim : str
        What the figure is.
    source : str
        Where it is printed.
    unit : str
    printed : float
        A value, or the limit of a claim "less than".
    exact, sampled : float or None
        The paper's linear model of its group method, by covariance and by Monte Carlo.
    full : float or None
        Full simulation of the group method.
    least_squares : float or None
        Full simulation of weighted least squares. None where the claim is about J alone.
    status : str
        ``reproduced`` or ``not reproduced`` for values; ``holds``, ``holds in its own model
        only`` or ``optimistic`` for limits.
    words : str
        Why, with numbers.
    """

    claim: str
    source: str
    unit: str
    printed: float
    exact: float
    sampled: float | None
    full: float | None
    least_squares: float | None
    status: str
    words: str

    def as_json(self) -> dict[str, Any]:
        """The fields by name."""
        return asdict(self)


def number_verdicts(
    by_count: dict[int, Estimates], sensitivity: dict[str, float]
) -> tuple[Verdict, ...]:
    """Verdicts on Eq. (26), the gain of six markers and what Section 4 says of the trend."""
    return (*_equation_26(by_count[3]), *_reductions(by_count), *_trend(by_count, sensitivity))


def _equation_26(three: Estimates) -> Iterator[Verdict]:
    scale = np.array([1.0] * 3 + [180.0 / np.pi] * 3)
    variance = np.diagonal(absolute_covariances(three.covariance[0, 0]))
    # the paper's own chance: its K_s samples, and half a unit of the last printed decimal
    errors = np.hypot(np.sqrt(variance / PAPER_SAMPLES) * scale, 0.0005 / np.sqrt(3.0))
    for q, (name, printed, unit) in enumerate(EQUATION_26):
        ours = _each(three, lambda e, q=q: e[0, q] * scale[q])
        status, away = _reproduced(printed, ours[0], float(errors[q]))
        words = f"printed {100.0 * (printed / ours[0] - 1.0):+.1f} % from ours, {away}"
        yield Verdict(f"expected error of {name}, N = 3", "Eq. (26)", unit, printed, *ours,
                      status, words)  # fmt: skip


def _reproduced(printed: float, exact: float, error: float) -> tuple[str, str]:
    """Status and words for a printed value with its standard error."""
    away = abs(printed - exact) / error
    status = "reproduced" if away <= SURE else "not reproduced"
    return status, f"{away:.1f} standard errors of {PAPER_SAMPLES} samples"


def _reductions(by_count: dict[int, Estimates]) -> Iterator[Verdict]:
    three, six = by_count[3], by_count[6]
    for part, (name, printed) in enumerate(REDUCTIONS):
        before, after = (_each(found, lambda e, p=part: volumes(e[0])[p]) for found in (three, six))
        ours = _paired(before, after, lambda b, a: 100.0 * (1.0 - a / b))
        relative = [_volume_error(e)[part] / v[0] for e, v in ((three, before), (six, after))]
        by_chance = (100.0 - ours[0]) * np.hypot(relative[0], relative[1])
        error = float(np.hypot(by_chance, 0.5 / np.sqrt(3.0)))
        status, away = _reproduced(printed, ours[0], error)
        stated = np.linalg.norm([value for _, value, _ in EQUATION_26][3 * part : 3 * part + 3])
        implied, scale, unit = stated * (1.0 - printed / 100.0), *UNITS[part]
        words = (
            f"printed {printed - ours[0]:+.1f} points from ours, {away}; with Eq. (26) as printed"
            f" it gives {implied:.3f}{unit} for N = 6, ours {after[0] * scale:.3f}{unit}"
        )
        claim = f"less volume error of {name}, N = 6 against 3"
        yield Verdict(claim, "Section 4.3.1", "%", printed, *ours, status, words)


def _volume_error(found: Estimates) -> tuple[float, float]:
    """Chance of the paper's volume errors, of its samples, first layout, mm and rad."""
    spread = absolute_covariances(found.covariance[0, 0])
    mm, rad = volume_standard_errors(found.exact[0, 0], spread, PAPER_SAMPLES)
    return float(mm), float(rad)


def _trend(by_count: dict[int, Estimates], sensitivity: dict[str, float]) -> Iterator[Verdict]:
    """What Section 4 says in words: order of z and γ, little gain, little weight of t and h."""
    three, ten = by_count[3], by_count[10]
    for name, other, of, to in (("z", "x", 2, 0), ("γ", "α", 5, 3)):
        ours = _each(three, lambda e, of=of, to=to: e[0, of] / e[0, to])
        claim = f"error of {name} below that of {other}, N = 3"
        yield _limit(claim, "Section 4.3.1", "×", 1.0, ours)
    before, after = (_each(found, lambda e: volumes(e[0])[0]) for found in (three, ten))
    gains = _paired(before, after, lambda b, a: b / a)
    claim = "position gain of N = 10 over 3, not an order of magnitude"
    yield _limit(claim, "Section 4.3.1", "×", 10.0, gains)
    for name, key in (
        ("orientation error at t = 80 mm over 100 mm", "radius_80_mm_orientation"),
        ("position error at h = 40 mm over 20 mm", "height_40_mm_position"),
    ):
        value = sensitivity[key]
        status = "holds" if value < LITTLE else "optimistic"
        words = f"{100.0 * (value - 1.0):+.0f} %, by the paper's own Jacobian"
        claim = f"{name}: little effect"
        yield Verdict(claim, "Section 4.2", "×", 1.0, value, None, None, None, status, words)


def _limit(claim: str, source: str, unit: str, printed: float, found: Figures) -> Verdict:
    """Verdict on a claim "less than"; found: exact, sampled, full, least squares."""
    exact, _, full, _ = found
    over = 100.0 * (max(exact, full) / printed - 1.0)
    if over < 0.0:
        status, words = "holds", f"{-over:.0f} % below the printed limit"
    elif exact < printed:
        status = "holds in its own model only"
        words = f"the full simulation lies {over:.1f} % above the printed limit"
    else:
        status = "optimistic"
        words = (
            f"{100.0 * (exact / printed - 1.0):.1f} % above the printed limit by the paper's model,"
            f" {over:.1f} % in the full simulation"
        )
    return Verdict(claim, source, unit, printed, *found, status, words)


def angle_verdicts(found: Estimates) -> tuple[Verdict, ...]:
    """Verdicts on the sweep-angle principle; the worst layout of each rule decides."""
    verdicts = []
    rules = angle_rules(found.layouts)
    for rule, words, limit_mm, limit_deg in ANGLE_LIMITS:
        for part, (name, limit, unit, scale) in enumerate(
            (("position", limit_mm, "mm", 1.0), ("orientation", limit_deg, "°", 180.0 / np.pi))
        ):
            chosen = rules[rule]
            worst = _each(
                found, lambda e, p=part, c=chosen, s=scale: np.nanmax(volumes(e)[p][c]) * s
            )
            claim = f"volume error of {name}, {words}"
            verdicts.append(_limit(claim, "Section 4.3.2, Fig. 7", unit, limit, worst))
    even = np.ptp(found.layouts.included_angles_rad, axis=1) < 1e-9
    for part, name in enumerate(("position", "orientation")):
        ratios = _each(found, lambda e, p=part: volumes(e)[p][even][0] / np.nanmin(volumes(e)[p]))
        best = ratios[0] <= 1.0 + 1e-9
        status = "holds" if best else "optimistic"
        words = "the even layout has the smallest error" if best else "another layout is better"
        claim = f"{name} error of 120/120/120 over the smallest of all"
        verdicts.append(Verdict(claim, "Fig. 6", "×", 1.0, *ratios, status, words))
    return tuple(verdicts)


def _each(found: Estimates, figure: Callable[[Array], Any]) -> Figures:
    """A figure of each answer, E|ΔX| of shape (G, 6): exact, sampled, full, least squares."""
    return (
        float(figure(found.exact[:, 0])),
        float(figure(found.sampled.mean[:, 0])),
        float(figure(found.full[:, 0])),
        float(figure(found.full[:, 1])),
    )


def _paired(one: Figures, other: Figures, figure: Callable[[float, float], float]) -> Figures:
    """A figure of both, answer by answer."""
    exact, sampled, full, fit = (figure(a, b) for a, b in zip(one, other, strict=True))
    return exact, sampled, full, fit
