"""Where in the whole volume balls could be: a look every ~2 mm, then rays in the full voxels.

No threshold in HU and no connected components: a place is a candidate when it is brighter than
what lies one ball radius further out in most directions, so a ball that touches a ring or another
ball stays one candidate of its own. What the first look takes for a ball is looked at again by
rays through every voxel, about its own centre and at its own half height.
"""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from hexafix.imaging.volume import Volume
from hexafix.markers.directions import sphere_directions
from hexafix.progress import Progress

COARSE_MM = 2.0
"""Pitch of the first look, never more than a fifth of the ball's diameter."""
BRIGHT_LITRES = 1.6
"""The first look takes in the brightest matter of the volume up to this amount."""
DARK_SHARE = 0.62
"""Least share of directions in which the brightness has fallen to half outside a ball."""
ROUNDS = ((24, 1.0, 0.9, 0.35), (48, 0.625, 0.50, 0.50), (64, 0.625, 0.35, 0.65))
"""Rounds of rays: how many, pitch along them in mm for a radius of 5 mm, share of the radius by
which a crossing may miss, least share of rays that hit."""
ON_SPHERE = 0.06, 0.30
"""A hit lies this share of the radius and of the thickest voxel from the fitted sphere."""
CHUNK = 16_384
"""Places polled at a time; bounds the memory."""


def candidate_centers(
    volume: Volume, *, ball_diameter_mm: float, progress: Progress
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places where a ball of the given diameter could be, the roundest first.

    Parameters
    ----------
    volume : Volume
    ball_diameter_mm : float
    progress : Progress

    Returns
    -------
    centers : ndarray, shape (M, 3)
        To about a voxel, LPS mm.
    radii : ndarray, shape (M,)
        To about half a voxel, mm.
    """
    radius = ball_diameter_mm / 2.0
    pitch = min(COARSE_MM, ball_diameter_mm / 5.0)
    step = np.maximum(1, np.rint(pitch / volume.spacing_mm).astype(int))
    progress("finding balls", 0.0)
    seeds = _coarse_seeds(volume.voxels, step, volume.spacing_mm * step, radius)
    progress("finding balls", 0.6)
    centers = seeds * step
    radii = np.empty(len(centers))
    for rays, pitch, slack, least in ROUNDS:
        moved = _ray_round(
            volume, centers, radius, rays=rays, step=0.2 * pitch * radius, slack=slack
        )
        order = np.argsort(-moved[2], kind="stable")
        order = order[moved[2][order] >= least]
        order = order[_far_apart(moved[0][order] * volume.spacing_mm, 0.25 * radius)]
        centers, radii = moved[0][order], moved[1][order]
    progress("finding balls", 1.0)
    return volume.lps_from_ijk(centers), radii


def _coarse_seeds(
    voxels: NDArray, step: NDArray[np.int64], pitch: NDArray[np.float64], radius: float
) -> NDArray[np.float64]:
    """Coarse indices (i, j, k) of places bright inside and dark outside, shape (M, 3)."""
    inner = _shifts(pitch, max(0.25 * radius, float(pitch.min())), _FACES)
    few = _shifts(pitch, radius + 0.5 * float(np.linalg.norm(pitch)) + 1.2, _CORNERS)
    many = _shifts(pitch, radius + 0.5 * float(np.linalg.norm(pitch)) + 1.2, _POLLS)
    margin = np.abs(np.vstack([inner, few, many])).max(axis=0)
    coarse = _padded(voxels[:: step[2], :: step[1], :: step[0]], margin[::-1])
    flat = np.flatnonzero(coarse.reshape(-1) > _bright_level(coarse, float(np.prod(pitch))))
    strides = np.array([1, coarse.shape[2], coarse.shape[2] * coarse.shape[1]])
    jumps = [shifts @ strides for shifts in (inner, few, many)]
    parts = [
        _polled(coarse.reshape(-1), flat[start : start + CHUNK], *jumps)
        for start in range(0, len(flat), CHUNK)
    ]
    flat = np.concatenate([part[0] for part in parts] + [np.empty(0, int)])
    score = np.concatenate([part[1] for part in parts] + [np.empty(0)])
    flat = flat[np.argsort(-score, kind="stable")]
    place = np.stack(np.unravel_index(flat, coarse.shape)[::-1], axis=-1) - margin
    _, best = np.unique(place // 2 @ (2 * strides), return_index=True)
    place = place[np.sort(best)]
    return place[_far_apart(place * pitch, 0.9 * radius)].astype(float)


def _padded(coarse: NDArray, margin: NDArray[np.int64]) -> NDArray:
    """A copy with a margin of the darkest value on every face."""
    shape = [n + 2 * m for n, m in zip(coarse.shape, margin, strict=True)]
    inside = tuple(slice(m, m + n) for n, m in zip(coarse.shape, margin, strict=True))
    padded = np.empty(shape, coarse.dtype)
    padded[inside] = coarse
    darkest = padded[inside].min() if coarse.size else 0
    for axis, part in enumerate(inside):
        face: list[slice] = [slice(None)] * 3
        for face[axis] in (slice(0, part.start), slice(part.stop, None)):
            padded[tuple(face)] = darkest
    return padded


def _bright_level(coarse: NDArray, cell_mm3: float) -> float:
    """Level that leaves the brightest matter, at most `BRIGHT_LITRES`."""
    stride = max(1, round((coarse.size / 250_000) ** (1 / 3)))
    sample = np.asarray(coarse[::stride, ::stride, ::stride], float).ravel()
    low, high = float(np.median(sample)), float(coarse.max())
    level = low + 0.05 * (high - low)
    share = BRIGHT_LITRES * 1e6 / cell_mm3 / coarse.size
    return level if share >= 1.0 else max(level, float(np.quantile(sample, 1.0 - share)))


def _shifts(pitch: NDArray[np.float64], distance: float, directions: NDArray) -> NDArray[np.int64]:
    """Distinct whole-cell steps (i, j, k) to about `distance` in the given directions."""
    return np.unique(np.rint(distance * directions / pitch).astype(int), axis=0)


def _polled(
    values: NDArray,
    flat: NDArray[np.int64],
    inner: NDArray[np.int64],
    few: NDArray[np.int64],
    many: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Flat indices that pass the poll, and how ball-like each is, the cheap questions first."""
    inside = np.min([values[flat + jump] for jump in inner], axis=0).astype(np.float32)
    outside = np.array([values[flat + jump] for jump in few])
    center = values[flat].astype(np.float32)
    half = 0.5 * (center + outside.min(axis=0))
    keep = (inside > half) & ((outside < half).sum(axis=0) >= 0.4 * len(few))
    flat, center, inside = flat[keep], center[keep], inside[keep]
    outside = np.array([values[flat + jump] for jump in many], dtype=np.float32)
    back = np.partition(outside, len(many) // 4, axis=0)[len(many) // 4]
    half = 0.5 * (center + back)
    dark = np.mean(outside < half, axis=0)
    keep = (dark >= DARK_SHARE) & (inside > half)
    depth = (inside - half)[keep] / (center - back)[keep]
    return flat[keep], dark[keep] + 0.5 * depth.astype(float)


def _far_apart(points: NDArray[np.float64], reach: float) -> NDArray[np.int64]:
    """Indices, in order, of points farther than `reach` from every one kept before them."""
    kept = np.ones(len(points), bool)
    if len(points) > 1:
        pairs = scipy.spatial.cKDTree(points).query_pairs(reach, output_type="ndarray")
        pairs = pairs[np.argsort(pairs.min(axis=1), kind="stable")]
        for first, second in zip(pairs.min(axis=1), pairs.max(axis=1), strict=True):
            if kept[first]:
                kept[second] = False
    return np.flatnonzero(kept)


def _ray_round(
    volume: Volume,
    centers: NDArray[np.float64],
    radius: float,
    *,
    rays: int,
    step: float,
    slack: float,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Spheres through the half-height crossings: centres (i, j, k), radii, shares of hits."""
    distance = np.arange(0.0, radius + 2.0 + step, step)
    inverse = np.linalg.inv(volume.ijk_to_lps[:3, :3])
    directions = sphere_directions(rays)
    jumps = np.rint((distance[:, None, None] * directions) @ inverse.T).astype(np.int64)
    tolerance = ON_SPHERE[0] * radius + ON_SPHERE[1] * float(volume.spacing_mm.max())
    moved, radii, hits = [np.empty((0, 3))], [np.empty(0)], [np.empty(0)]
    for start in range(0, len(centers), 128):
        near = np.rint(centers[start : start + 128]).astype(np.int64)
        profile = _profiles(volume, near, jumps)
        reach, crossed = _half_height(profile, distance, radius)
        crossed &= np.abs(reach - radius) < slack * radius
        shift, size, hit = _sphere_shift(reach[..., None] * directions, crossed, tolerance)
        moved.append(near + shift @ inverse.T)
        radii.append(size)
        hits.append(hit)
    return np.concatenate(moved), np.concatenate(radii), np.concatenate(hits)


def _profiles(
    volume: Volume, near: NDArray[np.int64], jumps: NDArray[np.int64]
) -> NDArray[np.float32]:
    """Voxels along rays, shape (distances, M, rays); the volume's edge repeats beyond it."""
    voxels, size = volume.voxels, np.array(volume.size_ijk)
    reach = np.abs(jumps).max(axis=(0, 1))
    if voxels.flags.c_contiguous and np.all((near >= reach) & (near < size - reach)):
        strides = np.array([1, size[0], size[0] * size[1]])
        flat = (near @ strides)[None, :, None] + (jumps @ strides)[:, None, :]
        return voxels.reshape(-1)[flat].astype(np.float32)
    index = np.clip(near[None, :, None] + jumps[:, None], 0, size - 1)
    return voxels[index[..., 2], index[..., 1], index[..., 0]].astype(np.float32)


def _half_height(
    profile: NDArray[np.float32], distance: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """First fall to half height along each ray: distance and whether there is one, (M, rays)."""
    core = np.median(profile[distance < 0.5 * radius, :, ::4], axis=(0, 2))
    tail = profile[-2:].min(axis=0)
    back = np.partition(tail, tail.shape[1] // 4, axis=1)[:, tail.shape[1] // 4]
    half = 0.5 * (core + back)[:, None]
    below = profile < half
    first = np.maximum(below.argmax(axis=0), 1)[None]
    high = np.take_along_axis(profile, first - 1, 0)[0]
    low = np.take_along_axis(profile, first, 0)[0]
    share = np.clip((high - half) / np.maximum(high - low, 1e-6), 0.0, 1.0)
    reach = (first[0] - 1 + share) * (distance[1] - distance[0])
    return reach, below.any(axis=0) & (core > back)[:, None]


def _sphere_shift(
    edge: NDArray[np.float64], near: NDArray[np.bool_], tolerance: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Algebraic sphere centres, (M, 3), and radii of edge points, (M, n, 3); shares that hit."""
    rows = np.concatenate([edge, np.ones_like(edge[..., :1])], axis=-1)
    right = 0.5 * np.sum(edge**2, axis=-1)[..., None]
    weight = near.astype(float)
    center, size, hit = np.zeros((len(edge), 3)), np.zeros(len(edge)), near
    for _ in range(2):
        weighted = np.swapaxes(rows * weight[..., None], 1, 2)
        solution = np.linalg.solve(weighted @ rows + 1e-6 * np.eye(4), weighted @ right)[..., 0]
        center = solution[:, :3]
        size = np.sqrt(np.maximum(2 * solution[:, 3] + np.sum(center**2, -1), 0.01))
        miss = np.abs(np.linalg.norm(edge - center[:, None], axis=-1) - size[:, None])
        hit = near & (miss < tolerance)
        weight = near * np.where(hit, 1.0, 0.1)
    return center, size, hit.mean(axis=1)


_FACES = np.vstack([np.eye(3), -np.eye(3)])
_CORNERS = np.array([(a, b, c) for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]) / np.sqrt(3.0)
_POLLS = sphere_directions(26)
