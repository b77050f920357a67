"""The error budget of the simulated experiment, its goals, and what bounds them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.study.experiment import ExperimentStudy, Run
from hexafix.study.experiment_chain import (
    ALONE,
    BUDGET_WAYS,
    HAND_MM,
    MOTOR_MM,
    OURS,
    Way,
)
from hexafix.study.experiment_statistics import Summary

Array = NDArray[np.float64]

RECOGNITION_MM, RECOGNITION_DEG = 0.14, 0.07
FUSED_MM, FUSED_DEG = 0.08, 0.04
REDUCED_MEAN_MM, REDUCED_SPREAD_MM, REDUCED_DEG = 0.1, 0.2, 0.08
"""Goals: volume errors of Table 1, alone and fused; mean, deviation and angle of Table 2."""


@dataclass(frozen=True, eq=False)
class Budget:
    """Mean volume errors with one source on at a time, shape (2,) each, mm and degrees.

    Attributes
    ----------
    name : str
        What is budgeted.
    way : Way
    alone : dict of str to ndarray
        By source; a source that cannot act is 0.
    together : ndarray
        With all of them.
    error : ndarray
        Standard error of `together`.
    """

    name: str
    way: Way
    alone: dict[str, Array]
    together: Array
    error: Array

    @property
    def shares(self) -> dict[str, Array]:
        """Each source's part of the sum of squares."""
        total = sum((part**2 for part in self.alone.values()), np.zeros(2))
        return {
            name: np.divide(part**2, total, out=np.zeros(2), where=total > 0.0)
            for name, part in self.alone.items()
        }

    def as_json(self) -> dict[str, Any]:
        """By source, with shares."""
        shares = self.shares
        return {
            "quantity": self.name,
            **way_document(self.way),
            "alone": {
                name: {
                    "volume_mean_mm": float(part[0]),
                    "volume_mean_deg": float(part[1]),
                    "share_mm": float(shares[name][0]),
                    "share_deg": float(shares[name][1]),
                }
                for name, part in self.alone.items()
            },
            "together": {
                "volume_mean_mm": float(self.together[0]),
                "volume_mean_deg": float(self.together[1]),
                "volume_error_mm": float(self.error[0]),
                "volume_error_deg": float(self.error[1]),
            },
        }


def way_document(way: Way) -> dict[str, Any]:
    """A way by name."""
    return {
        "fit": way.road.fit,
        "method": way.road.method,
        "markers": way.road.markers,
        "compensation": way.mode,
        "strut_step_mm": way.scale_mm,
    }


def budgets(run: Run) -> list[Budget]:
    """Recognition, compensated pose and reduced bones of the paper's chain and of ours."""
    found = []
    for name, quantity, ways in (
        ("recognised", lambda way, source: run.recognised(way.road, source),
         [way for way in BUDGET_WAYS if way.scale_mm == MOTOR_MM]),
        ("compensated", run.compensated, BUDGET_WAYS),
        ("after", run.after, BUDGET_WAYS),
    ):  # fmt: skip
        for way in ways:
            together: Summary = quantity(way, "all")
            found.append(
                Budget(
                    name,
                    way,
                    {source: quantity(way, source).volume_mean for source in ALONE},
                    together.volume_mean,
                    together.volume_error,
                )
            )
    return found


@dataclass(frozen=True)
class Goal:
    """A goal and what came out.

    Attributes
    ----------
    name : str
    unit : str
        ``mm`` or ``deg``.
    limit : float
    rendered, drawn, drawn_error : float
        Value of the poses with CT, of the larger run, and the latter's standard error.
    bound : str
        The source with the largest part in the larger run, in words.
    """

    name: str
    unit: str
    limit: float
    rendered: float
    drawn: float
    drawn_error: float
    bound: str

    @property
    def met(self) -> dict[str, bool]:
        """Whether each run keeps the limit."""
        return {"rendered": self.rendered <= self.limit, "drawn": self.drawn <= self.limit}

    def as_json(self) -> dict[str, Any]:
        """By name."""
        return {
            "name": self.name,
            "unit": self.unit,
            "limit": self.limit,
            "rendered": self.rendered,
            "drawn": self.drawn,
            "drawn_standard_error": self.drawn_error,
            "met": self.met,
            "bound": self.bound,
        }


SCALE_WORDS = {MOTOR_MM: "motor struts", HAND_MM: "struts turned by hand"}


def goals(study: ExperimentStudy) -> list[Goal]:
    """Every goal on both scales, with what bounds it."""
    found = [
        *_volume_goals(study, "Table 1, image alone", (RECOGNITION_MM, RECOGNITION_DEG), None),
    ]
    for scale, words in SCALE_WORDS.items():
        way = Way(OURS, "calibrated", scale)
        found += _volume_goals(
            study, f"Table 1, struts fused in, {words}", (FUSED_MM, FUSED_DEG), way
        )
        found += _reduced_goals(study, words, way)
    return found


def _volume_goals(
    study: ExperimentStudy, name: str, limits: tuple[float, float], way: Way | None
) -> list[Goal]:
    quantity = "recognised" if way is None else "compensated"

    def of(run: Run) -> Summary:
        return run.recognised(OURS) if way is None else run.compensated(way)

    both = of(study.rendered), of(study.drawn)
    bound = _bounds(study.drawn, quantity, way or Way(OURS, "calibrated", MOTOR_MM))
    return [
        Goal(
            f"{name}, mean volume error", unit, limits[k],
            float(both[0].volume_mean[k]), float(both[1].volume_mean[k]),
            float(both[1].volume_error[k]), bound[k],
        )
        for k, unit in enumerate(("mm", "deg"))
    ]  # fmt: skip


def _reduced_goals(study: ExperimentStudy, words: str, way: Way) -> list[Goal]:
    few, many = study.rendered.after(way), study.drawn.after(way)
    bound = _bounds(study.drawn, "after", way)
    values = 3 * many.poses
    found = []
    for name, k, limit, attribute, error in (
        ("|mean|", 0, REDUCED_MEAN_MM, "pooled_mean", 1.0),
        ("standard deviation", 0, REDUCED_SPREAD_MM, "pooled_deviation", 0.5),
        ("|mean|", 1, REDUCED_DEG, "pooled_mean", 1.0),
        ("standard deviation", 1, REDUCED_DEG, "pooled_deviation", 0.5),
    ):
        found.append(
            Goal(
                f"Table 2, {words}, {name}",
                "mm" if k == 0 else "deg",
                limit,
                abs(float(getattr(few, attribute)[k])),
                abs(float(getattr(many, attribute)[k])),
                float(many.pooled_deviation[k] * np.sqrt(error / values)),
                bound[k],
            )
        )
    return found


def _bounds(run: Run, quantity: str, way: Way) -> tuple[str, str]:
    """The largest source for position and for orientation, in words."""
    budget = next(b for b in budgets(run) if b.name == quantity and b.way == way)
    words = []
    for k, unit in enumerate((" mm", "°")):
        name, share = max(budget.shares.items(), key=lambda item: item[1][k])
        part = budget.alone[name][k]
        words.append(f"{name} alone {part:.3f}{unit}, {share[k]:.0%} of the squares")
    return words[0], words[1]
