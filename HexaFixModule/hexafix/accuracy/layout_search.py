"""The candidates that can be numbered, in the order of their error."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import permutations
from math import factorial

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.layout_candidates import Candidates
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM, Array, triangle_heights_mm

FIRST_BATCH, LARGEST_BATCH = 128, 8_192
"""Candidates tested at once, doubled from batch to batch."""

EXACT_BATCH = 32
"""Candidates compared under every numbering at once."""

FIRST_SORTED = 4_096
"""Best candidates sorted first; sixteen times as many each time they are used up."""

NEWTON_STEPS, NEWTON_REACH = 2, 1e-6
"""Steps that make the closed form exact, and the share of the value that one may change."""

RMS_TOLERANCE_MM = 1e-6
"""A layout this little below a margin still keeps it."""


@dataclass(frozen=True, slots=True)
class Feasible:
    """A candidate that keeps every margin of its own ring.

    Attributes
    ----------
    flat : int
        Index into the `Candidates`.
    unit_error_mm : float
        Ranking error at a ball error of 1 mm along each axis.
    """

    flat: int
    unit_error_mm: float


def assignment_rms_mm(
    one: Array, other: Array, orders: NDArray[np.intp], *, mirrored: bool = False
) -> Array:
    """RMS of many rings' balls against layouts under many numberings.

    Parameters
    ----------
    one : ndarray, shape (B, N, 3)
        Balls, mm.
    other : ndarray, shape (B, N, 3)
        Layouts, mm.
    orders : ndarray of int, shape (P, N)
        Ball of each marker of the layout.
    mirrored : bool
        Fit the mirrored layout.

    Returns
    -------
    ndarray, shape (B, P), mm

    Notes
    -----
    As `rigid_rms_mm`, without the rotation: the sum s of the singular values of H = Σ m rᵀ, the
    smallest with the sign of det H, is the largest root of (s² - e)² = 8 s det H + 4 c, with e the
    squared norm of H and c that of its cofactors. The eigenvalues of HᵀH in closed form come near,
    Newton's steps the rest of the way.
    """
    a = one - one.mean(axis=1, keepdims=True)
    b = other - other.mean(axis=1, keepdims=True)
    h = np.einsum("bpni,bnj->ijbp", a[:, orders], b)
    total = np.sum(a**2, axis=(1, 2)) + np.sum(b**2, axis=(1, 2))
    cofactors = np.array(
        [
            [
                h[i - 2, j - 2] * h[i - 1, j - 1] - h[i - 2, j - 1] * h[i - 1, j - 2]
                for j in range(3)
            ]
            for i in range(3)
        ]
    )
    det = np.sum(h[0] * cofactors[0], axis=0) * (-1.0 if mirrored else 1.0)
    held = _near_root(h, det)
    square, cofactor_square = np.sum(h**2, axis=(0, 1)), np.sum(cofactors**2, axis=(0, 1))
    for _ in range(NEWTON_STEPS):
        rest = held**2 - square
        value = rest**2 - 8.0 * held * det - 4.0 * cofactor_square
        slope = 4.0 * held * rest - 8.0 * det
        step = np.divide(value, slope, out=np.zeros_like(value), where=slope > 0.0)
        # Where two roots are close a step means nothing: the start is that near already.
        held = held - np.clip(step, -NEWTON_REACH * held, NEWTON_REACH * held)
    return np.sqrt(np.maximum(total[:, None] - 2.0 * held, 0.0) / one.shape[1])


def _near_root(h: Array, det: Array) -> Array:
    """The signed sum of the singular values of matrices, shape (3, 3, ...), to 7 digits."""
    largest, middle = _two_singular_values(h)
    product = largest * middle
    smallest = np.divide(det, product, out=np.zeros_like(det), where=product > 1e-9)
    return largest + middle + smallest


def _two_singular_values(s: Array) -> tuple[Array, Array]:
    """Largest and middle singular value of matrices, shape (3, 3, ...)."""
    a, b, c = (np.sum(s[:, k] ** 2, axis=0) for k in range(3))
    d, e, f = (np.sum(s[:, j] * s[:, k], axis=0) for j, k in ((0, 1), (0, 2), (1, 2)))
    q = (a + b + c) / 3.0
    a, b, c = a - q, b - q, c - q
    p = np.sqrt((a * a + b * b + c * c + 2.0 * (d * d + e * e + f * f)) / 6.0)
    half = (a * (b * c - f * f) - d * (d * c - e * f) + e * (d * f - b * e)) / 2.0
    cube = p**3
    angle = np.arccos(np.clip(np.divide(half, cube, out=np.ones_like(p), where=cube > 0.0), -1, 1))
    first = q + 2.0 * p * np.cos(angle / 3.0)
    third = q + 2.0 * p * np.cos(angle / 3.0 + 2.0 * np.pi / 3.0)
    return np.sqrt(np.maximum(first, 0.0)), np.sqrt(np.maximum(3.0 * q - first - third, 0.0))


def orders_around(count: int) -> NDArray[np.intp]:
    """Numberings of markers in the order of their angles that keep it, shape (2N, N).

    First the turns, the one without a turn first, then the turns of the reversed ring.
    """
    turns = (np.arange(count)[:, None] + np.arange(count)[None]) % count
    return np.concatenate([turns, turns[:, ::-1]])


def every_order(count: int) -> NDArray[np.intp]:
    """All numberings, shape (N!, N), the right one first."""
    return np.array(list(permutations(range(count))), dtype=np.intp).reshape(factorial(count), -1)


def feasible(
    candidates: Candidates, *, margin_mm: float, mirror_mm: float | None
) -> Iterator[Feasible]:
    """Candidates that can be numbered, lowest error first, each shape once.

    Parameters
    ----------
    candidates : Candidates
    margin_mm : float
        Smallest RMS of any wrong numbering (H18).
    mirror_mm : float or None
        Smallest RMS of the mirror image (H01); None where none can be asked for.

    Notes
    -----
    Every candidate is tested until the caller has enough, so nothing better is left out. Likely
    wrong numberings come first: they can only show that a candidate fails.
    """
    seen: set[tuple] = set()
    for batch in _in_order(candidates.unit_square_mm2):
        points = candidates.points_mm(batch)
        likely = _likely_kept(points, margin_mm, mirror_mm)
        batch, points = batch[likely], points[likely]
        for start in range(0, len(batch), EXACT_BATCH):
            part = slice(start, start + EXACT_BATCH)
            kept = _kept(points[part], margin_mm, mirror_mm)
            for flat in batch[part][kept].tolist():
                key = candidates.key(flat)
                if key not in seen:
                    seen.add(key)
                    yield Feasible(flat, float(np.sqrt(candidates.unit_square_mm2[flat])))


def _in_order(values: Array) -> Iterator[NDArray[np.intp]]:
    """Indices of finite values from the smallest up, in growing batches; ties by their index."""
    # Equal errors differ in the last bits: rounding lets the index decide alike everywhere.
    rounded = np.round(values, 9)
    rest = np.flatnonzero(np.isfinite(rounded))
    size, take = FIRST_BATCH, FIRST_SORTED
    while len(rest):
        if len(rest) > take:
            bound = np.partition(rounded[rest], take)[take]
            low = rounded[rest] <= bound
            now, rest = rest[low], rest[~low]
        else:
            now, rest = rest, rest[:0]
        now = now[np.argsort(rounded[now], kind="stable")]
        take *= 16
        start = 0
        while start < len(now):
            yield now[start : start + size]
            start += size
            size = min(2 * size, LARGEST_BATCH)


def _likely_kept(points: Array, margin_mm: float, mirror_mm: float | None) -> NDArray[np.bool_]:
    """False where a likely numbering already breaks a margin, shape (B,); points (B, N, 3)."""
    count = points.shape[1]
    around = orders_around(count)
    swaps = np.tile(np.arange(count), (count * (count - 1) // 2, 1))
    first, second = np.triu_indices(count, 1)
    rows = np.arange(len(swaps))
    swaps[rows, first], swaps[rows, second] = second, first
    kept = _below(points, points, np.concatenate([around[1:], swaps])) >= margin_mm - (
        RMS_TOLERANCE_MM
    )  # fmt: skip
    if mirror_mm is not None:
        rest = np.flatnonzero(kept)
        mirror = _below(points[rest], points[rest], around, mirrored=True)
        kept[rest] = mirror >= mirror_mm - RMS_TOLERANCE_MM
    return kept


def _kept(points: Array, margin_mm: float, mirror_mm: float | None) -> NDArray[np.bool_]:
    """Whether the layouts hold an orientation and keep both margins under every numbering."""
    count = points.shape[1]
    triples = np.array([order[:3] for order in every_order(count)])
    triples = np.unique(np.sort(triples, axis=1), axis=0)
    kept = triangle_heights_mm(points[:, triples]).max(axis=1) >= MIN_TRIANGLE_HEIGHT_MM
    orders = every_order(count)
    kept &= _below(points, points, orders[1:]) >= margin_mm - RMS_TOLERANCE_MM
    if mirror_mm is not None:
        mirror = _below(points, points, orders, mirrored=True)
        kept &= mirror >= mirror_mm - RMS_TOLERANCE_MM
    return kept


def keep_margins(points: Array, margin_mm: float, mirror_mm: float | None) -> NDArray[np.bool_]:
    """Whether layouts, shape (B, N, 3) in angular order, keep the margins of `feasible`; (B,)."""
    kept = _likely_kept(points, margin_mm, mirror_mm)
    rest = np.flatnonzero(kept)
    for start in range(0, len(rest), EXACT_BATCH):
        part = rest[start : start + EXACT_BATCH]
        kept[part] = _kept(points[part], margin_mm, mirror_mm)
    return kept


def exchange_kept(one: Array, other: Array, margin_mm: float) -> NDArray[np.bool_]:
    """Whether rings cannot be taken for each other (H20); both (B, N, 3), in angular order."""
    kept = _below(one, other, orders_around(one.shape[1])) >= margin_mm - RMS_TOLERANCE_MM
    rest = np.flatnonzero(kept)
    if len(rest):
        rms = _below(one[rest], other[rest], every_order(one.shape[1]))
        kept[rest] = rms >= margin_mm - RMS_TOLERANCE_MM
    return kept


def _below(one: Array, other: Array, orders: NDArray[np.intp], *, mirrored: bool = False) -> Array:
    """Smallest RMS over the numberings, shape (B,), mm."""
    if len(one) == 0:
        return np.zeros(0)
    return assignment_rms_mm(one, other, orders, mirrored=mirrored).min(axis=1)
