"""Where in the whole volume balls could be: a look every ~2 mm, then rays in the full voxels.

No threshold in HU and no connected components: a place is a candidate when it is brighter than
what lies one ball radius further out in most directions, so a ball that touches a ring or another
ball stays one candidate of its own.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexafix.imaging.volume import Volume
from hexafix.markers.directions import sphere_directions
from hexafix.progress import Progress

COARSE_MM = 2.0
"""Pitch of the first look, never more than a fifth of the ball's diameter."""
BRIGHT_LITRES = 1.6
"""The first look takes in the brightest matter of the volume up to this amount."""
DARK_SHARE = 0.55
"""Least share of directions in which the brightness has fallen to half outside a ball."""
ROUNDS = ((0.9, 0.30), (0.50, 0.45), (0.35, 0.50))
"""Rounds of rays: share of the radius by which a crossing may miss, least share of rays that hit."""
ON_SPHERE = 0.12
"""A hit lies this share of the radius from the fitted sphere."""
MOST_CANDIDATES = 4000
RAYS = 64


def candidate_centers(
    volume: Volume, *, ball_diameter_mm: float, progress: Progress
) -> NDArray[np.float64]:
    """Places where a ball of the given diameter could be.

    Parameters
    ----------
    volume : Volume
    ball_diameter_mm : float
    progress : Progress

    Returns
    -------
    ndarray, shape (M, 3)
        Centres to about a voxel, LPS mm.
    """
    radius = ball_diameter_mm / 2.0
    step = _coarse_step(volume, ball_diameter_mm)
    coarse = np.ascontiguousarray(volume.voxels[:: step[2], :: step[1], :: step[0]])
    progress("finding balls", 0.1)
    seeds = _coarse_seeds(coarse, volume.spacing_mm * step, radius)
    progress("finding balls", 0.2)
    points = volume.lps_from_ijk(seeds * step)
    for slack, share in ROUNDS:
        points = _ray_round(volume, points, radius, slack=slack, least=share)
        points = _without_doubles(points, 0.25 * radius)
    progress("finding balls", 0.3)
    return points


def _coarse_step(volume: Volume, diameter: float) -> NDArray[np.int64]:
    """Voxels per coarse step along i, j, k."""
    pitch = min(COARSE_MM, diameter / 5.0)
    return np.maximum(1, np.rint(pitch / volume.spacing_mm).astype(int))


def _bright_level(coarse: NDArray, cell_mm3: float) -> float:
    """Level that leaves the brightest matter, at most `BRIGHT_LITRES`."""
    stride = max(1, round((coarse.size / 250_000) ** (1 / 3)))
    sample = np.asarray(coarse[::stride, ::stride, ::stride], float).ravel()
    low, high = float(np.median(sample)), float(coarse.max())
    level = low + 0.05 * (high - low)
    keep = BRIGHT_LITRES * 1e6 / cell_mm3 / coarse.size
    if keep < 1.0:
        level = max(level, float(np.quantile(sample, 1.0 - keep)))
    return level


def _shifts(pitch: NDArray[np.float64], distance: float, directions: NDArray) -> NDArray[np.int64]:
    """Distinct whole-cell steps (i, j, k) to about `distance` in the given directions."""
    return np.unique(np.rint(distance * directions / pitch).astype(int), axis=0)


def _coarse_seeds(
    coarse: NDArray, pitch: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Coarse indices (i, j, k) of places bright inside and dark outside, shape (M, 3)."""
    level = _bright_level(coarse, float(np.prod(pitch)))
    flat = np.flatnonzero(coarse.reshape(-1) > level)
    parts = [
        _polled(coarse, pitch, radius, flat[start : start + 32_768])
        for start in range(0, len(flat), 32_768)
    ]
    places = np.concatenate([np.empty((0, 3), int)] + [p[0] for p in parts])
    scores = np.concatenate([np.empty(0)] + [p[1] for p in parts])
    return _best_of_neighbours(places, scores, pitch, 0.5 * radius)


def _polled(
    coarse: NDArray, pitch: NDArray[np.float64], radius: float, flat: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The places of flat coarse indices that pass the poll, and their brightness inside."""
    shape = np.array(coarse.shape[::-1])
    strides = np.array([1, shape[0], shape[0] * shape[1]])
    place = np.stack([flat % shape[0], flat // shape[0] % shape[1], flat // strides[2]], -1)
    values = coarse.reshape(-1)
    center = values[flat].astype(np.float32)
    outer = _shifts(pitch, radius + float(np.linalg.norm(pitch)) / 2.0 + 1.2, _POLLS)
    outside = _gathered(values, place, outer, shape, strides, float(coarse.min()))
    outside.sort(axis=0)
    back = outside[len(outer) // 4]
    half = 0.5 * (center + back)
    dark = np.mean(outside < half, axis=0)
    keep = dark >= DARK_SHARE
    place, half, center, back = place[keep], half[keep], center[keep], back[keep]
    inner = _shifts(
        pitch, max(0.25 * radius, float(pitch.min())), np.vstack([np.eye(3), -np.eye(3)])
    )
    inside = _gathered(values, place, inner, shape, strides, float(coarse.min()))
    keep = (inside > half).all(axis=0)
    return place[keep], inside[:, keep].mean(axis=0)


def _gathered(
    values: NDArray,
    place: NDArray[np.int64],
    shifts: NDArray[np.int64],
    shape: NDArray[np.int64],
    strides: NDArray[np.int64],
    beyond: float,
) -> NDArray[np.float32]:
    """Values at shifted places, shape (shifts, places); `beyond` outside the volume."""
    result = np.empty((len(shifts), len(place)), np.float32)
    for row, shift in zip(result, shifts, strict=True):
        moved = place + shift
        inside = np.all((moved >= 0) & (moved < shape), axis=1)
        row[:] = beyond
        row[inside] = values[moved[inside] @ strides]
    return result


def _best_of_neighbours(
    place: NDArray[np.int64], score: NDArray, pitch: NDArray[np.float64], reach: float
) -> NDArray[np.float64]:
    """The places that nothing brighter within `reach` mm displaces, the brightest first."""
    order = np.argsort(-score, kind="stable")
    points = (place * pitch)[order]
    kept = _without_doubles(points, reach)
    return kept[:MOST_CANDIDATES] / pitch


def _without_doubles(points: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
    """Points in their order, each farther than `reach` from every one kept before it."""
    from scipy.spatial import cKDTree

    if len(points) < 2:
        return points
    tree = cKDTree(points)
    kept = np.ones(len(points), bool)
    for index, near in enumerate(tree.query_ball_point(points, reach)):
        if kept[index]:
            near = np.asarray(near)
            kept[near[near > index]] = False
    return points[kept]


def _ray_round(
    volume: Volume, points: NDArray[np.float64], radius: float, *, slack: float, least: float
) -> NDArray[np.float64]:
    """Points moved to the sphere through their half-height crossings, the roundest first."""
    if not len(points):
        return points
    parts = [
        _ray_chunk(volume, points[start : start + 128], radius, slack)
        for start in range(0, len(points), 128)
    ]
    moved = np.concatenate([part[0] for part in parts])
    share = np.concatenate([part[1] for part in parts])
    order = np.argsort(-share, kind="stable")
    return moved[order][share[order] >= least]


def _ray_chunk(
    volume: Volume, points: NDArray[np.float64], radius: float, slack: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Moved points and the share of their rays that hit the fitted sphere."""
    step = 0.125 * radius
    distance = np.arange(0.0, radius + 2.5, step)
    rays = _RAYS[:, None, :] * distance[:, None]
    profile = _nearest(volume, points[:, None, None, :] + rays)
    core = np.median(profile[:, ::4, distance < 0.5 * radius], axis=(1, 2))
    back = np.quantile(profile[:, :, -2:].min(axis=2), 0.25, axis=1)
    half = 0.5 * (core + back)
    below = profile < half[:, None, None]
    first = np.maximum(below.argmax(axis=2), 1)
    high = np.take_along_axis(profile, first[..., None] - 1, 2)[..., 0]
    low = np.take_along_axis(profile, first[..., None], 2)[..., 0]
    share = np.clip((high - half[:, None]) / np.maximum(high - low, 1e-9), 0.0, 1.0)
    reach = (first - 1 + share) * step
    near = below.any(axis=2) & (np.abs(reach - radius) < slack * radius)
    shift, hits = _sphere_shift(reach[..., None] * _RAYS, near)
    return points + shift, np.where(core > back, hits, 0.0)


def _sphere_shift(
    edge: NDArray[np.float64], near: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Algebraic sphere centres, (M, 3), of edge points, (M, n, 3), and the shares that hit."""
    rows = np.concatenate([edge, np.ones_like(edge[..., :1])], axis=-1)
    right = 0.5 * np.sum(edge**2, axis=-1)[..., None]
    weight = near.astype(float)
    for _ in range(2):
        weighted = np.swapaxes(rows * weight[..., None], 1, 2)
        solution = np.linalg.solve(weighted @ rows + 1e-6 * np.eye(4), weighted @ right)[..., 0]
        center = solution[:, :3]
        size = np.sqrt(np.maximum(2 * solution[:, 3] + np.sum(center**2, -1), 0.01))
        miss = np.abs(np.linalg.norm(edge - center[:, None], axis=-1) - size[:, None])
        hit = near & (miss < ON_SPHERE * size[:, None])
        weight = near * np.where(hit, 1.0, 0.1)
    return center, hit.mean(axis=1)


def _nearest(volume: Volume, points: NDArray[np.float64]) -> NDArray[np.float32]:
    """Nearest voxels of LPS points, the volume's edge repeated beyond it."""
    index = np.rint(volume.ijk_from_lps(points)).astype(int)
    np.clip(index, 0, np.array(volume.size_ijk) - 1, out=index)
    return volume.voxels[index[..., 2], index[..., 1], index[..., 0]].astype(np.float32)


_POLLS = sphere_directions(26)
_RAYS = sphere_directions(RAYS)
