"""One hash for one image, however it was stored."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numpy.typing import NDArray

from hexafix.threads import thread_count

# Corner positions enter on a grid of 1 µm, so that the rounding of a text header does not change
# the hash. The odd offset keeps decimal positions off the edges of that grid.
_GRID_MM = 1e-3
_OFFSET = 0.2718281828


def hash_slice(values: NDArray) -> bytes:
    """SHA-256 of one slice of voxels, shape (J, I), in little-endian order."""
    order = values.dtype.newbyteorder("<")
    return hashlib.sha256(np.ascontiguousarray(values, order).data).digest()


def combine(
    slice_hashes: Sequence[bytes],
    *,
    size_ijk: tuple[int, int, int],
    dtype: np.dtype,
    ijk_to_lps: NDArray,
) -> str:
    """The image's hash from its slices' hashes, its type, size and geometry.

    Parameters
    ----------
    slice_hashes : sequence of bytes
        `hash_slice` of each slice in order.
    size_ijk : tuple of int
    dtype : dtype
    ijk_to_lps : ndarray, shape (4, 4)
        Of a tilted stack the acquired, sheared one: its slices are hashed as they were acquired,
        so that the hash does not depend on how they are moved.
    """
    i, j, k = size_ijk
    ends = np.array([(0, 0, 0), (i - 1, 0, 0), (0, j - 1, 0), (0, 0, k - 1)], float)
    corners = ends @ ijk_to_lps[:3, :3].T + ijk_to_lps[:3, 3]
    geometry = np.floor(corners / _GRID_MM + _OFFSET).astype("<i8")
    total = hashlib.sha256(f"hexafix-volume-1 {dtype.name} {k} {j} {i}".encode())
    total.update(geometry.tobytes())
    for digest in slice_hashes:
        total.update(digest)
    return total.hexdigest()


def fingerprint(voxels: NDArray, ijk_to_lps: NDArray) -> str:
    """The hash of a whole volume in memory; parameters as in `combine`."""
    with ThreadPoolExecutor(thread_count()) as pool:
        hashes = list(pool.map(hash_slice, voxels))
    k, j, i = voxels.shape
    return combine(hashes, size_ijk=(i, j, k), dtype=voxels.dtype, ijk_to_lps=ijk_to_lps)
