"""Directions spread evenly over the sphere, each with its antipode."""

from __future__ import annotations

from functools import cache

import numpy as np
import scipy
from numpy.typing import NDArray


@cache
def sphere_directions(count: int) -> NDArray[np.float64]:
    """Unit vectors, shape (count, 3), read-only; vector i + count/2 is the antipode of vector i.

    Parameters
    ----------
    count : int
        An even number.

    Notes
    -----
    The upper half of a Fibonacci spiral of `count` points and its mirror in the origin.
    """
    half = count // 2
    z = 1.0 - (2.0 * np.arange(half) + 1.0) / count
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(half)
    ring = np.sqrt(1.0 - z**2)
    upper = np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)
    directions = np.vstack([upper, -upper])
    directions.setflags(write=False)
    return directions


@cache
def neighbour_average(count: int, sigma_rad: float) -> scipy.sparse.csr_array:
    """Gaussian average over neighbouring directions, sparse shape (count, count), rows sum to 1."""
    directions = sphere_directions(count)
    cosine = np.clip(directions @ directions.T, -1.0, 1.0)
    weight = np.exp(-0.5 * (np.arccos(cosine) / sigma_rad) ** 2)
    weight[weight < 0.02] = 0.0
    weight /= weight.sum(axis=1, keepdims=True)
    return scipy.sparse.csr_array(weight)
