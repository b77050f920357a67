"""One axial slice as grey values, before anything that draws is in memory."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.imaging import Volume
from hexafix.pipeline.look import image_document

PICTURE_PX = 512
"""Columns and rows."""


@dataclass(frozen=True, eq=False)
class AxialPicture:
    """An axial slice as radiologists look at it: from the feet, the patient's front up.

    Attributes
    ----------
    grey : ndarray, shape (rows, columns), uint8
        Columns go from the patient's right to his left, rows from his front to his back. Read-only.
    s_mm : float
        Where the slice is: the S coordinate in LPS, mm.
    """

    grey: NDArray[np.uint8]
    s_mm: float


def axial_picture(volume: Volume, *, size_px: int = PICTURE_PX) -> AxialPicture:
    """The axial slice through the middle of a CT, each pixel the nearest voxel.

    Parameters
    ----------
    volume : Volume
        Its grid may lie askew in the patient; outside it the picture is black.
    size_px : int
        Columns and rows of the square that holds all of the CT.
    """
    size = np.array(volume.size_ijk)
    affine = volume.ijk_to_lps
    centre = affine[:3, :3] @ ((size - 1) / 2) + affine[:3, 3]
    # half of the grid's extent along L and P
    half_mm = (np.abs(affine[:2, :3]) @ (size / 2)).max()
    steps = np.linspace(-half_mm, half_mm, size_px)
    left, back = centre[0] + steps, centre[1] + steps
    to_ijk = np.linalg.inv(affine)
    start = to_ijk[:3, 2] * centre[2] + to_ijk[:3, 3]
    places = (
        start[:, None, None]
        + to_ijk[:3, 0, None, None] * left[None, None, :]
        + to_ijk[:3, 1, None, None] * back[None, :, None]
    )
    nearest = np.rint(places).astype(int)
    inside = np.all((nearest >= 0) & (nearest < size[:, None, None]), axis=0)
    i, j, k = np.where(inside, nearest, 0)
    grey = _grey(volume.voxels[k, j, i], image_document(volume))
    grey[~inside] = 0
    grey.setflags(write=False)
    return AxialPicture(grey, float(centre[2]))


def _grey(hu: NDArray[Any], document: dict[str, Any]) -> NDArray[np.uint8]:
    low = document["level_hu"] - document["window_hu"] / 2
    share = np.clip((hu.astype(float) - low) / document["window_hu"], 0.0, 1.0)
    return np.rint(255 * share).astype(np.uint8)
