"""How each step is computed from its inputs: one call of the pipeline each."""

from __future__ import annotations

import hashlib
import json
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hexafix.errors import Cancelled, Fault, HexaFixError, InputError
from hexafix.presenter.engine import Engine
from hexafix.presenter.inputs import Inputs
from hexafix.presenter.results import Result
from hexafix.presenter.state import Kind, Step
from hexafix.progress import Progress, silent

Made = tuple[Any, Mapping[str, Any], tuple[Fault, ...]]


def compute(
    step: Step,
    engine: Engine,
    inputs: Inputs,
    values: Mapping[Step, Any],
    *,
    image: str,
    found: Any = None,
    progress: Progress = silent,
) -> Result:
    """The result of one step; an error becomes its refusal, only Cancelled passes through.

    Parameters
    ----------
    step : Step
    engine : Engine
    inputs : Inputs
        The version of the case that it is computed from.
    values : mapping of Step to object
        The values of the steps before it, of the same version.
    image : str
        Identity of the image; that of `Step.LOAD` itself follows from what is read.
    found : BallSet, optional
        For `Step.MARKERS`, what the search found before the user's edits.
    progress : Progress
    """
    value, document, faults, kind = None, {}, (), "refused"
    try:
        if step == Step.MARKERS:
            value, document, faults = _markers(engine, inputs, values, progress, found)
        else:
            value, document, faults = _MAKERS[step](engine, inputs, values, progress)
    except Cancelled:
        raise
    except Exception as error:
        faults, kind = faults_of_error(error), kind_of(error)
    if step == Step.LOAD and value is not None:
        image = image_identity(document)
    return Result(step, inputs.key(step, image) or "", image, value, document, faults, kind)


def loaded(inputs: Inputs, volume: Any, document: Mapping[str, Any]) -> Result:
    """The result of `Step.LOAD` of a volume that was read already, with its image document."""
    image = image_identity(document)
    return Result(Step.LOAD, inputs.key(Step.LOAD, image) or "", image, volume, document)


def search(
    engine: Engine, inputs: Inputs, volume: Any, *, image: str, progress: Progress = silent
) -> Result:
    """The balls found before the user's edits; it is kept, so that edits need no new search."""
    balls = engine.find_case_balls(
        volume, ball_diameter_mm=inputs.ball_diameter_mm, progress=progress
    )
    key = inputs.search_key(image)
    return Result(Step.MARKERS, key, image, balls, engine.balls_document(balls))


def _load(engine: Engine, inputs: Inputs, _: Any, progress: Progress) -> Made:
    volume = engine.read_image(
        inputs.image_path, series_instance_uid=inputs.series_instance_uid, progress=progress
    )
    return volume, engine.image_document(volume), ()


def _markers(
    engine: Engine, inputs: Inputs, values: Mapping[Step, Any], progress: Progress, found: Any
) -> Made:
    balls = engine.find_case_balls(
        values[Step.LOAD],
        ball_diameter_mm=inputs.ball_diameter_mm,
        **inputs.marker_edits,
        found=found,
        progress=progress,
    )
    return balls, engine.balls_document(balls), ()


def _numbering(engine: Engine, inputs: Inputs, values: Mapping[Step, Any], _: Progress) -> Made:
    judged = engine.judge_case_numbering(inputs.parts, values[Step.MARKERS])
    return judged, judged, faults_of(judged)


def _poses(engine: Engine, inputs: Inputs, values: Mapping[Step, Any], progress: Progress) -> Made:
    case = inputs.case_for(Step.POSES)
    recognised = engine.recognise_checked(
        case,
        volume=values[Step.LOAD],
        balls=values[Step.MARKERS],
        accept_relaxed_layout=inputs.version.relaxed,
        progress=progress,
    )
    return recognised, engine.recognition_document(case, recognised), ()


def _readings(engine: Engine, inputs: Inputs, values: Mapping[Step, Any], _: Progress) -> Made:
    weighed = engine.weigh_document(inputs.case_for(Step.READINGS), values[Step.POSES])
    return weighed, weighed, faults_of(weighed)


def _correction(engine: Engine, inputs: Inputs, values: Mapping[Step, Any], _: Progress) -> Made:
    preview = engine.preview_target(inputs.case_for(Step.CORRECTION), values[Step.POSES])
    return preview, preview, faults_of(preview)


def _schedule(
    engine: Engine, inputs: Inputs, values: Mapping[Step, Any], progress: Progress
) -> Made:
    progress("plan the correction", 0.0)
    plan = engine.plan_recognised(
        inputs.case_for(Step.SCHEDULE),
        values[Step.POSES],
        accept_relaxed_layout=inputs.version.relaxed,
    )
    progress("plan the correction", 1.0)
    return plan, engine.plan_document_of(plan), ()


def _export(engine: Engine, _: Inputs, values: Mapping[Step, Any], progress: Progress) -> Made:
    prescription = engine.prescribe(values[Step.SCHEDULE], progress=progress)
    return prescription, prescription.document, ()


_MAKERS = {
    Step.LOAD: _load,
    Step.NUMBERING: _numbering,
    Step.POSES: _poses,
    Step.READINGS: _readings,
    Step.CORRECTION: _correction,
    Step.SCHEDULE: _schedule,
    Step.EXPORT: _export,
}


def image_identity(document: Mapping[str, Any]) -> str:
    """Hash of what an image tells later steps: voxels, geometry and header words.

    Parameters
    ----------
    document : mapping
        The image document; its ``sha256`` is of voxels and geometry.
    """
    text = json.dumps(document, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def faults_of(document: Mapping[str, Any]) -> tuple[Fault, ...]:
    """The faults that a document tells, as `Fault.as_json` wrote them."""
    keys = ("value", "limit", "next_step", "hazard", "where")
    return tuple(
        Fault(told["code"], what_of(told), **{key: told.get(key) for key in keys})
        for told in document.get("faults", ())
    )


def what_of(told: Mapping[str, Any]) -> str:
    """The first sentence of a fault's message, without what its other fields say."""
    text = told["message"].partition(". Next step: ")[0]
    for key, mark in (("value", " (value "), ("limit", " (limit ")):
        if told.get(key) is not None:
            text = text.rpartition(mark)[0] or text
            break
    where = told.get("where")
    return text.removeprefix(f"{where}: ") if where else text


def faults_of_error(error: Exception) -> tuple[Fault, ...]:
    """The faults of an error of the program; a defect for any other."""
    return error.faults if isinstance(error, HexaFixError) else (defect(error),)


def kind_of(error: Exception) -> Kind:
    """Whether an error is a refusal of a safety gate or something wrong."""
    if isinstance(error, HexaFixError) and not isinstance(error, InputError):
        return "refused"
    return "error"


def defect(error: Exception) -> Fault:
    """A defect of HexaFix without its values: they could hold patient data (H51)."""
    frames = traceback.extract_tb(error.__traceback__)
    place = f"{Path(frames[-1].filename).name}:{frames[-1].lineno}" if frames else "unknown place"
    return Fault(
        "defect",
        f"a defect of HexaFix: {type(error).__name__} at {place}",
        next_step="nothing was written; report this place in the program",
    )
