"""Where a correction should end, worked out again from the case."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from hexafix.verify.rigid import Matrix, angles_deg


def target(
    correction: dict[str, Any],
    *,
    side: str,
    mode: str,
    rings: tuple[Matrix, Matrix],
    recognised: Matrix,
    struts: Matrix,
) -> Matrix:
    """Mechanism pose {A} in {B} that the case's correction asks for, shape (4, 4).

    Parameters
    ----------
    correction : dict
        As in the case file.
    side : str
        ``left`` or ``right``.
    mode : str
        Compensation.
    rings : pair of ndarray, shape (4, 4)
        Proximal and distal ring in LPS to plan with.
    recognised, struts : ndarray, shape (4, 4)
        X_r and X_t.
    """
    if correction["kind"] == "target-pose":
        return _pose(correction["position_mm"], correction["angles_deg"])
    motion = _motion(correction, side)
    proximal, distal = rings
    if correction.get("moving", "distal") == "proximal":
        planned = np.linalg.solve(distal, motion @ proximal)
    else:
        planned = np.linalg.solve(motion @ distal, proximal)
    if mode != "additive":
        return planned
    error = angles_deg(recognised) - angles_deg(struts)
    error = (error + 180.0) % 360.0 - 180.0
    return _pose(planned[:3, 3] - (recognised[:3, 3] - struts[:3, 3]), angles_deg(planned) - error)


def _pose(position_mm: Any, angles: Any) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    pose[:3, 3] = position_mm
    return pose


def _motion(correction: dict[str, Any], side: str) -> Matrix:
    """The moving fragment's motion in LPS, shape (4, 4)."""
    if correction["kind"] == "fragment-motion":
        return np.array(correction["matrix_lps"], float)
    if correction["kind"] == "landmarks":
        return _landmarks(
            np.array(correction["moving_points_lps_mm"], float),
            np.array(correction["fixed_points_lps_mm"], float),
        )
    return _deformity(correction, side)


def _landmarks(moving: Matrix, fixed: Matrix) -> Matrix:
    """Rigid fit by scipy's `align_vectors`."""
    turn, _ = Rotation.align_vectors(fixed - fixed.mean(axis=0), moving - moving.mean(axis=0))
    pose = np.eye(4)
    pose[:3, :3] = turn.as_matrix()
    pose[:3, 3] = fixed.mean(axis=0) - turn.apply(moving.mean(axis=0))
    return pose


def _deformity(given: dict[str, Any], side: str) -> Matrix:
    """The inverse of the deformity in words, built from where its axis points."""
    lateral = np.array([1.0 if side == "left" else -1.0, 0.0, 0.0])
    back = np.array([0.0, 1.0, 0.0])
    out = np.array([0.0, 0.0, 1.0 if given.get("moving", "distal") == "proximal" else -1.0])

    def amount(name: str, unit: str, positive: str) -> float:
        value = given.get(f"{name}_{unit}") or 0.0
        return value if given.get(name) == positive else -value

    leant = (
        out
        + np.tan(np.radians(amount("ap_angulation", "deg", "valgus"))) * lateral
        + np.tan(np.radians(amount("lateral_angulation", "deg", "apex-anterior"))) * back
    )
    lean = _smallest_turn(out, leant)
    # external: the front goes towards lateral
    spin = np.radians(amount("axial_rotation", "deg", "external"))
    front = -back
    twist = Rotation.from_rotvec(spin * np.cross(front, lateral))
    turn = lean * twist
    origin = np.array(given["origin_lps_mm"], float)
    shift = (
        amount("ap_translation", "mm", "lateral") * lateral
        + amount("lateral_translation", "mm", "posterior") * back
        + amount("axial_translation", "mm", "long") * out
    )
    displaced = np.eye(4)
    displaced[:3, :3] = turn.as_matrix()
    displaced[:3, 3] = origin + shift - turn.apply(origin)
    return np.linalg.inv(displaced)


def _smallest_turn(start: Matrix, end: Matrix) -> Rotation:
    """The rotation by the smallest angle that takes one direction to another, by half vectors."""
    end = end / np.linalg.norm(end)
    half = start + end
    half = half / np.linalg.norm(half)
    return Rotation.from_quat([*np.cross(start, half), float(start @ half)])
