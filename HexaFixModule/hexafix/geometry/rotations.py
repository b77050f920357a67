"""X-Y-Z fixed angles and rotation matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import InputError

GIMBAL_COS = 1e-6
"""Below this cos β the X-Y-Z fixed angles α and γ cannot be told apart."""


def matrix_from_xyz_fixed(angles_rad: ArrayLike) -> NDArray[np.float64]:
    """Orientation matrix of X-Y-Z fixed angles, R = Rz(γ) Ry(β) Rx(α).

    Parameters
    ----------
    angles_rad : array_like, shape (..., 3)
        α, β, γ about the fixed x, y and z axes, radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Notes
    -----
    Source: Eq. (2).
    """
    angles = np.asarray(angles_rad, float)
    sa, sb, sc = np.moveaxis(np.sin(angles), -1, 0)
    ca, cb, cc = np.moveaxis(np.cos(angles), -1, 0)
    rows = [
        [cb * cc, sa * sb * cc - ca * sc, ca * sb * cc + sa * sc],
        [cb * sc, sa * sb * sc + ca * cc, ca * sb * sc - sa * cc],
        [-sb, sa * cb, ca * cb],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def angles_xyz_fixed_from_matrix(rotation: ArrayLike) -> NDArray[np.float64]:
    """X-Y-Z fixed angles of orientation matrices, over the full circle.

    Parameters
    ----------
    rotation : array_like, shape (..., 3, 3)
        Proper rotation matrices.

    Returns
    -------
    ndarray, shape (..., 3)
        α in (-π, π], β in [-π/2, π/2], γ in (-π, π], radians.

    Raises
    ------
    InputError
        If a matrix is not a proper rotation, or β is ±90° (α and γ not unique).

    Notes
    -----
    Source: Eq. (3). Departs: arctan2 instead of arcsin, which hides a mirrored matrix and fails
    for angles beyond ±90°.
    """
    matrix = np.asarray(rotation, float)
    if not is_rotation(matrix):
        raise InputError.of(
            "not-a-rotation",
            "the matrix is not a proper rotation, so it has no X-Y-Z fixed angles",
            value=f"det {np.min(np.linalg.det(matrix)):+.6f}",
            limit="det +1, orthonormal to 1e-6",
            hazard="H01",
            next_step="look for a mirrored image or a wrong marker number",
        )
    cos_beta = np.hypot(matrix[..., 0, 0], matrix[..., 1, 0])
    if np.any(cos_beta < GIMBAL_COS):
        raise InputError.of(
            "gimbal-lock",
            "β is ±90°, where α and γ of the X-Y-Z fixed angles are not unique",
            value=f"cos β {np.min(cos_beta):.1e}",
            limit=f"{GIMBAL_COS:.0e}",
            hazard="H35",
            next_step="use the 4×4 matrix",
        )
    alpha = np.arctan2(matrix[..., 2, 1], matrix[..., 2, 2])
    beta = np.arctan2(-matrix[..., 2, 0], cos_beta)
    gamma = np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0])
    return np.stack([alpha, beta, gamma], axis=-1)


def matrix_from_rotation_vector(vectors_rad: ArrayLike) -> NDArray[np.float64]:
    """Rotation matrices of rotation vectors.

    Parameters
    ----------
    vectors_rad : array_like, shape (M, 3)
        Axis times angle, radians.

    Returns
    -------
    ndarray, shape (M, 3, 3)

    Notes
    -----
    Rodrigues' formula in sin α / α and (1 - cos α) / α², so that no turn is too small for it. SciPy
    says the same; but the start of the workstation would wait half a second for it.
    """
    u, v, w = np.asarray(vectors_rad, float).T
    angle = np.sqrt(u * u + v * v + w * w)
    s = np.sinc(angle / np.pi)
    c = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    k = np.cos(angle)
    out = np.empty((len(u), 3, 3))
    out[:, 0, 0], out[:, 1, 1], out[:, 2, 2] = k + c * u * u, k + c * v * v, k + c * w * w
    out[:, 0, 1], out[:, 1, 0] = c * u * v - s * w, c * u * v + s * w
    out[:, 0, 2], out[:, 2, 0] = c * u * w + s * v, c * u * w - s * v
    out[:, 1, 2], out[:, 2, 1] = c * v * w - s * u, c * v * w + s * u
    return out


def is_rotation(matrix: ArrayLike, tolerance: float = 1e-6) -> bool:
    """Whether every (..., 3, 3) matrix is orthonormal to `tolerance` with determinant +1."""
    r = np.asarray(matrix, float)
    if r.shape == (3, 3):
        return _is_one_rotation(r, tolerance)
    if r.shape[-2:] != (3, 3) or not np.all(np.isfinite(r)):
        return False
    gram = np.swapaxes(r, -1, -2) @ r
    return bool(np.all(np.abs(gram - np.eye(3)) <= tolerance) and np.all(np.linalg.det(r) > 0))


def _is_one_rotation(r: NDArray[np.float64], tolerance: float) -> bool:
    """`is_rotation` of one matrix in plain numbers: every pose is checked, so it must be quick."""
    (a, b, c), (d, e, f), (g, h, i) = r.tolist()
    offs = (
        a * a + d * d + g * g - 1.0,
        b * b + e * e + h * h - 1.0,
        c * c + f * f + i * i - 1.0,
        a * b + d * e + g * h,
        a * c + d * f + g * i,
        b * c + e * f + h * i,
    )
    # NaN compares false, so it is no rotation
    orthonormal = all(abs(off) <= tolerance for off in offs)
    return orthonormal and a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g) > 0.0


def skew(vector: ArrayLike) -> NDArray[np.float64]:
    """Skew-symmetric matrix [v×] of vectors, shape (..., 3) to (..., 3, 3)."""
    v = np.asarray(vector, float)
    zero = np.zeros(v.shape[:-1])
    x, y, z = np.moveaxis(v, -1, 0)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
