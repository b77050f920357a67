"""The simulated experiment as one JSON document."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.phantom import PhantomSpec
from hexafix.phantom.spec import INSTALLATION_SIGMA_MM
from hexafix.study import experiment_statistics as statistics
from hexafix.study.experiment import ExperimentStudy, Run
from hexafix.study.experiment_chain import HAND_MM, MOTOR_MM, ROADS, WAYS, Road, Way
from hexafix.study.experiment_floor import floor_document
from hexafix.study.experiment_goals import budgets, goals, way_document
from hexafix.study.experiment_trial import (
    BEFORE_MM,
    MECHANISM_MM,
    MECHANISM_RAD,
    REDUCED_MM,
    STREAK_HU,
)

NOT_SIMULATED = (
    "the bones are planned without error in the image",
    "their end faces do not touch, so z may be negative",
    "the mechanism errs independently in the CT and at the end",
)


def experiment_document(study: ExperimentStudy) -> dict[str, Any]:
    """Everything found; values of every pose with a CT, statistics of the larger run."""
    return {
        "schema_version": 1,
        "study": "experiment",
        "simulated": True,
        "source": "Section 5.2, Tables 1 and 2",
        "settings": settings_document(study),
        "not_simulated": list(NOT_SIMULATED),
        "image_error": {
            fit: {
                "balls": error.balls,
                "bias_mm": error.bias_mm.tolist(),
                "deviation_mm": np.sqrt(np.diag(error.covariance_mm2)).tolist(),
                "rms_3d_mm": error.rms_mm,
                "worst_3d_mm": error.worst_mm,
            }
            for fit, error in study.image.items()
        },
        "installation_floor": floor_document(),
        "printed": {
            "table_1": asdict(statistics.TABLE_1),
            "table_2_before": asdict(statistics.TABLE_2_BEFORE),
            "table_2_after": asdict(statistics.TABLE_2),
        },
        "rendered": _run_document(study.rendered, values=True),
        "drawn": _run_document(study.drawn, values=False),
        "budget": {
            name: [budget.as_json() for budget in budgets(run)] for name, run in study.runs.items()
        },
        "goals": [goal.as_json() for goal in goals(study)],
    }


def settings_document(study: ExperimentStudy) -> dict[str, Any]:
    """How the experiment was run; the number of jobs changes nothing and is left out."""
    settings, scan = study.settings, PhantomSpec()
    return {
        "poses": settings.poses,
        "drawn": settings.drawn,
        "seed": settings.seed,
        "voxel_mm": settings.voxel_mm,
        "reduced_ring_distance_mm": REDUCED_MM,
        "ct_ring_distance_mm": REDUCED_MM + float(np.mean(BEFORE_MM[2])),
        "psf_sigma_mm": scan.psf_sigma_mm,
        "noise_hu": scan.noise_hu,
        "streak_hu": STREAK_HU,
        "ball_diameter_mm": scan.ball_diameter_mm,
        "installation_sigma_mm": INSTALLATION_SIGMA_MM,
        "mechanism_sigma_mm": MECHANISM_MM,
        "mechanism_sigma_deg": float(np.degrees(MECHANISM_RAD)),
        "strut_steps_mm": [MOTOR_MM, HAND_MM],
    }


def _run_document(run: Run, *, values: bool) -> dict[str, Any]:
    def part(pick: Any) -> dict[str, Any]:
        vectors = [pick(pose["all"]) for pose in run.poses]
        found = statistics.Summary.of(vectors).as_json()
        return {**found, "values": _degrees(vectors)} if values else found

    def recognised(road: Road) -> dict[str, Any]:
        return part(lambda outcome: outcome.recognised[road])

    def named(kind: str, way: Way) -> dict[str, Any]:
        return part(lambda outcome: getattr(outcome, kind)[way])

    return {
        "before": part(lambda outcome: outcome.before),
        "recognised": [{**asdict(road), "error": recognised(road)} for road in ROADS],
        "corrected": [
            {
                **way_document(way),
                **{kind: named(kind, way) for kind in ("measured", "compensated", "after")},
            }
            for way in WAYS
        ],
    }


def _degrees(vectors: list[NDArray[np.float64]]) -> list[list[float]]:
    """Pose vectors with angles in degrees."""
    scale = np.array([1.0] * 3 + [180.0 / np.pi] * 3)
    return [(vector * scale).tolist() for vector in vectors]
