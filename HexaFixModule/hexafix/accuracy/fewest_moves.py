"""The layout that mends a ring by moving one marker, or two."""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.advised import AdviceRules, AssessedRing, RingTask, assess
from hexafix.accuracy.joint_error import unit_square_errors
from hexafix.accuracy.layout_check import triple_rules
from hexafix.accuracy.layout_placing import SAME_PLACE_MM, layout_moves
from hexafix.accuracy.layout_search import exchange_kept, keep_margins
from hexafix.hardware import HoleCircle, MarkerLayout, MarkerSite, Places
from hexafix.recognition.choices import UNIQUENESS_LIMIT_MM

Array = NDArray[np.float64]

MOST_MOVED = 2
"""Most markers moved; a ring that needs more is better built anew."""

MOST_LAYOUTS = 300_000
"""Two markers are not moved together where that gives more layouts."""

BATCH = 256
"""Layouts tested at once."""


def fewest_moves(
    task: RingTask, rules: AdviceRules, *, mirror: bool, other: MarkerLayout | None = None
) -> AssessedRing | None:
    """The best layout that keeps the rules and all present markers but one, or but two.

    Parameters
    ----------
    task : RingTask
        With a present layout of as many markers as wanted; the markers that stay need not be on
        holes.
    rules : AdviceRules
    mirror : bool
        Whether it must show a mirrored image.
    other : MarkerLayout, optional
        The other ring's layout, which this ring must not be taken for.

    Returns
    -------
    AssessedRing or None
        Among those that move fewest markers the one with the lowest error; None if there is none.
    """
    present = task.present
    if present is None or len(present) != task.count:
        return None
    free = free_sites(task.places)
    for moved in range(1, MOST_MOVED + 1):
        if comb(task.count, moved) * comb(len(free), moved) > MOST_LAYOUTS:
            break
        stay, new = _changes(task.count, moved, len(free))
        sites = np.concatenate([_site_table(present)[stay], free[new]], axis=1)
        best = _best(sites, task, rules, mirror=mirror, other=other)
        if best is not None:
            layout = _layout(present, stay[best], free[new[best]])
            moves = layout_moves(present, layout)
            return assess(
                layout, task.target, rules, places=_holes(task.places, layout), moves=moves
            )
    return None


def free_sites(places: Places) -> Array:
    """t, φ, h of every place a ball can take, shape (S, 3)."""
    if isinstance(places, HoleCircle):
        sweep, h = np.meshgrid(places.sweep_rad[places.free], places.heights_mm, indexing="ij")
        # As in `layout_placing`: whole degrees stay whole.
        degrees = np.mod(np.round(np.degrees(sweep.ravel()), 9), 360.0)
        return np.stack(
            [np.full(sweep.size, places.radius_mm), np.radians(degrees), h.ravel()], axis=-1
        )
    return np.array([[s.radius_mm, s.sweep_rad, s.height_mm] for s in places.sites])


def _site_table(layout: MarkerLayout) -> Array:
    return np.array([[s.radius_mm, s.sweep_rad, s.height_mm] for s in layout.sites])


def _changes(count: int, moved: int, free: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Markers that stay, shape (K, count - moved), and free sites for the others, (K, moved)."""
    stays = np.array(list(combinations(range(count), count - moved)), dtype=np.intp)
    news = np.array(list(combinations(range(free), moved)), dtype=np.intp).reshape(-1, moved)
    return np.repeat(stays, len(news), axis=0), np.tile(news, (len(stays), 1))


def _best(
    sites: Array,
    task: RingTask,
    rules: AdviceRules,
    *,
    mirror: bool,
    other: MarkerLayout | None,
) -> int | None:
    """Row of the best layout that keeps the rules; sites (K, N, 3) of t, φ, h."""
    around = np.argsort(np.mod(sites[..., 1], 2 * np.pi), axis=1, kind="stable")
    sites = np.take_along_axis(sites, around[..., None], axis=1)
    t, phi, h = sites[..., 0], sites[..., 1], sites[..., 2]
    points = np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)
    rows = np.flatnonzero(_buildable(points, phi, rules))
    x, y, z = np.moveaxis(points[rows], -1, 0)
    error = np.round(unit_square_errors(x, y, z, task.target, every_pair=False)[:, 0], 9)
    rows = rows[np.isfinite(error)][np.argsort(error[np.isfinite(error)], kind="stable")]
    against = None
    if other is not None and len(other) == task.count:
        order = np.argsort(np.mod([s.sweep_rad for s in other.sites], 2 * np.pi))
        against = other.points_mm[order]
    for start in range(0, len(rows), BATCH):
        part = rows[start : start + BATCH]
        limit = UNIQUENESS_LIMIT_MM if mirror else None
        part = part[keep_margins(points[part], rules.margin_mm, limit)]
        if against is not None and len(part):
            layouts = np.broadcast_to(against, (len(part), *against.shape))
            part = part[exchange_kept(points[part], layouts, rules.margin_mm)]
        if len(part):
            return int(part[0])
    return None


def _buildable(points: Array, sweep_rad: Array, rules: AdviceRules) -> NDArray[np.bool_]:
    """Whether layouts keep the angle rule and the spacing, shape (K,)."""
    allowed = ("preferred", "relaxed") if rules.relaxed else ("preferred",)
    count = sweep_rad.shape[1]
    kept = np.zeros(len(points), bool)
    for triple in combinations(range(count), 3):
        rest = np.flatnonzero(~kept)
        kept[rest] = np.isin(triple_rules(sweep_rad[rest][:, list(triple)]), allowed)
    first, second = np.triu_indices(count, 1)
    across = np.linalg.norm(points[:, first, :2] - points[:, second, :2], axis=-1)
    # Two balls in one hole are never apart, whatever the spacing asked for.
    return kept & (across.min(axis=1) >= max(rules.spacing_mm, 1.0) - 1e-6)


def _layout(present: MarkerLayout, stay: NDArray[np.intp], new: Array) -> MarkerLayout:
    """The present layout with its markers that do not stay on the new sites, the nearest first."""
    gone = [site for k, site in enumerate(present.sites) if k not in stay]
    t, phi, h = new.T
    points = np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)
    old = np.array([present.points_mm[k] for k in range(len(present)) if k not in stay])
    apart = np.linalg.norm(old[:, None] - points[None], axis=-1)
    if len(gone) == MOST_MOVED and np.trace(apart) > np.trace(apart[:, ::-1]):
        new = new[::-1]
    moved = {
        site.number: MarkerSite(site.number, *map(float, place))
        for site, place in zip(gone, new, strict=True)
    }
    return MarkerLayout(tuple(moved.get(site.number, site) for site in present.sites))


def _holes(places: Places, layout: MarkerLayout) -> tuple[int | None, ...]:
    """Hole or site of each marker, counted from 1; None for one that is on none."""
    if isinstance(places, HoleCircle):
        t, phi = places.radius_mm, places.sweep_rad
        centres = np.stack([t * np.cos(phi), t * np.sin(phi)], axis=-1)
        balls = layout.points_mm[:, :2]
    else:
        table = free_sites(places)
        t, phi, h = table.T
        centres = np.stack([t * np.cos(phi), t * np.sin(phi), h], axis=-1)
        balls = layout.points_mm
    apart = np.linalg.norm(balls[:, None] - centres[None], axis=-1)
    return tuple(int(np.argmin(row)) + 1 if row.min() <= SAME_PLACE_MM else None for row in apart)
