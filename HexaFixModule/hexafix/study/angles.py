"""Where three markers sit: Section 4.3.2 and Fig. 6, 7."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.progress import Progress, silent
from hexafix.study.document import model_words, settings_document
from hexafix.study.estimates import Estimates, StudySettings, estimate, volumes
from hexafix.study.layouts import angle_rules, three_marker_layouts
from hexafix.study.simulation import METHODS
from hexafix.study.verdicts import Verdict, angle_verdicts

Array = NDArray[np.float64]

RULES = {
    "all": "every layout",
    "relaxed": "minimum ≥ 15°, maximum - median ≤ 150°",
    "preferred": "minimum and median ≥ 45°",
    "above-preferred": "minimum and median > 45°",
    "ninety": "minimum ≥ 90°",
    "even": "120/120/120",
}
"""Sets of layouts in the table, the widest first."""

FULL_SAMPLES = 100
"""Enough for the full simulation of a layout: the linear model as control variate leaves a standard
error below 1 % of its volume error for every layout that keeps a rule."""


@dataclass(frozen=True, eq=False)
class AnglesStudy:
    """What was found for every layout.

    Attributes
    ----------
    settings : StudySettings
    step_deg : int
    found : Estimates
        Layouts sorted as in Fig. 7.
    verdicts : tuple of Verdict
    """

    settings: StudySettings
    step_deg: int
    found: Estimates
    verdicts: tuple[Verdict, ...]

    @property
    def selections(self) -> dict[str, NDArray[np.bool_]]:
        """The layouts of each of `RULES`, shape (G,)."""
        layouts = self.found.layouts
        even = np.ptp(layouts.included_angles_rad, axis=1) < 1e-9
        rules = angle_rules(layouts)
        return {"all": np.ones(len(layouts), bool), **rules, "even": even}

    @property
    def columns(self) -> dict[str, Array]:
        """Volume errors of every layout by name, shape (G,), mm and degrees; NaN: refused (H16)."""
        columns = {}
        spread = self.found.sampled.volume_standard_error()
        for m, method in enumerate(METHODS):
            for name, values in (
                ("exact", volumes(self.found.exact[:, m])),
                ("sampled", volumes(self.found.sampled.mean[:, m])),
                ("sampled_standard_error", (spread[0][:, m], spread[1][:, m])),
                ("full", volumes(self.found.full[:, m])),
                ("full_standard_error", tuple(e[:, m] for e in self.found.full_volume_error)),
            ):
                columns[f"{method}_{name}_mm"] = values[0]
                columns[f"{method}_{name}_deg"] = np.degrees(values[1])
        return columns

    @property
    def by_rule(self) -> list[dict[str, Any]]:
        """The worst layout of each rule, one row a rule and method."""
        gaps = np.degrees(self.found.layouts.included_angles_rad)
        columns = self.columns
        rows = []
        for rule, chosen in self.selections.items():
            for method in METHODS:
                row: dict[str, Any] = {"rule": rule, "words": RULES[rule], "method": method}
                row["layouts"] = int(np.count_nonzero(chosen))
                for answer in ("exact", "sampled", "full"):
                    for unit in ("mm", "deg"):
                        values = np.where(chosen, columns[f"{method}_{answer}_{unit}"], np.nan)
                        at = int(np.nanargmax(values))
                        row[f"worst_{answer}_{unit}"] = float(values[at])
                        if answer == "exact":
                            angles = np.round(np.sort(gaps[at]), 6).tolist()
                            row[f"worst_{unit}_at_deg"] = angles
                rows.append(row)
        return rows

    def as_json(self) -> dict[str, Any]:
        """The document of ``study angles``."""
        layouts = self.found.layouts
        gaps = np.round(np.degrees(layouts.included_angles_rad), 6)
        return {
            "schema_version": 1,
            "study": "angles",
            "simulated": True,
            "source": "Section 4.3.2, Fig. 6, Fig. 7",
            "settings": {**settings_document(self.settings), "step_deg": self.step_deg},
            "columns": model_words(),
            "by_rule": self.by_rule,
            "verdicts": [verdict.as_json() for verdict in self.verdicts],
            "layouts": {
                "included_angles_deg": gaps.tolist(),
                **{
                    name: [float(v) if np.isfinite(v) else None for v in values]
                    for name, values in self.columns.items()
                },
            },
        }


def study_angles(
    settings: StudySettings | None = None, *, step_deg: int = 5, progress: Progress = silent
) -> AnglesStudy:
    """Volume errors of every layout of three markers on a grid, and our verdict on the rules.

    Notes
    -----
    Source: Section 4.3.2, Eq. (27), (28).
    """
    settings = settings or StudySettings(full_samples=FULL_SAMPLES)
    found = estimate(three_marker_layouts(step_deg), settings, progress)
    return AnglesStudy(settings, step_deg, found, angle_verdicts(found))
