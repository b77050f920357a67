"""NRRD, NIfTI and MetaImage: voxels by SimpleITK, geometry by our own parsers, both compared."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import ImageRefused, InputError
from hexafix.imaging.file_geometry import (
    CORNER_TOLERANCE_MM,
    FileGeometry,
    corners_mm,
    faults_of_grid,
)
from hexafix.imaging.fingerprint import fingerprint
from hexafix.imaging.golden_image_files import ItkProof
from hexafix.imaging.grey_doubts import no_air, thick_slices
from hexafix.imaging.isolation import run_isolated
from hexafix.imaging.metaimage_header import read_metaimage_header
from hexafix.imaging.nifti_header import read_nifti_header
from hexafix.imaging.nrrd_header import read_nrrd_header
from hexafix.imaging.volume import MAX_VOXELS, ImageSource, Volume
from hexafix.progress import Progress

_INT16 = np.iinfo(np.int16)

# The child's limits: Python, NumPy and ITK themselves, then image and copy at eight bytes a voxel.
_BASE_MEMORY = 2 << 30
_LARGEST_VOXEL = 8
_BASE_SECONDS = 60.0
# Each slice costs time of its own: a file may not claim millions of them.
_MAX_SIDE = 20_000
# As slow as a file of 16 bit voxels on a bad network.
_VOXELS_PER_SECOND = 5e5

_PARSERS: dict[str, tuple[str, str, Callable[[Path], FileGeometry]]] = {
    ".nrrd": ("nrrd", "NrrdImageIO", read_nrrd_header),
    ".nhdr": ("nrrd", "NrrdImageIO", read_nrrd_header),
    ".nii": ("nifti", "NiftiImageIO", read_nifti_header),
    ".nii.gz": ("nifti", "NiftiImageIO", read_nifti_header),
    ".mha": ("metaimage", "MetaImageIO", read_metaimage_header),
    ".mhd": ("metaimage", "MetaImageIO", read_metaimage_header),
}


def format_of(path: Path) -> str | None:
    """The suffix by which a file is read here, None for any other file."""
    name = path.name.lower()
    return next((suffix for suffix in _PARSERS if name.endswith(suffix)), None)


def read_itk_file(path: Path, progress: Progress) -> Volume:
    """Read one NRRD, NIfTI or MetaImage file; see `hexafix.imaging.read_volume`."""
    kind, reader, parse = _PARSERS[format_of(path) or ""]
    progress("read image file", 0.0)
    try:
        geometry = parse(path)
    except OSError as error:
        raise InputError.of(
            "unreadable-file",
            "the image file cannot be read",
            value=error.strerror,
            next_step="check the file and its access rights",
        ) from error
    where = f"{kind} header"
    faults = faults_of_grid(geometry, where)
    if faults:
        raise ImageRefused(*faults)
    if max(geometry.size_ijk) > _MAX_SIDE or math.prod(geometry.size_ijk) > MAX_VOXELS:
        raise InputError.of(
            "volume-too-large",
            "the image has more voxels than any CT of a limb",
            value=" x ".join(f"{side:.6g}" for side in geometry.size_ijk),
            limit=f"{MAX_VOXELS:.2g} voxels, {_MAX_SIDE} along each axis",
            where=where,
            next_step="crop the CT around the fixator",
        )
    about, array = load_isolated(path.resolve(), reader, geometry)
    _refuse_doubts(about)
    _refuse_other_geometry(geometry, array, np.array(about["affine"]), kind)
    progress("read image file", 0.5)
    voxels = _hounsfield(array)
    source = ImageSource(
        kind=kind,
        sha256=fingerprint(voxels, geometry.ijk_to_lps),
        warnings=tuple(_warnings(voxels, geometry)),
    )
    progress("read image file", 1.0)
    return Volume(voxels, geometry.ijk_to_lps, source)


def load_isolated(
    path: Path, reader: str, geometry: FileGeometry
) -> tuple[dict[str, Any], NDArray]:
    """What `itk_reader.load_with_itk` returns, read in a child process that is proved before."""
    size = int(np.prod(geometry.size_ijk))
    memory = _BASE_MEMORY + 2 * size * _LARGEST_VOXEL
    seconds = _BASE_SECONDS + size / _VOXELS_PER_SECOND
    with ItkProof(reader) as proof:
        arguments = [*proof.request, str(path), reader]
        results = run_isolated("itk", arguments, memory_bytes=memory, seconds=seconds)
        with closing(results):
            proof.check(results)
            return next(results)


def _refuse_doubts(about: dict[str, Any]) -> None:
    """Refuse what ITK warned about: its warnings are about geometry that it changed (H53)."""
    if about["warnings"]:
        raise ImageRefused.of(
            "reader-warning",
            "the reader was in doubt about the image file",
            value=f"{about['warnings']} warnings",
            limit="0",
            next_step="convert the CT again from DICOM",
            hazard="H53",
        )
    if about["dimension"] != 3 or about["components"] != 1:
        raise InputError.of(
            "not-a-volume",
            "the image is not one three-dimensional grey-value volume",
            value=f"{about['dimension']} dimensions, {about['components']} components",
            limit="3 dimensions, 1 component",
            next_step="store one three-dimensional CT volume",
        )


def _refuse_other_geometry(
    geometry: FileGeometry, array: NDArray, itk_affine: NDArray[np.float64], kind: str
) -> None:
    """Two roads to one geometry: our parser and ITK must meet at every corner."""
    if kind != "nifti":
        # ITK converts the unit of NIfTI only and hands the others' numbers through.
        itk_affine = itk_affine.copy()
        itk_affine[:3] *= geometry.unit_mm
    apart = np.linalg.norm(
        geometry.corners_mm() - corners_mm(geometry.size_ijk, itk_affine), axis=1
    )
    if array.shape[::-1] == geometry.size_ijk and apart.max() <= CORNER_TOLERANCE_MM:
        return
    raise ImageRefused.of(
        "readers-disagree",
        "two readers place the image differently",
        value=f"{apart.max():.3f} mm at a corner",
        limit=f"{CORNER_TOLERANCE_MM:g} mm",
        next_step="convert the CT again from DICOM",
        hazard="H08",
    )


def _hounsfield(array: NDArray) -> NDArray:
    """The values as int16 where that loses nothing, else as float32."""
    if array.dtype == np.int16:
        return array
    low, high = float(array.min()), float(array.max())
    if not np.isfinite([low, high]).all():
        raise ImageRefused.of(
            "not-finite",
            "the image holds values that are no numbers",
            next_step="convert the CT again from DICOM",
            hazard="H55",
        )
    if low >= _INT16.min and high <= _INT16.max:
        short = array.astype(np.int16)
        if np.array_equal(short, array):
            return short
    return array.astype(np.float32)


def _warnings(voxels: NDArray, geometry: FileGeometry) -> list[str]:
    spacing = np.linalg.norm(geometry.ijk_to_lps[:3, :3], axis=0)
    return [*thick_slices(float(spacing.max())), *no_air(float(voxels.min()))]
