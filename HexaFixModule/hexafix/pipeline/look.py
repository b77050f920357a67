"""The steps before the numbering: series, image, balls, and the user's corrections of them."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hexafix.imaging import Volume, read_volume
from hexafix.markers import BallSet, MarkerEdits, edited_balls, find_balls
from hexafix.pipeline.document import found_balls, image_content
from hexafix.progress import Progress, silent

DARKEST_HU = -300.0
"""Lower end of the suggested grey window: fat and air about the limb stay dark."""

BRIGHTEST_HU = 1500.0, 3500.0
"""Range of its upper end: bright enough for the cortex, and to see a ball's edge beside metal."""

METAL_SHARE = 5e-4
"""Share of the voxels that may be brighter than the window's upper end."""

SAMPLED = 500_000
"""Voxels looked at for the window."""


SCIPY = (
    *("scipy.linalg.lapack", "scipy.ndimage", "scipy.sparse", "scipy.spatial.transform"),
    "scipy.special",
)
"""What the chain from balls to schedule uses of SciPy."""


def image_series(path: Path, *, progress: Progress = silent) -> dict[str, Any]:
    """The series of a DICOM folder, for the user's choice: what ``hexafix series`` prints.

    Raises
    ------
    InputError
        If the folder cannot be read or holds no DICOM image.
    """
    # Not at the top: pydicom takes half a second to import.
    from hexafix.imaging.series_list import series_document

    return series_document(Path(path), progress=progress)


def read_image(
    path: Path, *, series_instance_uid: str | None = None, progress: Progress = silent
) -> Volume:
    """Read a CT, refusing what cannot be trusted; see `hexafix.imaging.read_volume`."""
    return read_volume(Path(path), series_instance_uid=series_instance_uid, progress=progress)


def image_document(volume: Volume) -> dict[str, Any]:
    """What an image is, and a grey window that shows bone and balls.

    Returns
    -------
    dict
        The ``image`` keys of ``plan.json``, more of its header, and ``window_hu`` and ``level_hu``.
    """
    size, spacing = np.array(volume.size_ijk), volume.spacing_mm
    return {
        "schema_version": 1,
        **image_content(volume),
        "warnings": list(volume.source.warnings),
        "slices": volume.size_ijk[2],
        "slice_thickness_mm": volume.source.slice_thickness_mm,
        "extent_mm": [round(float(x), 3) for x in size * spacing],
        "laterality": volume.source.laterality,
        "body_part": volume.source.body_part,
        **_window(volume),
    }


def _window(volume: Volume) -> dict[str, float]:
    """Window and level in HU, from the image's own brightest matter."""
    step = max(1, round((volume.voxels.size / SAMPLED) ** (1 / 3)))
    sample = np.asarray(volume.voxels[::step, ::step, ::step], float)
    high = float(np.clip(np.quantile(sample, 1.0 - METAL_SHARE), *BRIGHTEST_HU))
    return {
        "window_hu": round(high - DARKEST_HU),
        "level_hu": round(0.5 * (high + DARKEST_HU)),
    }


def find_case_balls(
    volume: Volume,
    *,
    ball_diameter_mm: float,
    added_lps_mm: ArrayLike = (),
    removed_lps_mm: ArrayLike = (),
    found: BallSet | None = None,
    progress: Progress = silent,
) -> BallSet:
    """Find the balls, then take out and put in what the user says.

    Parameters
    ----------
    volume : Volume
    ball_diameter_mm : float
    added_lps_mm, removed_lps_mm : array_like, shape (N, 3)
        Points in LPS, mm; a ball that was dragged stands in both.
    found : BallSet, optional
        What `find_case_balls` found in this volume without edits: then it is not searched again.
    progress : Progress, optional

    Raises
    ------
    InputError, MarkersNotFound
        If an edit cannot be done; see `hexafix.markers.edited_balls`.
    """
    edits = MarkerEdits(
        added_lps_mm=np.asarray(added_lps_mm, float),
        removed_lps_mm=np.asarray(removed_lps_mm, float),
    )
    if found is None:
        _load_scipy()
        found = find_balls(volume, ball_diameter_mm=ball_diameter_mm, progress=progress)
    return edited_balls(volume, found, edits, ball_diameter_mm=ball_diameter_mm)


def _load_scipy() -> None:
    """Import what the chain uses of SciPy here, on one thread.

    Its parts are imported when they are first used, and a workstation computes on two threads: two
    that import parts of one package at the same time can fail. Every other step follows this one.
    """
    for name in SCIPY:
        import_module(name)


def balls_document(balls: BallSet) -> dict[str, Any]:
    """The balls found and the candidates rejected: what ``hexafix markers`` prints."""
    return found_balls(balls)
