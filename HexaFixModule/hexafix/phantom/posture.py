"""How the patient lies in the scanner, and which way the slices and the table run then."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_DOWN = {"S": (0, 1, 0), "P": (0, -1, 0), "DR": (-1, 0, 0), "DL": (1, 0, 0)}
"""LPS direction that points down to the table: supine, prone, decubitus right and left."""

_INTO_GANTRY = {"HF": (0, 0, 1), "FF": (0, 0, -1)}
"""LPS direction that enters the gantry first: head or feet."""

PATIENT_POSITIONS = tuple(first + lying for first in _INTO_GANTRY for lying in _DOWN)
"""DICOM's PatientPosition values that a limb is scanned in."""

_REFORMATTED = {
    "coronal": ((1, 0, 0), (0, 0, -1)),
    "sagittal": ((0, 1, 0), (0, 0, -1)),
}
"""Row and column direction in LPS of stacks reformatted in the patient's own planes."""

SLICE_PLANES = ("axial", *_REFORMATTED)


def scanner_axes(patient_position: str) -> NDArray[np.float64]:
    """Row direction, column direction and slice normal of an axial scan as LPS columns.

    Columns run down to the table and slices follow one another into the gantry, so that rows run
    to the scanner's right as seen from its foot end. Always a proper rotation.
    """
    down = np.array(_DOWN[patient_position[2:]], float)
    inwards = np.array(_INTO_GANTRY[patient_position[:2]], float)
    return np.column_stack([np.cross(down, inwards), down, inwards])


def stack_axes(patient_position: str, slice_plane: str) -> NDArray[np.float64]:
    """Directions of i, j and the slice normal in LPS, columns, before any small turn."""
    if slice_plane == "axial":
        return scanner_axes(patient_position)
    i, j = (np.array(axis, float) for axis in _REFORMATTED[slice_plane])
    return np.column_stack([i, j, np.cross(i, j)])
