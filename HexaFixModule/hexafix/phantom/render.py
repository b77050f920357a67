"""From solids to voxels, slab by slab on several threads: paint, streak, add noise, clip."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from hexafix.phantom.balls import ExactBall, paint_ball
from hexafix.phantom.solids import Array, Grid, Solid, paint
from hexafix.phantom.spec import AIR_HU, LOWEST_HU, PhantomSpec
from hexafix.phantom.streaks import Streak, add_streak
from hexafix.progress import Progress
from hexafix.threads import thread_count

SLAB_SLICES = 8
AXIAL_WEIGHTS = np.array([0.3, 1.0, 0.3]) / np.sqrt(1.18)
"""Share of a slice's white noise in its neighbours, unit variance; for correlated noise."""


def render(
    spec: PhantomSpec,
    grid: Grid,
    solids: list[Solid],
    balls: list[ExactBall],
    streaks: list[Streak],
    *,
    progress: Progress,
    workers: int | None = None,
) -> NDArray[np.int16]:
    """The CT's voxels, shape (K, J, I), HU.

    Parameters
    ----------
    spec : PhantomSpec
    grid : Grid
    solids : list of Solid
        In painting order.
    balls : list of ExactBall
        Painted last.
    streaks : list of Streak
    progress : Progress
    workers : int or None
        Threads; the voxels do not depend on it.
    """
    ni, nj, nk = grid.size_ijk
    voxels = np.empty((nk, nj, ni), np.int16)
    highest = spec.clip_hu if spec.clip_hu is not None else 31743
    response = noise_response(grid, spec.noise_correlation_mm)

    def slab_of(first: int) -> None:
        last = min(first + SLAB_SLICES, nk)
        slab = np.full((last - first, nj, ni), AIR_HU, np.float32)
        for solid in solids:
            paint(slab, first, solid, grid)
        for ball in balls:
            paint_ball(slab, first, ball, grid)
        for streak in streaks:
            add_streak(slab, first, streak, grid)
        if spec.noise_hu > 0.0:
            add_noise(slab, first, spec, response)
        np.rint(slab, out=slab)
        np.clip(slab, LOWEST_HU, highest, out=slab)
        voxels[first:last] = slab

    starts = range(0, nk, SLAB_SLICES)
    with ThreadPoolExecutor(workers or thread_count(min(8, os.cpu_count() or 1))) as pool:
        jobs = [pool.submit(slab_of, first) for first in starts]
        try:
            for done, job in enumerate(jobs, start=1):
                job.result()
                progress("synthetic CT", done / len(jobs))
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return voxels


def noise_response(grid: Grid, correlation_mm: float) -> NDArray[np.float32] | None:
    """Frequency response, shape (J, I // 2 + 1), of unit variance; None: white noise.

    The shape is that of filtered back-projection: rising with the frequency, most at about
    0.24 / correlation, then cut off.
    """
    if correlation_mm <= 0.0:
        return None
    ni, nj, _ = grid.size_ijk
    spacing = grid.spacing_mm
    f = np.hypot(fft.fftfreq(nj, spacing[1])[:, None], fft.rfftfreq(ni, spacing[0])[None, :])
    scaled = 2.0 * f * correlation_mm
    response = (0.15 + scaled) * np.exp(-((1.5 * scaled) ** 2))
    twice = np.full(response.shape[1], 2.0)
    twice[0] = 1.0
    if ni % 2 == 0:
        twice[-1] = 1.0
    power = float(np.sum(response**2 * twice) / (ni * nj))
    return (response / np.sqrt(power)).astype(np.float32)


def add_noise(
    slab: Array, first_slice: int, spec: PhantomSpec, response: NDArray[np.float32] | None
) -> None:
    """Add the seeded noise of the slab's slices, each from its own stream.

    Parameters
    ----------
    slab : ndarray, shape (K, J, I), float32
        HU, changed in place.
    first_slice : int
    spec : PhantomSpec
    response : ndarray or None
        From `noise_response`.
    """
    shape = slab.shape[1:]

    def white(k: int) -> Array:
        stream = np.random.SFC64(np.random.SeedSequence([spec.seed, 2, k]))
        return np.random.Generator(stream).standard_normal(shape, dtype=np.float32)

    if response is None:
        for number, slice_hu in enumerate(slab):
            slice_hu += np.float32(spec.noise_hu) * white(first_slice + number + 1)
        return
    spectra = {}
    for number, slice_hu in enumerate(slab):
        total = np.zeros(response.shape, np.complex64)
        for step, weight in enumerate(AXIAL_WEIGHTS):
            k = first_slice + number + step
            if k not in spectra:
                spectra[k] = fft.rfft2(white(k)) * response
            total += np.float32(weight) * spectra[k]
        spectra.pop(first_slice + number, None)
        slice_hu += np.float32(spec.noise_hu) * fft.irfft2(total, s=shape)
