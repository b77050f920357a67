"""The one door from files to a `Volume`."""

from __future__ import annotations

from pathlib import Path

from hexafix.errors import InputError
from hexafix.imaging.image_path import require_path
from hexafix.imaging.itk_file import format_of, read_itk_file
from hexafix.imaging.volume import Volume
from hexafix.progress import Progress, silent


def read_volume(
    path: str | Path, *, series_instance_uid: str | None = None, progress: Progress = silent
) -> Volume:
    """Read a CT in Hounsfield units with its place in the patient.

    Parameters
    ----------
    path : str or Path
        A folder with DICOM slices (at any depth), one multi-frame DICOM file, or an NRRD
        (.nrrd, .nhdr), NIfTI (.nii, .nii.gz) or MetaImage (.mha, .mhd) file.
    series_instance_uid : str, optional
        The series to read where a folder holds several.
    progress : Progress
        Watches, and may stop the reading by raising `Cancelled`.

    Returns
    -------
    Volume
        int16 where that loses nothing, else float32; its affine in LPS mm is never mirrored.

    Raises
    ------
    InputError
        If the path, a file or the choice of series is wrong.
    ImageRefused
        If geometry or content cannot be trusted, with all faults found.
    MissingLibrary
        If the pixels are compressed and the decoder is not installed.
    """
    path = require_path(Path(path))
    if path.is_file() and format_of(path):
        if series_instance_uid is not None:
            raise InputError.of(
                "series-not-found",
                "only DICOM holds series",
                where="image.series_instance_uid",
                next_step="leave out the SeriesInstanceUID",
            )
        return read_itk_file(path, progress)
    # Not at the top: pydicom takes long to import, and the other files need none of it.
    from hexafix.imaging.dicom_volume import read_dicom

    return read_dicom(path, series_instance_uid, progress)
