"""How each step is computed from its inputs: one call of the pipeline each."""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexafix.errors import Fault, HexaFixError, InputError
from hexafix.presenter.engine import Engine
from hexafix.presenter.inputs import Inputs
from hexafix.presenter.state import Kind, Step
from hexafix.progress import Progress, silent

LIVE = (Step.NUMBERING, Step.READINGS, Step.CORRECTION)
"""Steps that take milliseconds and follow every edit at once."""


@dataclass(frozen=True)
class Outcome:
    """What a step gave, or why it did not."""

    value: Any = None
    document: Mapping[str, Any] | None = None
    faults: tuple[Fault, ...] = ()
    kind: Kind = "refused"


def compute(
    step: Step,
    engine: Engine,
    inputs: Inputs,
    values: Mapping[Step, Any],
    progress: Progress = silent,
) -> Outcome:
    """The value of one step.

    Parameters
    ----------
    step : Step
    engine : Engine
    inputs : Inputs
        The version of the case that it is computed from.
    values : mapping of Step to object
        The values of the steps before it, of the same version.
    progress : Progress
    """
    made = _MAKERS[step](engine, inputs, values, progress)
    return Outcome(*made)


def _load(engine: Engine, inputs: Inputs, _: Any, progress: Progress) -> tuple[Any, Any]:
    volume = engine.read_image(
        inputs.image_path, series_instance_uid=inputs.series_instance_uid, progress=progress
    )
    return volume, engine.image_document(volume)


def _markers(engine: Engine, inputs: Inputs, values: Any, progress: Progress) -> tuple[Any, Any]:
    balls = engine.find_case_balls(
        values[Step.LOAD],
        ball_diameter_mm=inputs.ball_diameter_mm,
        **inputs.marker_edits,
        progress=progress,
    )
    return balls, engine.balls_document(balls)


def _numbering(engine: Engine, inputs: Inputs, values: Any, _: Progress) -> tuple[Any, ...]:
    judged = engine.judge_case_numbering(inputs.parts, values[Step.MARKERS])
    return judged, judged, faults_of(judged)


def _poses(engine: Engine, inputs: Inputs, values: Any, progress: Progress) -> tuple[Any, Any]:
    case = inputs.case_for(Step.POSES)
    recognised = engine.recognise_checked(
        case,
        volume=values[Step.LOAD],
        balls=values[Step.MARKERS],
        accept_relaxed_layout=inputs.version.relaxed,
        progress=progress,
    )
    return recognised, engine.recognition_document(case, recognised)


def _readings(engine: Engine, inputs: Inputs, values: Any, _: Progress) -> tuple[Any, ...]:
    weighed = engine.weigh_document(inputs.case_for(Step.READINGS), values[Step.POSES])
    return weighed, weighed, faults_of(weighed)


def _correction(engine: Engine, inputs: Inputs, values: Any, _: Progress) -> tuple[Any, ...]:
    preview = engine.preview_target(inputs.case_for(Step.CORRECTION), values[Step.POSES])
    return preview, preview, faults_of(preview)


def _schedule(engine: Engine, inputs: Inputs, values: Any, progress: Progress) -> tuple[Any, Any]:
    progress("plan the correction", 0.0)
    plan = engine.plan_recognised(
        inputs.case_for(Step.SCHEDULE),
        values[Step.POSES],
        accept_relaxed_layout=inputs.version.relaxed,
    )
    progress("plan the correction", 1.0)
    return plan, engine.plan_document_of(plan)


def _export(engine: Engine, _: Inputs, values: Any, progress: Progress) -> tuple[Any, Any]:
    prescription = engine.prescribe(values[Step.SCHEDULE], progress=progress)
    return prescription, prescription.document


_MAKERS = {
    Step.LOAD: _load,
    Step.MARKERS: _markers,
    Step.NUMBERING: _numbering,
    Step.POSES: _poses,
    Step.READINGS: _readings,
    Step.CORRECTION: _correction,
    Step.SCHEDULE: _schedule,
    Step.EXPORT: _export,
}


def image_identity(volume: Any, document: Mapping[str, Any]) -> str:
    """Hash of everything an image can tell later steps: voxels, geometry, header words.

    Parameters
    ----------
    volume : Volume
    document : mapping
        Its image document.
    """
    source = getattr(volume, "source", None)
    words = [getattr(source, name, None) for name in ("laterality", "body_part", "kind")]
    text = json.dumps([document, words], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def faults_of(document: Mapping[str, Any]) -> tuple[Fault, ...]:
    """The faults that a live document tells."""
    return tuple(
        Fault(
            fault["code"],
            fault.get("what") or fault["message"],
            hazard=fault.get("hazard"),
            next_step=fault.get("next_step") if "what" in fault else None,
        )
        for fault in document.get("faults", ())
    )


def outcome_of(error: Exception) -> Outcome:
    """What an error says of the step it ended: a refusal, a wrong input or a defect."""
    if isinstance(error, HexaFixError):
        kind: Kind = "error" if isinstance(error, InputError) else "refused"
        return Outcome(faults=error.faults, kind=kind)
    return Outcome(faults=(defect(error),), kind="error")


def defect(error: Exception) -> Fault:
    """A defect of HexaFix without its values: they could hold patient data (H51)."""
    frame = traceback.extract_tb(error.__traceback__)[-1]
    return Fault(
        "defect",
        f"a defect of HexaFix: {type(error).__name__} at {Path(frame.filename).name}:"
        f"{frame.lineno}",
        next_step="nothing was written; report this place in the program",
    )
