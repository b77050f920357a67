"""Reading a DICOM folder beside what a user would otherwise call."""

from __future__ import annotations

import gc
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from hexafix.imaging import Volume, read_volume
from hexafix.phantom.dicom_series import write_dicom_series


def reading_time(
    *, size_ijk: tuple[int, int, int] = (512, 512, 600), rounds: int = 5, seed: int = 1
) -> dict[str, Any]:
    """Time to read one uncompressed series, files in the system's cache.

    Parameters
    ----------
    size_ijk : tuple of int
    rounds : int
        Each reader reads the folder so often, in turn; the fastest of each counts.
    seed : int
        Decides the grey values (noise: nothing about the content helps any reader).

    Returns
    -------
    dict
        ``size_ijk``, ``hexafix_s``, ``simpleitk_s`` (SimpleITK's series reader with its own
        search for the files), ``pydicom_s`` (its pixels, sorted by position) and
        ``ratio`` (HexaFix over SimpleITK).
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_dicom_series(noise_volume(size_ijk, seed), folder, identity="reading")
        readers: dict[str, Callable[[], object]] = {
            "hexafix_s": lambda: read_volume(folder),
            "simpleitk_s": lambda: simpleitk_series(folder),
            "pydicom_s": lambda: _pydicom_series(folder),
        }
        best = dict.fromkeys(readers, np.inf)
        for _ in range(rounds):
            for reader, read in readers.items():
                gc.collect()
                start = time.perf_counter()
                read()
                best[reader] = min(best[reader], time.perf_counter() - start)
    return {**best, "size_ijk": list(size_ijk), "ratio": best["hexafix_s"] / best["simpleitk_s"]}


def simpleitk_series(folder: Path) -> object:
    """The folder by SimpleITK's series reader, as its own examples call it."""
    import SimpleITK as sitk  # noqa: N813 - the library's own abbreviation

    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    return reader.Execute()


def _pydicom_series(folder: Path) -> object:
    from pydicom import dcmread

    slices = [dcmread(path) for path in folder.iterdir()]
    slices.sort(key=lambda item: float(item.ImagePositionPatient[2]))
    return np.stack([item.pixel_array for item in slices])


def noise_volume(size_ijk: tuple[int, int, int], seed: int) -> Volume:
    """A volume of random HU, voxels 0.7 × 0.7 × 0.625 mm."""
    rng = np.random.default_rng(seed)
    i, j, k = size_ijk
    voxels = rng.integers(-1024, 3071, (k, j, i), np.int16)
    affine = np.diag([0.7, 0.7, 0.625, 1.0])
    affine[:3, 3] = -180.0, -210.0, 400.0
    return Volume(voxels, affine)
