"""The sweep measured: against a plain loop, and its memory against the sample count."""

from __future__ import annotations

import time
import tracemalloc
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.study.error_model import ErrorModel, error_maps
from hexafix.study.estimates import PAPER_AND_FIT, PAPER_SAMPLES
from hexafix.study.jacobians import model_jacobians
from hexafix.study.layouts import RingLayouts, three_marker_layouts
from hexafix.study.sampling import BLOCK, LinearKernel, sample_moments

Array = NDArray[np.float64]

LOOPED = 40
"""Layouts that the plain loop does; it is slow, and every layout costs the same."""


def sweep_speed(*, workers: int | None = None, rounds: int = 3) -> dict[str, Any]:
    """Seconds of the whole sweep, of a plain loop over it, and peak memory of two sample counts.

    Parameters
    ----------
    workers : int, optional
        As in `runner.in_order`.
    rounds : int
        The best of so many runs counts.

    Returns
    -------
    dict
        ``layouts``, ``samples``, ``sweep_s`` (Jacobian matrices included), ``loop_s`` (one sample
        at a time, on some layouts, scaled to all), ``ratio``, ``memory_ratio`` (peak of a million
        samples of one layout over that of a quarter of them).
    """
    errors, layouts = ErrorModel(), three_marker_layouts()
    seconds = []
    for _ in range(rounds):
        start = time.perf_counter()
        sample_moments(_kernel(layouts, errors), samples=PAPER_SAMPLES, seed=0, workers=workers)
        seconds.append(time.perf_counter() - start)
    start = time.perf_counter()
    some = layouts.take(np.linspace(0, len(layouts) - 1, LOOPED).astype(int))
    for maps in _kernel(some, errors).maps:
        plain_loop(maps[0], PAPER_SAMPLES, np.random.default_rng(0))
    loop = (time.perf_counter() - start) * len(layouts) / LOOPED
    one = some.take(slice(0, 1))
    few = [_peak(_kernel(one, errors), count * BLOCK) for count in (128, 512)]
    return {
        "layouts": len(layouts),
        "samples": PAPER_SAMPLES,
        "sweep_s": min(seconds),
        "loop_s": loop,
        "ratio": loop / min(seconds),
        "memory_ratio": few[1] / few[0],
    }


def plain_loop(maps: Array, samples: int, rng: np.random.Generator) -> Array:
    """E|ΔX| sample by sample, maps (6, 6N) to (6,). Source: Eq. (23), (24), as written."""
    total = np.zeros(len(maps))
    for _ in range(samples):
        total += np.abs(maps @ rng.standard_normal(maps.shape[1]))
    return total / samples


def _kernel(layouts: RingLayouts, errors: ErrorModel) -> LinearKernel:
    maps = error_maps(model_jacobians(layouts, errors), layouts, errors)
    return LinearKernel(np.ascontiguousarray(maps[:, PAPER_AND_FIT]), np.arange(len(layouts)))


def _peak(kernel: LinearKernel, samples: int) -> int:
    """Most memory in use while sampling, bytes."""
    tracemalloc.start()
    try:
        sample_moments(kernel, samples=samples, seed=0, workers=1)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
