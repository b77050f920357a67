"""Rotations, rigid fits and the mechanism against numbers worked out with fifty digits (H01, H29).

The constants were computed once by mpmath from the definitions: R = Rz(γ) Ry(β) Rx(α) (Eq. 2), the
power series of the matrix exponential, and |p + R a_l - b_l| (Eq. 29) with the joints of the
shipped fixator. A test works them out again in Python's `decimal`.
"""

from __future__ import annotations

from math import inf, isnan

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.transform import Rotation

from hexafix.geometry import Pose, angles_xyz_fixed_from_matrix, matrix_from_xyz_fixed
from hexafix.hardware import shipped_fixator
from hexafix.kinematics import forward_kinematics, second_starts, strut_lengths
from hexafix.recognition.rigid import kabsch, rigid_rms_mm
from hexafix.selftest.check import Check

ANGLES_RAD = (0.104719755119659775, -0.157079632679489662, 0.244346095279206141)
"""X-Y-Z fixed angles of 6, -9 and 14 degrees."""

ROTATION = (
    (0.95834977577209293, -0.256462756421595187, -0.125668460029622149),
    (0.238943435618465964, 0.961024473191182344, -0.139061125058207622),
    (0.156434465040230869, 0.103241544429788465, 0.98227768052182108),
)
"""Orientation matrix of `ANGLES_RAD`."""

POSITION_MM = (12.5, -7.25, 183.75)
"""Origin of {A} in {B}."""

LENGTHS_MM = (
    187.122563750032845,
    182.019869342447946,
    166.091145218728917,
    174.320826925744682,
    151.667770556154238,
    194.559318079308553,
)
"""Strut lengths of the shipped fixator at that pose."""

TWIST = (12.0, -7.0, 30.0, 0.3, -0.2, 0.5)
"""ξ = (ρ, θ), mm and radians."""

TWISTED = (
    (0.859533898558663205, -0.497991537002922008, -0.114916953936366726, 11.024566372549479),
    (0.43986763295823092, 0.835315605206708585, -0.329794337692255118, -8.67222579125426423),
    (0.260226714048094445, 0.232921164284436639, 0.937032437284917988, 29.9163698599686069),
)
"""Upper rows of exp(ξ)."""

TETRAHEDRON_MM = (
    *((90.0, 60.0, 10.0), (-90.0, -60.0, 10.0)),
    *((90.0, -60.0, -10.0), (-90.0, 60.0, -10.0)),
)
"""Four markers whose mirror image no rotation reaches: it stays 20 mm away."""

TRIANGLE_MM = ((80.0, 0.0, 12.0), (-30.0, 70.0, 12.0), (-45.0, -60.0, 12.0))
"""Three markers of one height: the sign of the third axis is the fit's to settle."""

EXACT = 1e-12
EXACT_MM = 1e-9


def motion_checks() -> list[Check]:
    """Angles, rotations, rigid fits and kinematics."""
    return [
        Check("X-Y-Z fixed angles", "numpy", f"the known matrix to {EXACT:g}", _angles),
        Check("rotations", "scipy", f"the known rotation and motion to {EXACT_MM:g}", _rotations),
        Check("rigid fit", "numpy", f"proper rotations, right to {EXACT_MM:g}", _fits),
        Check("strut lengths", "numpy", f"six known lengths to {EXACT_MM:g} mm", _lengths),
        Check("forward kinematics", "scipy", f"the known pose to {EXACT_MM:g} mm, rad", _forward),
    ]


def _off(found: ArrayLike, known: ArrayLike) -> float:
    """Largest difference; NaN and a wrong shape count as infinite."""
    one, other = np.asarray(found, float), np.asarray(known, float)
    if one.shape != other.shape:
        return inf
    pairs = zip(one.ravel().tolist(), other.ravel().tolist(), strict=True)
    differences = [abs(a - b) for a, b in pairs]
    return inf if any(map(isnan, differences)) else max(differences)


def _said(off: float, limit: float) -> str:
    return "" if off <= limit else f"off by {off:.3g}"


def _angles() -> str:
    forth = _off(matrix_from_xyz_fixed(ANGLES_RAD), ROTATION)
    back = _off(angles_xyz_fixed_from_matrix(ROTATION), ANGLES_RAD)
    return _said(max(forth, back), EXACT)


def _rotations() -> str:
    known = np.array([row[:3] for row in TWISTED])
    turned = _off(Rotation.from_rotvec(np.array([TWIST[3:]])).as_matrix()[0], known)
    pose = Pose.exp(TWIST)
    moved = _off(pose.matrix[:3], TWISTED)
    back = _off(Pose.from_matrix([*TWISTED, (0.0, 0.0, 0.0, 1.0)]).log(), TWIST)
    return _said(max(turned, moved, back), EXACT_MM)


def _fits() -> str:
    known = Pose(np.array(ROTATION), np.array(POSITION_MM))
    worst = 0.0
    for layout in (TRIANGLE_MM, TETRAHEDRON_MM):
        rotation, position = kabsch(points_mm=_moved(layout), layout_mm=layout)
        worst = max(worst, _off(rotation, known.rotation), _off(position, known.position_mm))
    mirror = np.array(TETRAHEDRON_MM) * (-1.0, 1.0, 1.0)
    rotation, _ = kabsch(points_mm=mirror, layout_mm=TETRAHEDRON_MM)
    worst = max(worst, _off(rotation, np.diag([-1.0, 1.0, -1.0])))
    left = rigid_rms_mm(points_mm=mirror, layout_mm=TETRAHEDRON_MM)
    return _said(max(worst, _off(left, 20.0)), EXACT_MM)


def _moved(layout_mm: ArrayLike) -> NDArray[np.float64]:
    """R r + p of layout points, shape (N, 3), mm, in plain Python numbers."""
    return np.array(
        [
            [
                sum(a * b for a, b in zip(row, point, strict=True)) + shift
                for row, shift in zip(ROTATION, POSITION_MM, strict=True)
            ]
            for point in np.asarray(layout_mm, float).tolist()
        ]
    )


def _lengths() -> str:
    pose = Pose(np.array(ROTATION), np.array(POSITION_MM))
    return _said(_off(strut_lengths(pose, shipped_fixator()), LENGTHS_MM), EXACT_MM)


def _forward() -> str:
    fixator = shipped_fixator()
    start = Pose.from_matrix(np.array([(1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 185.0), (0, 0, 0, 1)]))
    pose = forward_kinematics(LENGTHS_MM, fixator, start=start).pose
    off = max(_off(pose.position_mm, POSITION_MM), _off(pose.rotation, ROTATION))
    basin = second_starts(LENGTHS_MM, fixator, solution=pose, count=4)
    return _said(off, EXACT_MM) or ("" if basin.agree else "another pose from other starts")
