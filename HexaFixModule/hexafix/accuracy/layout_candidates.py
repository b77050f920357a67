"""Every layout that a ring's places allow, with its error; turned copies only once."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.joint_error import ErrorTarget, unit_square_errors
from hexafix.accuracy.layout_check import triple_rules
from hexafix.errors import InputError
from hexafix.hardware import HoleCircle, Places, SiteList

Array = NDArray[np.float64]

MARKERS = (3, 5)
"""Fewest and most markers of an advised ring."""

MAX_LAYOUTS = 20_000_000
"""Most layouts that are listed; more need fewer places."""

ROWS = 30_000
"""Layouts whose error is computed at once."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Layouts of one ring that keep the angle rule, with their errors.

    A layout is a flat index into rows × patterns: a choice of places and, on a hole circle, a
    choice of heights. On a hole circle the rows stand for all their turned and reflected copies.

    Attributes
    ----------
    places : HoleCircle or SiteList
    chosen : ndarray of int, shape (K, N)
        Holes or sites, from 0, in the order of their sweep angles.
    heights_mm : ndarray, shape (P, N)
        Heights of each pattern; a `SiteList` has the heights of its sites and P = 1.
    handed : ndarray of bool, shape (K, 2)
        Whether a copy as listed, and one reflected, fits into the free holes.
    unit_square_mm2 : ndarray, shape (K * P,)
        Squared ranking error at a ball error of 1 mm along each axis.
    """

    places: Places
    chosen: NDArray[np.intp]
    heights_mm: Array
    handed: NDArray[np.bool_]
    unit_square_mm2: Array

    def __len__(self) -> int:
        return len(self.unit_square_mm2)

    def split(self, flat: NDArray[np.intp]) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and patterns of flat indices."""
        patterns = max(1, len(self.heights_mm))
        return flat // patterns, flat % patterns

    def points_mm(self, flat: NDArray[np.intp]) -> Array:
        """Ball centres in the ring frame as listed, shape (B, N, 3), mm."""
        row, pattern = self.split(flat)
        x, y, z = _columns(self.places, self.chosen[row])
        if isinstance(self.places, HoleCircle):
            z = self.heights_mm[pattern]
        return np.stack([x, y, z], axis=-1)

    def key(self, flat: int) -> tuple[tuple[float, float], ...]:
        """The same for layouts that are turned or reflected copies of each other."""
        row, pattern = self.split(np.array([flat]))
        chosen = self.chosen[row[0]]
        if isinstance(self.places, SiteList):
            return tuple((float(k), 0.0) for k in chosen)
        gaps = np.diff(np.append(chosen, chosen[0] + self.places.count))
        heights = self.heights_mm[pattern[0]]
        forth = list(zip(heights.tolist(), gaps.tolist(), strict=True))
        back = list(zip(heights[::-1].tolist(), np.roll(gaps[::-1], -1).tolist(), strict=True))
        count = len(chosen)
        return min(tuple(ring[k:] + ring[:k]) for ring in (forth, back) for k in range(count))

    def copies(self, flat: int, *, reflected: bool) -> tuple[NDArray[np.intp], Array]:
        """Every place of a layout, and the heights.

        Returns
        -------
        chosen : ndarray of int, shape (M, N)
            Free holes of each turned copy, or the sites as listed.
        heights_mm : ndarray, shape (N,)
        """
        row, pattern = (int(part[0]) for part in self.split(np.array([flat])))
        chosen = self.chosen[row]
        if isinstance(self.places, SiteList):
            heights = np.array([self.places.sites[k].height_mm for k in chosen])
            return (chosen[:0] if reflected else chosen).reshape(-1, len(chosen)), heights
        turned = _turned(chosen[None], self.places.count, reflected=reflected)[0]
        return turned[self.places.free[turned].all(axis=1)], self.heights_mm[pattern]


def list_candidates(
    places: Places,
    count: int,
    target: ErrorTarget,
    *,
    relaxed: bool = False,
    spacing_mm: float = 0.0,
    out_of_plane_mm: float = 0.0,
) -> Candidates:
    """All layouts of `count` markers that keep the angle rule.

    Parameters
    ----------
    places : HoleCircle or SiteList
    count : int
    target : ErrorTarget
    relaxed : bool
        Allow layouts that keep only the relaxed rule (H17).
    spacing_mm : float
        Smallest distance of two balls, seen along the ring's axis.
    out_of_plane_mm : float
        Leave out heights whose standard deviation is smaller.

    Raises
    ------
    InputError
        If the count is not 3 to 5, or there are too many layouts to list.
    """
    if not MARKERS[0] <= count <= MARKERS[1]:
        raise InputError.of(
            "marker-count",
            "layouts are advised for this many markers",
            value=str(count),
            limit=f"{MARKERS[0]} to {MARKERS[1]}",
            hazard="H13",
            next_step="ask for 3 to 5 markers a ring",
        )
    heights = _patterns(places, count, out_of_plane_mm)
    _refuse_too_many(places, count, len(heights))
    chosen = _choices(places, count)
    chosen = chosen[_rule_kept(places, chosen, relaxed) & _apart(places, chosen, spacing_mm)]
    handed = _handed(places, chosen)
    chosen, handed = chosen[handed.any(axis=1)], handed[handed.any(axis=1)]
    listed = isinstance(places, SiteList)
    if listed and len(chosen):
        flat = np.std(_columns(places, chosen)[2], axis=1) < out_of_plane_mm
        chosen, handed = chosen[~flat], handed[~flat]
    errors = [np.zeros(0)]
    step = max(1, ROWS // max(1, len(heights)))
    for start in range(0, len(chosen) if listed or len(heights) else 0, step):
        x, y, z = _columns(places, chosen[start : start + step])
        z = z if listed else heights
        errors.append(unit_square_errors(x, y, z, target, every_pair=not listed).ravel())
    return Candidates(places, chosen, heights, handed, np.concatenate(errors))


def _choices(places: Places, count: int) -> NDArray[np.intp]:
    """Choices of places, shape (K, N), each in the order of its sweep angles.

    On a hole circle one for all that are turned or reflected copies: hole 1 is taken, and no copy
    has gaps that come later in the order of words.
    """
    if isinstance(places, SiteList):
        around = np.argsort(
            np.mod([site.sweep_rad for site in places.sites], 2 * np.pi), kind="stable"
        )
        return around[_combinations(len(places.sites), count)]
    others = _combinations(places.count - 1, count - 1) + 1
    gaps = np.empty((len(others), count), np.intp)
    gaps[:, 0], gaps[:, -1] = others[:, 0], places.count - others[:, -1]
    gaps[:, 1:-1] = others[:, 1:] - others[:, :-1]
    largest = gaps[:, 0] >= gaps[:, 1]
    for k in range(2, count):
        largest &= gaps[:, 0] >= gaps[:, k]
    others, gaps = others[largest], gaps[largest]
    chosen = np.concatenate([np.zeros((len(others), 1), np.intp), others], axis=1)
    weight = (places.count + 1) ** np.arange(count)[::-1]
    word = gaps @ weight
    best = np.ones(len(gaps), bool)
    for ring in (gaps, gaps[:, ::-1]):
        for k in range(count):
            best &= word >= np.roll(ring, k, axis=1) @ weight
    return chosen[best]


def _combinations(total: int, count: int) -> NDArray[np.intp]:
    """All rising choices of `count` numbers below `total`, shape (K, count)."""
    rows = np.arange(total)[:, None]
    for _ in range(count - 1):
        room = total - 1 - rows[:, -1]
        first = np.repeat(np.cumsum(room) - room, room)
        following = np.repeat(rows[:, -1], room) + 1 + np.arange(room.sum()) - first
        rows = np.concatenate([np.repeat(rows, room, axis=0), following[:, None]], axis=1)
    return rows


def _patterns(places: Places, count: int, out_of_plane_mm: float) -> Array:
    """Heights of the balls in every order, shape (P, N), mm."""
    if isinstance(places, SiteList):
        return np.zeros((1, count))
    heights = np.array(places.heights_mm)
    patterns = np.stack(np.meshgrid(*[heights] * count, indexing="ij"), -1).reshape(-1, count)
    return patterns[np.std(patterns, axis=1) >= out_of_plane_mm]


def _refuse_too_many(places: Places, count: int, patterns: int) -> None:
    number = (
        comb(len(places.sites), count)
        if isinstance(places, SiteList)
        else comb(places.count - 1, count - 1) * max(1, patterns // (2 * count))
    )
    if number > MAX_LAYOUTS:
        raise InputError.of(
            "too-many-layouts",
            "the ring has too many places to compare every layout",
            value=str(number),
            limit=str(MAX_LAYOUTS),
            next_step="leave out holes or heights, or take fewer markers",
        )


def _columns(places: Places, chosen: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    """x, y and, of a list of sites, z of choices, each of the shape of `chosen`, mm."""
    if isinstance(places, HoleCircle):
        phi, t = places.sweep_rad, np.full(places.count, places.radius_mm)
        z = np.zeros(places.count)
    else:
        phi, t, z = (
            np.array([getattr(site, name) for site in places.sites])
            for name in ("sweep_rad", "radius_mm", "height_mm")
        )
    return (t * np.cos(phi))[chosen], (t * np.sin(phi))[chosen], z[chosen]


def _rule_kept(places: Places, chosen: NDArray[np.intp], relaxed: bool) -> NDArray[np.bool_]:
    """Whether three of the markers keep the rule, as `angle_rule` asks; shape (K,)."""
    if isinstance(places, HoleCircle):
        phi = places.sweep_rad
    else:
        phi = np.array([site.sweep_rad for site in places.sites])
    kept = np.zeros(len(chosen), bool)
    allowed = ("preferred", "relaxed") if relaxed else ("preferred",)
    for triple in combinations(range(chosen.shape[1]), 3):
        rest = np.flatnonzero(~kept)
        kept[rest] = np.isin(triple_rules(phi[chosen[rest][:, list(triple)]]), allowed)
    return kept


def _apart(places: Places, chosen: NDArray[np.intp], spacing_mm: float) -> NDArray[np.bool_]:
    """Whether no two balls are nearer than the spacing; shape (K,)."""
    x, y, _ = _columns(places, chosen)
    first, second = np.triu_indices(chosen.shape[1], 1)
    square = (x[:, first] - x[:, second]) ** 2 + (y[:, first] - y[:, second]) ** 2
    return np.all(square >= spacing_mm**2 - 1e-6, axis=1)


def _handed(places: Places, chosen: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether a copy, and a reflected one, fits into the free places; shape (K, 2)."""
    if isinstance(places, SiteList):
        return np.tile([True, False], (len(chosen), 1))
    if not places.occupied:
        return np.ones((len(chosen), 2), bool)
    fits = np.empty((len(chosen), 2), bool)
    for hand in (0, 1):
        copies = places.free[_turned(chosen, places.count, reflected=bool(hand))].all(axis=2)
        fits[:, hand] = np.any(copies, axis=1)
    return fits


def _turned(chosen: NDArray[np.intp], holes: int, *, reflected: bool) -> NDArray[np.intp]:
    """Every turned copy of choices on a circle, shape (K, N) to (K, holes, N)."""
    once = -chosen if reflected else chosen
    return np.mod(once[:, None, :] + np.arange(holes)[None, :, None], holes)
