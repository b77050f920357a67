"""A rigid deformity in the six clinical words of the case file."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose

_WORDS = {
    "ap_angulation": ("valgus", "varus", "deg"),
    "lateral_angulation": ("apex-anterior", "apex-posterior", "deg"),
    "axial_rotation": ("external", "internal", "deg"),
    "ap_translation": ("lateral", "medial", "mm"),
    "lateral_translation": ("posterior", "anterior", "mm"),
    "axial_translation": ("long", "short", "mm"),
}
"""Parameter: its word where the signed value is positive, where it is negative, its unit."""


def deformity_document(
    *, motion: Pose, point_mm: NDArray[np.float64], moving: str, side: str
) -> dict[str, Any]:
    """The case's correction of kind ``deformity`` that a reducing motion undoes.

    Parameters
    ----------
    motion : Pose
        Motion of the moving fragment in LPS that reduces it.
    point_mm : ndarray, shape (3,)
        Point of the moving fragment, LPS; where it belongs is the document's origin.
    moving : str
        ``proximal`` or ``distal``.
    side : str
        ``left`` or ``right``.

    Notes
    -----
    The deformity is D = M⁻¹ = tilt ∘ axial turn: the tilt is the smallest turn that takes the
    moving fragment's direction u (−z distal, +z proximal in LPS) to where D has it, seen as two
    angles in the AP and the lateral view.
    """
    lateral = 1.0 if side == "left" else -1.0
    outward = -1.0 if moving == "distal" else 1.0
    turn = motion.rotation.T
    u = np.array([0.0, 0.0, outward])
    leaned = turn @ u
    lean = leaned / (leaned @ u) - u
    cross = np.cross(u, leaned)
    k = np.array([[0, -cross[2], cross[1]], [cross[2], 0, -cross[0]], [-cross[1], cross[0], 0.0]])
    # Rodrigues' formula for the smallest turn between two unit vectors
    tilt = np.eye(3) + k + k @ k / (1.0 + leaned @ u)
    axial = tilt.T @ turn
    origin = motion.apply(point_mm)
    shift = point_mm - origin
    signed = {
        "ap_angulation": np.degrees(np.arctan(lean[0])) * lateral,
        "lateral_angulation": np.degrees(np.arctan(lean[1])),
        "axial_rotation": np.degrees(np.arctan2(axial[1, 0], axial[0, 0])) * lateral,
        "ap_translation": shift[0] * lateral,
        "lateral_translation": shift[1],
        "axial_translation": shift[2] * outward,
    }
    document: dict[str, Any] = {"kind": "deformity", "moving": moving}
    document["origin_lps_mm"] = origin.tolist()
    for name, (positive, negative, unit) in _WORDS.items():
        document[f"{name}_{unit}"] = float(abs(signed[name]))
        document[name] = positive if signed[name] > 0.0 else negative
    return document
