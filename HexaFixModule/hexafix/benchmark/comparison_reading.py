"""Reading a DICOM folder: HexaFix beside SimpleITK's series reader and pydicom."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.benchmark.comparison_race import Raced, Tool
from hexafix.benchmark.reading import noise_volume, simpleitk_series
from hexafix.imaging import Volume, read_volume
from hexafix.phantom.dicom_series import write_dicom_series

Array = NDArray[np.float64]


def write_data(folder: Path, *, quick: bool, seed: int) -> dict[str, Any]:
    """Write an uncompressed series of random HU into a folder; return the settings."""
    size = (96, 96, 24) if quick else (512, 512, 400)
    volume = noise_volume(size, seed)
    write_dicom_series(volume, folder / "ct", identity="comparison")
    np.save(folder / "truth.npy", _digest(volume))
    return {"size_ijk": list(size), "voxels_mb": volume.voxels.nbytes / 2**20}


def judge(raced: dict[str, Raced], folder: Path) -> dict[str, list[dict[str, Any]]]:
    """Whether every voxel is right, and how far off the first and the last voxel is placed."""
    truth = np.load(folder / "truth.npy")
    return {
        name: [
            {
                "case": "series",
                "voxels_equal": bool(one.result[0] == truth[0]),
                "place_error_mm": float(
                    np.linalg.norm((one.result - truth)[1:].reshape(2, 3), axis=1).max()
                ),
            }
        ]
        for name, one in raced.items()
    }


def _digest(volume: Volume) -> Array:
    """Checksum of the voxels, then first and last voxel in LPS, mm; shape (7,)."""
    last = np.array(volume.voxels.shape[::-1]) - 1
    ends = volume.lps_from_ijk(np.array([[0, 0, 0], last]))
    return _seven(volume.voxels, ends)


def _seven(voxels: NDArray[Any], ends: Any) -> Array:
    checksum = zlib.crc32(np.ascontiguousarray(voxels, np.int16).data)
    return np.array([float(checksum), *np.ravel(ends)])


def _digest_simpleitk(image: Any) -> Array:
    import SimpleITK as sitk  # noqa: N813 - the library's own abbreviation

    last = [size - 1 for size in image.GetSize()]
    ends = [image.TransformIndexToPhysicalPoint(index) for index in ([0, 0, 0], last)]
    return _seven(sitk.GetArrayViewFromImage(image), ends)


def _by_pydicom(folder: Path) -> tuple[NDArray[Any], list[Array]]:
    """Slices in order of their height, rescaled to HU, with the ends of first and last slice."""
    from pydicom import dcmread

    slices = [dcmread(path) for path in folder.iterdir()]
    slices.sort(key=lambda item: float(item.ImagePositionPatient[2]))
    voxels = np.empty((len(slices), *slices[0].pixel_array.shape), np.int16)
    for k, item in enumerate(slices):
        voxels[k] = item.pixel_array * float(item.RescaleSlope) + float(item.RescaleIntercept)
    first, last = slices[0], slices[-1]
    row, column = np.array(last.ImageOrientationPatient, float).reshape(2, 3)
    down, across = (float(pitch) for pitch in last.PixelSpacing)
    end = np.array(last.ImagePositionPatient, float)
    end += row * across * (last.Columns - 1) + column * down * (last.Rows - 1)
    return voxels, [np.array(first.ImagePositionPatient, float), end]


def _tool(
    name: str,
    words: str,
    run: Callable[[Path], Any],
    digest: Callable[[Any], Array],
    *libraries: tuple[str, str],
) -> Tool:
    def prepare(folder: Path) -> Path:
        import pydicom  # noqa: F401 - loading the libraries is not what is timed
        import SimpleITK  # noqa: F401

        return folder / "ct"

    return Tool(name, words, "hexafix", run, digest, prepare, libraries)


TOOLS = (
    _tool("hexafix", "HexaFix: read_volume, all its checks", read_volume, _digest),
    _tool(
        "simpleitk",
        "SimpleITK: ImageSeriesReader",
        simpleitk_series,
        _digest_simpleitk,
        ("SimpleITK", "SimpleITK"),
    ),
    _tool(
        "pydicom",
        "pydicom: read, sort, stack, rescale",
        _by_pydicom,
        lambda read: _seven(*read),
        ("pydicom", "pydicom"),
    ),
)
