"""Solids as signed distances, and how their blurred images enter a slab of voxels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import erfc

from hexafix.geometry import Pose

Array = NDArray[np.floating]
Size = tuple[float, float, float]
Distance = Callable[[Array, Array, Array], Array | tuple[Array, ...]]


@dataclass(frozen=True, eq=False)
class Solid:
    """A thing in the scanner.

    Attributes
    ----------
    distance : callable
        Signed distance in mm (negative inside) of arrays x, y, z, mm in the solid's own frame.
        Several distances are those of faces that meet at right angles: the solid is what lies
        inside all of them, and its blurred image the product of theirs.
    pose : Pose
        The solid's frame in LPS.
    low_mm, high_mm : tuple of float
        Corners of a box in the solid's frame that holds it.
    layers : tuple of (float, float)
        Depth below the surface in mm and HU from there inwards, outermost first.
    """

    distance: Distance
    pose: Pose
    low_mm: Size
    high_mm: Size
    layers: tuple[tuple[float, float], ...]


@dataclass(frozen=True, eq=False)
class Grid:
    """Where the voxels lie and how wide their response is.

    Attributes
    ----------
    ijk_to_lps : ndarray, shape (4, 4)
        The third column is the step from slice to slice; with a tilted gantry it does not run
        along the slices' normal.
    size_ijk : tuple of int
        Number of voxels along i, j, k.
    thickness_mm : float
        Width of the slice profile, along the slices' normal.
    psf_sigma_mm : float
    gantry_tilt_rad : float
        Angle between slice step and slice normal.
    """

    ijk_to_lps: NDArray[np.float64]
    size_ijk: tuple[int, int, int]
    thickness_mm: float
    psf_sigma_mm: float
    gantry_tilt_rad: float = 0.0

    @property
    def spacing_mm(self) -> NDArray[np.float64]:
        """Voxel pitch along i, j and the slices' normal, mm."""
        spacing = np.linalg.norm(self.ijk_to_lps[:3, :3], axis=0)
        if self.gantry_tilt_rad:
            spacing[2] *= np.cos(self.gantry_tilt_rad)
        return spacing

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors of i, j and the slices' normal (the way the slices go on), columns."""
        axes = self.ijk_to_lps[:3, :3] / np.linalg.norm(self.ijk_to_lps[:3, :3], axis=0)
        if self.gantry_tilt_rad:
            normal = np.cross(axes[:, 0], axes[:, 1])
            axes[:, 2] = normal * np.sign(normal @ axes[:, 2])
        return axes


def paint(slab: Array, first_slice: int, solid: Solid, grid: Grid) -> None:
    """Lay a solid over what a slab holds: its blurred share replaces what is under it.

    Parameters
    ----------
    slab : ndarray, shape (K, J, I), float32
        HU, changed in place.
    first_slice : int
        Index k of the slab's first slice.
    solid : Solid
    grid : Grid

    Notes
    -----
    The edge is the Gaussian-blurred edge of a half space whose width holds the PSF and the
    voxel; slices thicker than the pixels are averaged from thinner ones.
    """
    spacing = grid.spacing_mm
    parts = max(1, round(grid.thickness_mm / max(float(spacing[:2].mean()), 0.5)))
    box = np.array([spacing[0], spacing[1], grid.thickness_mm / parts])
    sigma = float(np.sqrt(grid.psf_sigma_mm**2 + np.mean(box**2) / 12.0))
    reach = 5.0 * sigma + grid.thickness_mm
    ranges = box_in_slab(
        solid.pose, solid.low_mm, solid.high_mm, reach, grid, slab.shape[0], first_slice
    )
    if ranges is None:
        return
    i, j, k = ranges
    window = slab[k.start - first_slice : k.stop - first_slice, j.start : j.stop, i.start : i.stop]
    shares = [np.zeros(window.shape, np.float32) for _ in solid.layers] if parts > 1 else []
    offsets = ((np.arange(parts) + 0.5) / parts - 0.5) * grid.thickness_mm / spacing[2]
    scale = np.float32(1.0 / (np.sqrt(2.0) * sigma))
    for offset in offsets:
        depths = solid.distance(*local_coordinates(solid.pose, i, j, k, float(offset), grid))
        depths = depths if isinstance(depths, tuple) else (depths,)
        for number, (inset, hu) in enumerate(solid.layers):
            share = blurred_inside(depths[0] + np.float32(inset), scale)
            for depth in depths[1:]:
                share *= blurred_inside(depth + np.float32(inset), scale)
            if parts > 1:
                shares[number] += share / np.float32(parts)
            else:
                window += share * (np.float32(hu) - window)
    for share, (_, hu) in zip(shares, solid.layers, strict=False):
        window += share * (np.float32(hu) - window)


def blurred_inside(depth: Array, scale: np.float32) -> Array:
    """Blurred indicator of negative depths, mm; `scale` is 1 / (√2 σ)."""
    edge = depth * scale
    inside = (edge < 0.0).astype(np.float32)
    # the error function is dear, and needed only where the edge is
    near = np.abs(edge) < 4.0
    inside[near] = 0.5 * erfc(edge[near])
    return inside


def box_in_slab(
    pose: Pose,
    low_mm: Size,
    high_mm: Size,
    reach_mm: float,
    grid: Grid,
    slices: int,
    first_slice: int,
) -> tuple[range, range, range] | None:
    """Index ranges i, j, k of a slab that a box may touch; None: it does not.

    Parameters
    ----------
    pose : Pose
        The box's frame in LPS.
    low_mm, high_mm : tuple of float
        The box's corners, mm.
    reach_mm : float
        Margin around the box.
    grid : Grid
    slices, first_slice : int
        The slab.
    """
    ends = np.array([low_mm, high_mm]) + np.array([[-reach_mm], [reach_mm]])
    ends[:, 2] = _z_in_slab(pose, ends, grid, slices, first_slice)
    corners = np.stack(np.meshgrid(*ends.T, indexing="ij"), -1).reshape(-1, 3)
    inverse = np.linalg.inv(grid.ijk_to_lps)
    ijk = pose.apply(corners) @ inverse[:3, :3].T + inverse[:3, 3]
    limits = [(0, grid.size_ijk[0]), (0, grid.size_ijk[1]), (first_slice, first_slice + slices)]
    ranges = []
    for axis, (least, most) in enumerate(limits):
        start = max(least, int(np.floor(ijk[:, axis].min())))
        stop = min(most, int(np.ceil(ijk[:, axis].max())) + 1)
        if start >= stop:
            return None
        ranges.append(range(start, stop))
    return ranges[0], ranges[1], ranges[2]


def _z_in_slab(
    pose: Pose, ends: NDArray[np.float64], grid: Grid, slices: int, first_slice: int
) -> NDArray[np.float64]:
    """The part of a box's z range that can lie in the slab, so that long bars stay cheap."""
    inverse = np.linalg.inv(grid.ijk_to_lps)
    per_mm = inverse[2, :3] @ pose.rotation
    if abs(per_mm[2]) * grid.spacing_mm[2] < 0.05:
        return ends[:, 2]
    start = inverse[2, :3] @ pose.position_mm + inverse[2, 3]
    sideways = np.abs(per_mm[:2]) @ np.abs(ends[:, :2]).max(axis=0) + 1.0
    limits = np.array([first_slice - sideways, first_slice + slices + sideways])
    limits = np.sort((limits - start) / per_mm[2])
    return np.clip(limits, ends[0, 2], ends[1, 2])


def local_coordinates(
    pose: Pose, i: range, j: range, k: range, k_offset: float, grid: Grid
) -> tuple[Array, Array, Array]:
    """Coordinates of voxel centres in a frame, three arrays of shape (K, J, I), mm.

    Parameters
    ----------
    pose : Pose
        The frame in LPS.
    i, j, k : range
        The window.
    k_offset : float
        Shift along the slices' normal, in pitches.
    grid : Grid
    """
    to_local = pose.rotation.T @ grid.ijk_to_lps[:3, :3]
    start = pose.rotation.T @ (grid.ijk_to_lps[:3, 3] - pose.position_mm)
    if grid.gantry_tilt_rad and k_offset:
        aside = grid.axes[:, 2] * grid.spacing_mm[2] - grid.ijk_to_lps[:3, 2]
        start = start + pose.rotation.T @ aside * k_offset
    along_i, along_j, along_k = np.array(i, float), np.array(j, float), np.array(k, float)
    axes = []
    for row, constant in zip(to_local, start, strict=True):
        first = (row[0] * along_i + constant).astype(np.float32)
        second = (row[1] * along_j).astype(np.float32)
        third = (row[2] * (along_k + k_offset)).astype(np.float32)
        axes.append(third[:, None, None] + second[None, :, None] + first[None, None, :])
    return axes[0], axes[1], axes[2]


def frame_along(start_mm: NDArray, end_mm: NDArray) -> Pose:
    """Frame at the start whose z axis points to the end; points in LPS mm."""
    z = np.asarray(end_mm, float) - np.asarray(start_mm, float)
    z = z / np.linalg.norm(z)
    helper = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(helper, z)
    x = x / np.linalg.norm(x)
    return Pose(np.column_stack([x, np.cross(z, x), z]), np.asarray(start_mm, float))


def rod(start_mm: NDArray, end_mm: NDArray, diameter_mm: float, hu: float) -> Solid:
    """Round bar with flat ends between two LPS points, mm."""
    length = float(np.linalg.norm(np.asarray(end_mm, float) - np.asarray(start_mm, float)))
    return cylinder(frame_along(start_mm, end_mm), 0.0, length, diameter_mm / 2.0, ((0.0, hu),))


def cylinder(
    pose: Pose,
    bottom_mm: float,
    top_mm: float,
    radius_mm: float,
    layers: tuple[tuple[float, float], ...],
) -> Solid:
    """Cylinder along a frame's z axis from bottom to top."""
    middle, half = 0.5 * (bottom_mm + top_mm), 0.5 * (top_mm - bottom_mm)

    def distance(x: Array, y: Array, z: Array) -> tuple[Array, ...]:
        return np.sqrt(x * x + y * y) - np.float32(radius_mm), np.abs(z - middle) - half

    return Solid(
        distance, pose, (-radius_mm, -radius_mm, bottom_mm), (radius_mm, radius_mm, top_mm), layers
    )


def hex_prism(pose: Pose, bottom_mm: float, top_mm: float, flats_mm: float, hu: float) -> Solid:
    """Hexagonal nut or bolt head along a frame's z axis, `flats_mm` across flats."""
    middle, half = 0.5 * (bottom_mm + top_mm), 0.5 * (top_mm - bottom_mm)
    cos, sin = np.float32(0.5), np.float32(np.sqrt(0.75))

    def distance(x: Array, y: Array, z: Array) -> tuple[Array, ...]:
        side = np.maximum(np.abs(x), np.abs(cos * x + sin * y))
        side = np.maximum(side, np.abs(cos * x - sin * y)) - np.float32(flats_mm / 2.0)
        return side, np.abs(z - middle) - half

    r = flats_mm / np.sqrt(3.0)
    return Solid(distance, pose, (-r, -r, bottom_mm), (r, r, top_mm), ((0.0, hu),))


def ellipsoid(pose: Pose, radii_mm: Size, hu: float) -> Solid:
    """Ellipsoid about a frame's origin; the distance is exact on the axes and near the surface."""
    a, b, c = (np.float32(r) for r in radii_mm)

    def distance(x: Array, y: Array, z: Array) -> Array:
        level = np.sqrt((x / a) ** 2 + (y / b) ** 2 + (z / c) ** 2)
        slope = np.sqrt((x / a**2) ** 2 + (y / b**2) ** 2 + (z / c**2) ** 2)
        return level * (level - 1) / np.maximum(slope, np.float32(1e-6))

    low = (-radii_mm[0], -radii_mm[1], -radii_mm[2])
    return Solid(distance, pose, low, radii_mm, ((0.0, hu),))


def half_ball(pose: Pose, radius_mm: float, hu: float) -> Solid:
    """Dome on a frame's x-y plane, towards +z."""

    def distance(x: Array, y: Array, z: Array) -> tuple[Array, ...]:
        return np.sqrt(x * x + y * y + z * z) - np.float32(radius_mm), -z

    low, high = (-radius_mm, -radius_mm, 0.0), (radius_mm, radius_mm, radius_mm)
    return Solid(distance, pose, low, high, ((0.0, hu),))


def slab_box(pose: Pose, half_mm: Size, layers: tuple[tuple[float, float], ...]) -> Solid:
    """Rectangular board about a frame's origin with half sizes along its axes."""
    a, b, c = (np.float32(h) for h in half_mm)

    def distance(x: Array, y: Array, z: Array) -> tuple[Array, ...]:
        return np.abs(x) - a, np.abs(y) - b, np.abs(z) - c

    return Solid(distance, pose, (-half_mm[0], -half_mm[1], -half_mm[2]), half_mm, layers)
