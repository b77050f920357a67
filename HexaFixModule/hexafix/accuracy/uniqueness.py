"""How far a layout is from fitting itself under wrong numbers, in a mirror, or another ring."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hexafix.hardware import MarkerLayout
from hexafix.recognition.congruence import embeddings
from hexafix.recognition.rigid import Array, rigid_rms_mm

WORK = 3_000
"""Partial assignments held at once; beyond, the answer is only a lower bound."""

FALLBACK_MM = (10.0, 5.0)
"""RMS limits tried when the full search is too much work."""


def best_relabelling(layout: MarkerLayout) -> tuple[float, tuple[int, ...]]:
    """Smallest RMS of a layout against itself under wrong numbers, proper rotations only (H18).

    Returns
    -------
    rms_mm : float
        A lower bound where the search is too much work (many nearly even markers).
    order : tuple of int
        Index of the marker in whose place each marker lies, in the order of the sites.
    """
    tried = wrong_numberings(_sweeps(layout))[0]
    return _smallest(layout.points_mm, layout.points_mm, tried, itself=True)


def wrong_numberings(sweep_rad: Array) -> NDArray[np.intp]:
    """Likely wrong numberings of layouts, shape (K, N) of sweep angles to (K, P, N).

    Turned around the ring in either sense, and every two markers exchanged. For three markers
    that is every wrong numbering.
    """
    around = around_ring(sweep_rad)
    turned = numberings_around(around, around)[:, 1:]
    count = sweep_rad.shape[1]
    swaps = np.tile(np.arange(count), (count * (count - 1) // 2, 1))
    rows = np.arange(len(swaps))
    first, second = np.triu_indices(count, 1)
    swaps[rows, first], swaps[rows, second] = second, first
    return np.concatenate([turned, np.broadcast_to(swaps, (len(around), *swaps.shape))], axis=1)


def best_exchange(one: MarkerLayout, other: MarkerLayout) -> tuple[float, tuple[int, ...]]:
    """Smallest RMS of one ring's layout taken for the other's, over all numberings (H20).

    Both need the same number of markers; the result is as in `best_relabelling`.
    """
    return _smallest(one.points_mm, other.points_mm, _guesses(one, other), itself=False)


def mirror_rms_mm(layout: MarkerLayout) -> float:
    """Smallest RMS of a layout's mirror image against it, over all numberings (H01).

    0 for coplanar markers: they cannot show a mirrored image.
    """
    points = layout.points_mm
    guesses = _guesses(layout, layout)
    return _smallest(points, points, guesses, itself=False, mirrored=True)[0]


def around_ring(sweep_rad: Array) -> NDArray[np.intp]:
    """Order of the markers around the ring, shape (K, N) of sweep angles to (K, N)."""
    return np.argsort(np.mod(sweep_rad, 2 * np.pi), axis=1, kind="stable")


def numberings_around(
    around_one: NDArray[np.intp], around_other: NDArray[np.intp]
) -> NDArray[np.intp]:
    """Numberings of one ring's markers for the other's that keep the order around the ring.

    Parameters
    ----------
    around_one, around_other : ndarray of int, shape (K, N)
        Of `around_ring`.

    Returns
    -------
    ndarray of int, shape (K, 2N, N)
        First the N turns, the one without a turn first, then the N turns of the reversed ring.
    """
    count = around_one.shape[1]
    result = np.empty((len(around_one), 2 * count, count), dtype=np.intp)
    for k in range(count):
        for row, ring in ((k, around_one), (count + k, around_one[:, ::-1])):
            np.put_along_axis(result[:, row], around_other, np.roll(ring, k, axis=1), axis=1)
    return result


def _guesses(one: MarkerLayout, other: MarkerLayout) -> NDArray[np.intp]:
    return numberings_around(around_ring(_sweeps(one)), around_ring(_sweeps(other)))[0]


def _sweeps(layout: MarkerLayout) -> Array:
    return np.array([[site.sweep_rad for site in layout.sites]])


def _smallest(
    points: Array,
    layout: Array,
    tried: NDArray[np.intp],
    *,
    itself: bool,
    mirrored: bool = False,
) -> tuple[float, tuple[int, ...]]:
    """Best of the guesses, then of everything below it."""
    rms = np.atleast_1d(rigid_rms_mm(points_mm=points[tried], layout_mm=layout, mirrored=mirrored))
    best, order = float(rms.min()), tuple(map(int, tried[np.argmin(rms)]))
    for limit in (best, *(f for f in FALLBACK_MM if f < best)):
        found = embeddings(
            points_mm=points,
            layout_mm=layout,
            max_rms_mm=limit,
            mirrored=mirrored,
            max_partial=WORK,
        )
        for balls, value in zip(found.balls, found.rms_mm, strict=True):
            if not (itself and np.array_equal(balls, np.arange(len(balls)))):
                if value < best:
                    best, order = float(value), tuple(map(int, balls))
                break
        if found.complete:
            return min(best, limit), order
    return min(best, FALLBACK_MM[-1]), order
