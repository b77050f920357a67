"""Monte Carlo of pose errors in fixed blocks: bounded memory, one answer on any machine."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import InputError
from hexafix.progress import Progress, silent
from hexafix.study.runner import in_order

Array = NDArray[np.float64]

BLOCK = 2000
"""Samples drawn from one seed. The answer depends on it, on nothing else of how work is cut."""


class Kernel(Protocol):
    """What is sampled: quantities of each of G layouts as functions of standard normal numbers.

    Attributes
    ----------
    index : ndarray of int, shape (G,)
        Names each layout's random stream.
    columns : int
        Standard normal numbers a sample needs.
    shape : tuple of int
        (M, 6): quantities of a sample.
    """

    @property
    def index(self) -> NDArray[np.intp]:
        """Names of the random streams."""
        ...

    @property
    def columns(self) -> int:
        """Standard normal numbers a sample."""
        ...

    @property
    def shape(self) -> tuple[int, int]:
        """Quantities a sample, (M, 6)."""
        ...

    def take(self, part: slice) -> Self:
        """The same for some of the layouts."""
        ...

    def sample(self, layout: int, normals: Array, out: Array) -> None:
        """Quantities of one layout: standard normals (K, columns) to `out`, shape (K, 6M)."""
        ...


@dataclass(frozen=True, eq=False)
class LinearKernel:
    """|ΔX| of the linear models. Source: Eq. (23), (24).

    Attributes
    ----------
    maps : ndarray, shape (G, M, 6, 6N)
        Of `error_model.error_maps`.
    index : ndarray of int, shape (G,)
    """

    maps: Array
    index: NDArray[np.intp]

    @property
    def columns(self) -> int:
        """6N."""
        return self.maps.shape[-1]

    @property
    def shape(self) -> tuple[int, int]:
        """(M, 6)."""
        return self.maps.shape[1], 6

    def take(self, part: slice) -> LinearKernel:
        """The same for some of the layouts."""
        return LinearKernel(self.maps[part], self.index[part])

    def sample(self, layout: int, normals: Array, out: Array) -> None:
        """|ΔX| of one layout: standard normals (K, 6N) to `out`, shape (K, 6M), mm and radians."""
        np.dot(normals, self.maps[layout].reshape(-1, self.columns).T, out=out)
        np.abs(out, out=out)


@dataclass(frozen=True, eq=False)
class Moments:
    """Means of sampled quantities and how sure they are.

    Attributes
    ----------
    samples : int
        For each layout.
    mean : ndarray, shape (G, M, 6)
    covariance : ndarray, shape (G, M, 6, 6)
        Of one sample.
    """

    samples: int
    mean: Array
    covariance: Array

    @property
    def standard_error(self) -> Array:
        """Of the means, shape (G, M, 6)."""
        return np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1) / self.samples)

    def volume_standard_error(self, expected: Array | None = None) -> tuple[Array, Array]:
        """Of Eq. (28) on the means, position and orientation, shape (G, M) each.

        Parameters
        ----------
        expected : ndarray, shape (G, M, 6), optional
            Where the volume error is taken, if not at the means.
        """
        at = self.mean if expected is None else expected
        return volume_standard_errors(at, self.covariance, self.samples)


def volume_standard_errors(expected: Array, covariance: Array, samples: int) -> tuple[Array, Array]:
    """Standard errors of the volume errors of means, in mm and in rad, shape (...) each.

    Parameters
    ----------
    expected : ndarray, shape (..., 6)
        The means.
    covariance : ndarray, shape (..., 6, 6)
        Of one sample.
    samples : int
    """
    errors = []
    for part in (slice(0, 3), slice(3, 6)):
        direction = expected[..., part] / np.linalg.norm(expected[..., part], axis=-1)[..., None]
        variance = np.einsum(
            "...i,...ij,...j->...", direction, covariance[..., part, part], direction
        )
        errors.append(np.sqrt(np.maximum(variance, 0.0) / samples))
    return errors[0], errors[1]


def sample_moments(
    kernel: Kernel,
    *,
    samples: int,
    seed: int,
    workers: int | None = None,
    backend: str | None = None,
    layouts_per_task: int = 32,
    blocks_per_task: int = 16,
    progress: Progress = silent,
    step: str = "sample",
) -> Moments:
    """Means and covariances of a kernel's quantities.

    Parameters
    ----------
    kernel : Kernel
    samples : int
        For each layout.
    seed : int
        Every block of `BLOCK` samples of every layout has its own child of this seed, as
        `SeedSequence.spawn` makes them, so the answer is the same to the last bit however the
        work is cut and whoever does it.
    workers, backend
        As in `runner.in_order`.
    layouts_per_task, blocks_per_task : int
        How the work is cut.
    progress : Progress
    step : str
        Its name for the progress.

    Raises
    ------
    InputError
        Fewer than two samples.
    """
    if samples < 2:
        raise InputError.of(
            "too-few-samples", "an error estimate needs samples", value=str(samples), limit="2"
        )
    count = len(kernel.index)
    total = np.zeros((count, *kernel.shape))
    square = np.zeros((count, *kernel.shape, 6))
    tasks = _tasks(kernel, samples, seed, layouts_per_task, blocks_per_task)
    done, blocks = 0, -(-samples // BLOCK)
    for first, sums, products in in_order(block_sums, tasks, workers=workers, backend=backend):
        part = slice(first, first + sums.shape[1])
        # block by block, so that the rounding does not depend on how the blocks are cut
        for block_sum, block_product in zip(sums, products, strict=True):
            total[part] += block_sum
            square[part] += block_product
        done += sums.shape[0] * sums.shape[1]
        progress(step, done / (blocks * count))
    mean = total / samples
    covariance = square / samples - mean[..., :, None] * mean[..., None, :]
    return Moments(samples, mean, covariance * samples / (samples - 1))


def _tasks(
    kernel: Kernel, samples: int, seed: int, layouts: int, blocks: int
) -> Iterator[tuple[Kernel, int, int, int, int, int]]:
    count, every = len(kernel.index), -(-samples // BLOCK)
    for block in range(0, every, blocks):
        for first in range(0, count, layouts):
            part = kernel.take(slice(first, first + layouts))
            yield part, first, block, min(block + blocks, every), samples, seed


def block_sums(
    kernel: Kernel, first: int, start: int, stop: int, samples: int, seed: int
) -> tuple[int, Array, Array]:
    """Sums of blocks of samples: what one worker does.

    Parameters
    ----------
    kernel : Kernel
    first : int
        Place of its first layout among all.
    start, stop : int
        Blocks.
    samples, seed : int
        As in `sample_moments`.

    Returns
    -------
    first : int
    sums : ndarray, shape (blocks, G, M, 6)
    products : ndarray, shape (blocks, G, M, 6, 6)
    """
    models, parts = kernel.shape
    count = models * parts
    shape = (stop - start, len(kernel.index), *kernel.shape)
    sums, products = np.empty(shape), np.empty((*shape, parts))
    normals = np.empty((min(BLOCK, samples), kernel.columns))
    values = np.empty((len(normals), count))
    each, ones = np.arange(models), np.ones(len(normals))
    for row, block in enumerate(range(start, stop)):
        size = min(BLOCK, samples - block * BLOCK)
        drawn, found = normals[:size], values[:size]
        for layout, stream in enumerate(kernel.index):
            child = np.random.SeedSequence(seed, spawn_key=(int(stream), block))
            np.random.Generator(np.random.SFC64(child)).standard_normal(out=drawn)
            kernel.sample(layout, drawn, found)
            sums[row, layout] = (ones[:size] @ found).reshape(kernel.shape)
            # one product of all quantities is faster than one for each model
            square = (found.T @ found).reshape(kernel.shape * 2)
            products[row, layout] = square[each, :, each]
    return first, sums, products
