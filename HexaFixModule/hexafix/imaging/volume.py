"""The one image value: voxels and their place in the patient."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

MAX_VOXELS = 1_600_000_000
"""Far above any CT of a limb (1024 × 1024 × 1500), far below what would exhaust a workstation."""


@dataclass(frozen=True, eq=False)
class Acquisition:
    """What the scanner saw, where the volume's grid is wider and air fills the rest.

    Attributes
    ----------
    ijk_to_lps : ndarray, shape (4, 4)
        Voxel indices (i, j, k, 1) of the slices as acquired to LPS mm; its axes are not
        perpendicular: slice follows slice aside. Read-only.
    size_ijk : tuple of int
        Columns, rows and slices as acquired.
    tilt_deg : float
        Angle between the line of slice origins and the slice normal; sign by
        `hexafix.imaging.gantry_tilt.GantryTilt`.
    """

    ijk_to_lps: NDArray[np.float64]
    size_ijk: tuple[int, int, int]
    tilt_deg: float

    def __post_init__(self) -> None:
        affine = np.array(self.ijk_to_lps, float)
        affine.setflags(write=False)
        object.__setattr__(self, "ijk_to_lps", affine)


@dataclass(frozen=True, slots=True)
class ImageSource:
    """Where a volume came from, free of patient identity.

    Attributes
    ----------
    kind : str
        ``dicom``, ``nrrd``, ``nifti``, ``metaimage`` or ``memory``.
    sha256 : str
        Hash over geometry and voxels: the same image gives the same hash however it was stored.
        Of a tilted series the acquired slices and places are hashed.
    slice_thickness_mm : float or None
        Nominal slice thickness where the header tells it.
    laterality, body_part, patient_position : str or None
        Header words that gates compare with the case.
    warnings : tuple of str
        What the reader wants shown to the user.
    acquisition : Acquisition or None
        What was acquired, where slices of a tilted gantry were moved to a perpendicular grid;
        None where the voxels are the acquired ones.
    """

    kind: str = "memory"
    sha256: str = ""
    slice_thickness_mm: float | None = None
    laterality: str | None = None
    body_part: str | None = None
    patient_position: str | None = None
    warnings: tuple[str, ...] = field(default=())
    acquisition: Acquisition | None = None


@dataclass(frozen=True, eq=False)
class Volume:
    """CT voxels in Hounsfield units with their place in the DICOM patient frame.

    Attributes
    ----------
    voxels : ndarray, shape (K, J, I)
        HU, integer or float, indexed [k, j, i] (slice, row, column), read-only.
    ijk_to_lps : ndarray, shape (4, 4)
        Maps voxel indices (i, j, k, 1) to LPS mm; never mirrored away: its determinant keeps the
        sign of the stack as it was stored.
    source : ImageSource
    """

    voxels: NDArray
    ijk_to_lps: NDArray[np.float64]
    source: ImageSource = field(default_factory=ImageSource)

    def __post_init__(self) -> None:
        voxels = self.voxels.view()
        voxels.setflags(write=False)
        affine = np.array(self.ijk_to_lps, float)
        affine.setflags(write=False)
        object.__setattr__(self, "voxels", voxels)
        object.__setattr__(self, "ijk_to_lps", affine)

    @property
    def size_ijk(self) -> tuple[int, int, int]:
        """Number of voxels along i, j and k."""
        k, j, i = self.voxels.shape
        return i, j, k

    @property
    def spacing_mm(self) -> NDArray[np.float64]:
        """Voxel pitch along i, j and k, shape (3,), mm."""
        return np.linalg.norm(self.ijk_to_lps[:3, :3], axis=0)

    @property
    def direction(self) -> NDArray[np.float64]:
        """Unit vectors of i, j and k in LPS as columns, shape (3, 3)."""
        return self.ijk_to_lps[:3, :3] / self.spacing_mm

    def lps_from_ijk(self, ijk: ArrayLike) -> NDArray[np.float64]:
        """Points, shape (..., 3), LPS mm, of (fractional) voxel indices in the order i, j, k."""
        return np.asarray(ijk, float) @ self.ijk_to_lps[:3, :3].T + self.ijk_to_lps[:3, 3]

    def ijk_from_lps(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """Fractional voxel indices i, j, k, shape (..., 3), of points in LPS mm."""
        offset = np.asarray(points_mm, float) - self.ijk_to_lps[:3, 3]
        return offset @ np.linalg.inv(self.ijk_to_lps[:3, :3]).T

    def corners_mm(self) -> NDArray[np.float64]:
        """Centres of the eight corner voxels in LPS, shape (8, 3), mm."""
        ends = [(0, n - 1) for n in self.size_ijk]
        return self.lps_from_ijk(np.stack(np.meshgrid(*ends, indexing="ij"), -1).reshape(-1, 3))
