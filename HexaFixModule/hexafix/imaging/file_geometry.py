"""What the header of an NRRD, NIfTI or MetaImage file says, by our own parsers."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import Fault, InputError
from hexafix.imaging.gantry_tilt import TILT_TOLERANCE_DEG

CORNER_TOLERANCE_MM = 0.01


@dataclass(frozen=True, eq=False)
class FileGeometry:
    """Grid of an image file as its header declares it.

    Attributes
    ----------
    size_ijk : tuple of 3 ints
    ijk_to_lps : ndarray, shape (4, 4)
        In mm, whatever the unit of the file.
    unit_mm : float
        The file's unit of length in mm.
    """

    size_ijk: tuple[int, int, int]
    ijk_to_lps: NDArray[np.float64]
    unit_mm: float = 1.0

    def corners_mm(self) -> NDArray[np.float64]:
        """Centres of the eight corner voxels in LPS, shape (8, 3), mm."""
        return corners_mm(self.size_ijk, self.ijk_to_lps)


def corners_mm(
    size_ijk: tuple[int, int, int], ijk_to_lps: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Centres of the eight corner voxels of a grid in LPS, shape (8, 3), mm."""
    ends = np.stack(np.meshgrid(*[(0, n - 1) for n in size_ijk], indexing="ij"), -1).reshape(-1, 3)
    return ends @ ijk_to_lps[:3, :3].T + ijk_to_lps[:3, 3]


def refuse_geometry(what: str, where: str, **details: str | None) -> Fault:
    """A fault for geometry that is missing or unusable (H07)."""
    details.setdefault("hazard", "H07")
    details.setdefault("next_step", "export the image again with its geometry in the patient")
    return Fault("no-geometry", what, where=where, **details)


def faults_of_grid(geometry: FileGeometry, where: str) -> list[Fault]:
    """Grids that are degenerate, not finite or sheared (H08)."""
    axes = geometry.ijk_to_lps[:3, :3]
    spacing = np.linalg.norm(axes, axis=0)
    if not np.all(np.isfinite(geometry.ijk_to_lps)) or spacing.min() < 1e-6:
        return [refuse_geometry("the voxel spacing is zero or not finite", where)]
    if min(geometry.size_ijk) < 2:
        size = " x ".join(map(str, geometry.size_ijk))
        return [
            Fault(
                "too-few-slices",
                "the image is not a volume",
                value=size,
                limit="at least 2 voxels along each axis",
                next_step="give the whole volume",
                hazard="H03",
                where=where,
            )
        ]
    cosines = (axes / spacing).T @ (axes / spacing)
    off = float(np.degrees(np.arcsin(min(1.0, np.abs(cosines - np.eye(3)).max()))))
    if off <= TILT_TOLERANCE_DEG:
        return []
    return [
        Fault(
            "sheared",
            "the axes of the voxel grid are not perpendicular",
            value=f"{off:.2f} deg",
            limit=f"{TILT_TOLERANCE_DEG:g} deg",
            next_step="resample the image to a rectangular grid or export it as DICOM",
            hazard="H08",
            where=where,
        )
    ]


def outside_folder(header: Path, data_file: str) -> bool:
    """Whether the data of a detached header lie outside the header's folder (H50)."""
    folder = header.resolve().parent
    if Path(data_file).is_absolute() or "\\" in data_file or ":" in data_file:
        return True
    return not (folder / data_file).resolve().is_relative_to(folder)


def detached_fault(where: str) -> Fault:
    """The fault for data outside the header's folder; the path itself is not repeated."""
    return Fault(
        "detached-data",
        "the header points to data outside its own folder",
        next_step="store the image in one file",
        hazard="H50",
        where=where,
    )


def require_three_dimensions(count: int, where: str) -> None:
    """Refuse a header that declares another number of dimensions than three."""
    if count != 3:
        raise InputError.of(
            "not-a-volume",
            "the image does not have three dimensions",
            value=f"{count} dimensions",
            limit="3",
            where=where,
            next_step="store one three-dimensional volume",
        )
