"""How many markers: Section 4.3.1 and Fig. 5."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hexafix.accuracy.jacobian import volume_error
from hexafix.progress import Progress, silent
from hexafix.study.document import figures, model_words, settings_document
from hexafix.study.error_model import ErrorModel, error_maps, exact_covariances
from hexafix.study.estimates import Estimates, StudySettings, estimate
from hexafix.study.jacobians import jacobian_check, model_jacobians
from hexafix.study.layouts import (
    PAPER_HEIGHT_MM,
    PAPER_RADIUS_MM,
    RingLayouts,
    even_layout,
)
from hexafix.study.simulation import METHODS
from hexafix.study.verdicts import Verdict, number_verdicts

COUNTS = tuple(range(3, 11))
"""N = 3, 4, …, 10. Source: Section 4.3.1."""

CHECKED = ((0.0, 120.0, 240.0), (0.0, 45.0, 90.0), (10.0, 130.0, 200.0))
"""Layouts whose J is compared with finite differences, degrees."""


@dataclass(frozen=True, eq=False)
class NumberStudy:
    """What was found for each number of markers.

    Attributes
    ----------
    settings : StudySettings
    by_count : dict of int to Estimates
        One even layout each.
    jacobian_gap : dict of str to float
        Of `jacobian_check` over `CHECKED`.
    sensitivity : dict of str to float
        Ratios of exact volume errors when radius or height change, of the paper's model.
    verdicts : tuple of Verdict
    """

    settings: StudySettings
    by_count: dict[int, Estimates]
    jacobian_gap: dict[str, float]
    sensitivity: dict[str, float]
    verdicts: tuple[Verdict, ...]

    def as_json(self) -> dict[str, Any]:
        """The document of ``study number``."""
        rows = []
        for count, found in self.by_count.items():
            for m, method in enumerate(METHODS):
                spread = found.sampled
                errors = np.append(
                    spread.standard_error[0, m],
                    [part[0, m] for part in spread.volume_standard_error()],
                )
                full_error = [float(part[0, m]) for part in found.full_volume_error]
                rows.append(
                    {
                        "markers": count,
                        "method": method,
                        "exact": figures(found.exact[0, m]),
                        "sampled": figures(spread.mean[0, m]),
                        "sampled_standard_error": figures(errors),
                        "full": figures(found.full[0, m]),
                        "full_standard_error": {
                            "volume_mm": full_error[0],
                            "volume_deg": float(np.degrees(full_error[1])),
                        },
                    }
                )
        return {
            "schema_version": 1,
            "study": "number",
            "simulated": True,
            "source": "Section 4.3.1, Fig. 5, Eq. (26)",
            "settings": settings_document(self.settings),
            "columns": model_words(),
            "rows": rows,
            "jacobian_against_finite_differences": self.jacobian_gap,
            "sensitivity": self.sensitivity,
            "verdicts": [verdict.as_json() for verdict in self.verdicts],
        }


def study_number(
    settings: StudySettings | None = None, *, progress: Progress = silent
) -> NumberStudy:
    """Expected errors with 3 to 10 even markers, and our verdict on the paper's figures.

    Notes
    -----
    Source: Section 4.3.1, Eq. (20)-(26).
    """
    settings = settings or StudySettings()
    by_count = {
        count: estimate(even_layout(count), settings, progress, stream=count) for count in COUNTS
    }
    sensitivity = sensitivities(settings.errors)
    return NumberStudy(
        settings,
        by_count,
        jacobian_check(RingLayouts.of(CHECKED), settings.errors),
        sensitivity,
        number_verdicts(by_count, sensitivity),
    )


def sensitivities(errors: ErrorModel) -> dict[str, float]:
    """How the paper's model answers a fifth less radius and twice the height, even three markers.

    Ratios of the exact volume errors to those of the paper's ring.
    """
    ratios = {}
    base = _paper_volumes(PAPER_RADIUS_MM, PAPER_HEIGHT_MM, errors)
    for name, radius, height in (
        ("radius_80_mm", 0.8 * PAPER_RADIUS_MM, PAPER_HEIGHT_MM),
        ("height_40_mm", PAPER_RADIUS_MM, 2.0 * PAPER_HEIGHT_MM),
    ):
        found = _paper_volumes(radius, height, errors)
        ratios[f"{name}_position"] = found[0] / base[0]
        ratios[f"{name}_orientation"] = found[1] / base[1]
    return ratios


def _paper_volumes(radius_mm: float, height_mm: float, errors: ErrorModel) -> tuple[float, float]:
    ring = RingLayouts.of([[0.0, 120.0, 240.0]], radius_mm=radius_mm, height_mm=height_mm)
    maps = error_maps(model_jacobians(ring, errors), ring, errors)
    mm, rad = volume_error(exact_covariances(maps)[0, 0])
    return float(mm), float(rad)
