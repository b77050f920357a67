"""Spheres by the closed form, averaged over each voxel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.geometry import Pose
from hexafix.geometry.blurred_ball import blurred_ball
from hexafix.phantom.solids import Array, Grid, box_in_slab

REACH_SIGMA = 6.0
"""Beyond this many σ from the surface the blurred ball is 0 or 1 to 1e-9."""

TABLE_MM = 1e-3
"""Pitch of the closed form's table: between its entries the share is right to 1e-6."""


@dataclass(frozen=True, eq=False)
class ExactBall:
    """A sphere painted without any approximation of its partial volume.

    Attributes
    ----------
    center_mm : ndarray, shape (3,)
        LPS, mm.
    radius_mm, hu : float
    """

    center_mm: NDArray[np.float64]
    radius_mm: float
    hu: float


def nodes_along(width_mm: float, sigma_mm: float) -> tuple[NDArray, NDArray]:
    """Gauss–Legendre nodes in [-½, ½] and weights of sum 1 for a box on a blurred edge."""
    count = 3 + int(np.ceil(1.5 * width_mm / sigma_mm))
    nodes, weights = np.polynomial.legendre.leggauss(count)
    return nodes / 2.0, weights / 2.0


def paint_ball(slab: Array, first_slice: int, ball: ExactBall, grid: Grid) -> None:
    """Lay a ball over what a slab holds: its blurred share replaces what is under it.

    Parameters
    ----------
    slab : ndarray, shape (K, J, I), float32
        HU, changed in place.
    first_slice : int
        Index k of the slab's first slice.
    ball : ExactBall
    grid : Grid

    Notes
    -----
    The closed form is averaged over the voxel's box (pitch in plane, slice thickness along k) by
    Gauss–Legendre nodes.
    """
    center = Pose(np.eye(3), ball.center_mm)
    extent = (ball.radius_mm, ball.radius_mm, ball.radius_mm)
    widest = float(np.linalg.norm([*grid.spacing_mm[:2], grid.thickness_mm]))
    reach = REACH_SIGMA * grid.psf_sigma_mm + widest
    low = (-extent[0], -extent[1], -extent[2])
    ranges = box_in_slab(center, low, extent, reach, grid, slab.shape[0], first_slice)
    if ranges is None:
        return
    i, j, k = ranges
    share = ball_share(ball, grid, i, j, k)
    window = slab[k.start - first_slice : k.stop - first_slice, j.start : j.stop, i.start : i.stop]
    window += (share * (ball.hu - window)).astype(np.float32)


def ball_share(ball: ExactBall, grid: Grid, i: range, j: range, k: range) -> NDArray[np.float64]:
    """Share of each voxel's signal that comes from the ball, shape (K, J, I), 0 to 1."""
    spacing = grid.spacing_mm
    widths = np.array([spacing[0], spacing[1], grid.thickness_mm])
    offset = grid.ijk_to_lps[:3, 3] - ball.center_mm
    index = np.meshgrid(k, j, i, indexing="ij")
    ijk = np.stack([index[2], index[1], index[0]], -1).reshape(-1, 3).astype(float)
    points = ijk @ grid.ijk_to_lps[:3, :3].T + offset
    reach = REACH_SIGMA * grid.psf_sigma_mm + 0.5 * float(np.linalg.norm(widths))
    distance = np.linalg.norm(points, axis=-1)
    share = (distance < ball.radius_mm).astype(float)
    edge = np.abs(distance - ball.radius_mm) < reach
    near = points[edge]
    square = np.einsum("ni,ni->n", near, near)
    radii = np.arange(max(0.0, ball.radius_mm - 2 * reach), ball.radius_mm + 2 * reach, TABLE_MM)
    table = blurred_ball(radii, radius_mm=ball.radius_mm, sigma_mm=grid.psf_sigma_mm)
    axes = grid.axes
    rules = [nodes_along(float(w), grid.psf_sigma_mm) for w in widths]
    total = np.zeros(len(near))
    for u, wu in zip(*rules[0], strict=True):
        for v, wv in zip(*rules[1], strict=True):
            for w, ww in zip(*rules[2], strict=True):
                node = axes @ (widths * (u, v, w))
                r = np.sqrt(np.maximum(square + near @ (2.0 * node) + node @ node, 0.0))
                total += (wu * wv * ww) * np.interp(r, radii, table)
    share[edge] = total
    return share.reshape(len(k), len(j), len(i))
