"""The demo and the phantom commands."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, Literal

from hexafix.errors import InputError
from hexafix.progress import Progress


def run_phantom(
    out: Path,
    *,
    seed: int,
    image_format: Literal["dicom", "nrrd"],
    options: dict[str, Any],
    progress: Progress,
) -> dict[str, Any]:
    """Make a phantom in an empty folder; returns its truth."""
    from hexafix.phantom import PhantomSpec, make_phantom, write_phantom

    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InputError.of(
            "target-not-empty",
            "the phantom's folder exists and is not empty; nothing there was touched",
            where=str(out),
            next_step="choose another folder",
        )
    given = {key: value for key, value in options.items() if value is not None}
    phantom = make_phantom(PhantomSpec(seed=seed, **given), progress=progress)
    write_phantom(phantom, out, image_format=image_format, progress=progress)
    return phantom.truth


def run_demo(out: Path, *, seed: int, progress: Progress) -> tuple[dict[str, Any], str]:
    """A phantom as DICOM, planned as if a user had brought it; returns summary and its text."""
    from hexafix.case import load_case
    from hexafix.errors import Refused
    from hexafix.phantom.compare import errors_against_truth
    from hexafix.pipeline import plan_and_export
    from hexafix.verify import verify_export

    _clear_own_phantom(out / "phantom")
    truth = run_phantom(
        out / "phantom", seed=seed, image_format="dicom", options={}, progress=progress
    )
    export = out / "prescription"
    document = plan_and_export(load_case(out / "phantom" / "case.json"), export, progress=progress)
    progress("verify the export", 0.0)
    verdict = verify_export(export)
    progress("verify the export", 1.0)
    if not verdict["verified"]:
        failed = [check["name"] for check in verdict["checks"] if not check["passed"]]
        raise Refused.of(
            "not-verified", "the export does not verify: " + ", ".join(failed), hazard="H41"
        )
    errors = errors_against_truth(document, truth)
    summary = {
        "schema_version": 1,
        "simulated": True,
        "seed": seed,
        "case": str(out / "phantom" / "case.json"),
        "export": str(export),
        "verified": True,
        "checks": len(verdict["checks"]),
        "days": document["schedule"]["days"],
        "errors": errors,
    }
    return summary, _text(summary, export)


def _clear_own_phantom(folder: Path) -> None:
    """Remove the phantom of an earlier demo, and nothing else."""
    held = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if "truth.json" in held and held <= {"ct", "truth.json", "case.json"}:
        shutil.rmtree(folder)


def _text(summary: dict[str, Any], export: Path) -> str:
    errors = summary["errors"]
    return "\n".join(
        [
            "Simulated CT of a fixator on a limb, planned as if you had brought it.",
            f"  balls found {errors['balls_found']} of {errors['balls']}, centres right to "
            f"{errors['ball_rms_mm']:.4f} mm RMS (worst {errors['ball_worst_mm']:.4f})",
            f"  mechanism pose by CT     off by {errors['recognised_mm']:.3f} mm "
            f"{errors['recognised_deg']:.3f} deg",
            f"  mechanism pose by struts off by {errors['struts_mm']:.3f} mm "
            f"{errors['struts_deg']:.3f} deg",
            f"  end of the schedule      off by {errors['end_mm']:.3f} mm "
            f"{errors['end_deg']:.3f} deg (struts in whole steps)",
            f"  {summary['days']} days; verified by another road: {summary['checks']} checks pass",
            f"Open {export / 'prescription.pdf'}",
            "Research software, not a medical device.",
        ]
    )
