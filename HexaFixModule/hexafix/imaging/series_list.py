"""The series of a DICOM folder as a document, for the user's choice."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexafix.errors import InputError
from hexafix.imaging.dicom_series import SeriesSummary, scan, summarise
from hexafix.imaging.image_path import require_path
from hexafix.progress import Progress, silent


def series_document(folder: Path, *, progress: Progress = silent) -> dict[str, Any]:
    """What ``hexafix series`` prints: the one document that shows a UID, because it is asked for.

    Raises
    ------
    InputError
        If the folder cannot be read or holds no DICOM image.
    """
    found = scan(require_path(folder), progress)
    skipped = [{"reason": why, "files": count} for why, count in sorted(found.skipped.items())]
    if not found.slices:
        raise InputError.of(
            "no-dicom-image",
            "no DICOM image was found",
            value=", ".join(f"{row['files']} x {row['reason']}" for row in skipped) or "no files",
            next_step="give the folder that holds the CT slices",
        )
    return {
        "schema_version": 1,
        "series": [_series(summary) for summary in summarise(found.slices)],
        "patients": len({item.patient for item in found.slices}),
        "skipped": skipped,
    }


def _series(summary: SeriesSummary) -> dict[str, Any]:
    spacing, tilt = summary.spacing_mm, summary.tilt_deg
    return {
        "number": summary.number,
        "series_instance_uid": summary.series_instance_uid,
        "modality": summary.modality,
        "image_type": list(summary.image_type),
        "slices": summary.slices,
        "size_ij": list(summary.size_ij),
        "spacing_mm": None if spacing is None else [round(value, 6) for value in spacing],
        "orientation": summary.orientation,
        "tilt_deg": None if tilt is None else round(tilt, 4),
        "usable": summary.excluded is None and not summary.faults,
        "left_out": summary.excluded,
        "refused": [fault.as_json() for fault in summary.faults],
        "description": summary.description,
    }
