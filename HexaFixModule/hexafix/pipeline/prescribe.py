"""From a plan to the export: recompute by another road, print, read back, write."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from hexafix import export, gates
from hexafix.case import Case
from hexafix.errors import HexaFixError
from hexafix.imaging import Volume
from hexafix.pipeline import plan_document
from hexafix.pipeline.plan import Plan, plan_recognised, recognise_checked
from hexafix.pipeline.scenery import scene_of
from hexafix.progress import Progress, silent
from hexafix.report.pdf import prescription_pdf
from hexafix.report.picture import SceneRenderer
from hexafix.report.tables import markers_mrk_json, schedule_csv
from hexafix.selftest import require_self_test

if TYPE_CHECKING:
    from hexafix.imaging.patient_identity import PatientIdentity


def plan_and_export(
    case: Case,
    folder: Path,
    *,
    volume: Volume | None = None,
    accept_relaxed_layout: bool = False,
    identified_pdf: bool = False,
    renderer: SceneRenderer | None = None,
    progress: Progress = silent,
) -> dict[str, Any]:
    """The whole chain: plan, recompute by another road, print, read back, write.

    Before the image is read, the libraries must give known answers (H54).

    Parameters
    ----------
    case : Case
    folder : Path
        Where the export goes, all or nothing.
    volume, accept_relaxed_layout, progress
        As in `plan_correction`.
    identified_pdf : bool
        Whether the prescription, and it alone, names the patient as the CT's headers do; only
        then they are read for it, and the folder is made for its owner alone.
    renderer : SceneRenderer, optional
        Started by the caller before it loaded this room, so that both load side by side; it is
        closed here.

    Returns
    -------
    dict
        The plan document, as ``plan.json`` holds it.

    Raises
    ------
    Refused
        If the self-test fails or a gate is red; nothing is written and an older export stays as
        it is.
    """
    export.check_target(folder)
    with renderer or SceneRenderer() as renderer:
        identity = _identity(case, progress) if identified_pdf else None
        require_self_test()
        recognised = recognise_checked(
            case, volume=volume, accept_relaxed_layout=accept_relaxed_layout, progress=progress
        )
        # the picture is rendered by another process while the correction is planned
        renderer.show(scene_of(case, recognised))
        progress("plan the correction", 0.0)
        plan = plan_recognised(case, recognised, accept_relaxed_layout=accept_relaxed_layout)
        progress("plan the correction", 1.0)
        prescription = _printed(plan, renderer, identity, progress)
    write_prescription(prescription, folder)
    return prescription.document


@dataclass(frozen=True, eq=False)
class Prescription:
    """A checked plan as it is written.

    Attributes
    ----------
    document : dict
        The plan document, as ``plan.json`` holds it.
    files : mapping of str to bytes
        The export's files, without its manifest.
    names_the_patient : bool
        Whether the prescription names the patient; then only the owner may enter its folder.
    """

    document: dict[str, Any]
    files: Mapping[str, bytes]
    names_the_patient: bool = False


def prescribe(
    plan: Plan,
    *,
    identified_pdf: bool = False,
    renderer: SceneRenderer | None = None,
    progress: Progress = silent,
) -> Prescription:
    """Recompute a plan by another road, print it and read the print back; nothing is written.

    Parameters
    ----------
    plan : Plan
    identified_pdf : bool
        As in `plan_and_export`.
    renderer : SceneRenderer, optional
        Started by the caller, and showing nothing yet; it is closed here.
    progress : Progress, optional

    Raises
    ------
    Refused
        If the self-test fails or the recomputation (G9) does not reach the planned pose.
    HexaFixError
        If what would be printed differs from the plan.
    """
    with renderer or SceneRenderer() as renderer:
        identity = _identity(plan.case, progress) if identified_pdf else None
        require_self_test()
        renderer.show(scene_of(plan.case, plan.recognised))
        return _printed(plan, renderer, identity, progress)


def write_prescription(prescription: Prescription, folder: Path) -> None:
    """Write the export, all or nothing.

    Raises
    ------
    InputError
        If `folder` is something else than an older export, or cannot be written.
    """
    export.check_target(folder)
    export.write_export(prescription.files, folder, private=prescription.names_the_patient)


def _printed(
    plan: Plan, renderer: SceneRenderer, identity: PatientIdentity | None, progress: Progress
) -> Prescription:
    """Document and files of a plan, recomputed and read back; the renderer shows its scene."""
    document = plan_document.plan(plan)
    progress("recompute by another road", 0.0)
    document["gates"] += [gate.as_json() for gate in _recomputed(document)]
    progress("recompute by another road", 1.0)
    progress("set the prescription", 0.0)
    # typst keeps what does not change, so the pages are set before the picture is there
    prescription_pdf(document, identity=identity)
    progress("set the prescription", 0.5)
    files = {
        "plan.json": json_bytes(document),
        "schedule.csv": schedule_csv(document),
        "markers.mrk.json": markers_mrk_json(document),
        "prescription.pdf": prescription_pdf(
            document, pictures=renderer.result(), identity=identity
        ),
    }
    from hexafix.verify import check_printed

    wrong = check_printed(document, files)
    if wrong:
        raise HexaFixError.of(
            "print-differs",
            "what would be printed differs from the plan: " + "; ".join(wrong[:3]),
            hazard="H41",
            next_step="report this case; nothing was written",
        )
    progress("set the prescription", 1.0)
    return Prescription(document, MappingProxyType(files), identity is not None)


def json_bytes(document: dict[str, Any]) -> bytes:
    """A document as it is written: the same content gives the same bytes."""
    return (json.dumps(document, indent=1, allow_nan=False, ensure_ascii=False) + "\n").encode()


def _identity(case: Case, progress: Progress) -> PatientIdentity:
    # Not at the top: only an identified prescription needs it.
    from hexafix.imaging.patient_identity import read_patient_identity

    return read_patient_identity(
        case.image_path, series_instance_uid=case.series_instance_uid, progress=progress
    )


def _recomputed(document: dict[str, Any]) -> tuple[gates.Gate, ...]:
    """G9, decided."""
    # Not at the top: its libraries load while the picture is rendered.
    from hexafix.verify import recompute

    result = recompute(document)
    found = gates.recomputed(result.distance_mm, result.rotation_deg)
    gates.decide(found)
    return found
