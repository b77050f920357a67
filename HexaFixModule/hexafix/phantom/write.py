"""A phantom as the folder a user would bring: image, case, and the truth beside them."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np

from hexafix.errors import InputError
from hexafix.imaging import Volume
from hexafix.phantom.dicom_series import write_dicom_series
from hexafix.phantom.make import Phantom
from hexafix.phantom.spec import PhantomSpec
from hexafix.progress import Progress, silent

ImageFormat = Literal["dicom", "nrrd", "nifti", "metaimage"]
FILE_NAMES = {"nrrd": "ct.nrrd", "nifti": "ct.nii.gz", "metaimage": "ct.mha"}


def write_phantom(
    phantom: Phantom,
    out: str | Path,
    *,
    image_format: ImageFormat = "dicom",
    progress: Progress = silent,
) -> Path:
    """Write the image, ``truth.json`` and ``case.json`` into a folder.

    Parameters
    ----------
    phantom : Phantom
    out : path
        Made if needed; must be empty of an earlier phantom.
    image_format : str
        ``dicom`` (folder ``ct``), ``nrrd``, ``nifti`` or ``metaimage``.
    progress : Progress

    Returns
    -------
    Path
        The case file.

    Raises
    ------
    InputError
        If the format is unknown, or the folder holds something already.
    """
    if image_format not in get_args(ImageFormat):
        raise InputError.of(
            "unknown-format",
            "unknown image format",
            value=repr(image_format),
            limit=", ".join(get_args(ImageFormat)),
        )
    folder = Path(out)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError.of(
            "not-empty",
            "the phantom needs a new or an empty folder",
            where=str(folder),
            next_step="name another folder, or empty this one",
        )
    folder.mkdir(parents=True, exist_ok=True)
    case = json.loads(json.dumps(phantom.case))
    if image_format == "dicom":
        write_dicom_series(
            phantom.volume,
            folder / "ct",
            identity=json.dumps(phantom.truth, sort_keys=True),
            header=dicom_header(phantom.spec),
            progress=progress,
        )
        case["image"]["path"] = "ct"
    else:
        if phantom.spec.gantry_tilt_rad:
            raise InputError.of(
                "tilt-needs-dicom",
                "only DICOM slices can hold a tilted gantry",
                value=image_format,
                limit="dicom",
            )
        case["image"]["path"] = FILE_NAMES[image_format]
        write_image_file(phantom.volume, folder / FILE_NAMES[image_format])
        progress("writing the image", 1.0)
    _write_json(folder / "truth.json", phantom.truth)
    _write_json(folder / "case.json", case)
    return folder / "case.json"


def dicom_header(spec: PhantomSpec) -> dict[str, Any]:
    """Header elements of a scan that is not plain.

    GantryDetectorTilt gets the sign that one vendor writes and another contradicts: whoever
    believes it instead of the positions shears the volume twice.
    """
    header: dict[str, Any] = {}
    if spec.gantry_tilt_rad:
        header["GantryDetectorTilt"] = f"{np.degrees(spec.gantry_tilt_rad):.1f}"
    if spec.slice_plane != "axial":
        header["ImageType"] = ["DERIVED", "SECONDARY", "REFORMATTED"]
    return header


def write_image_file(volume: Volume, path: Path) -> None:
    """Write a volume as NRRD (space LPS), NIfTI or MetaImage, by the file name's ending."""
    import SimpleITK

    image = SimpleITK.GetImageFromArray(volume.voxels)
    image.SetOrigin(volume.ijk_to_lps[:3, 3].tolist())
    image.SetSpacing(volume.spacing_mm.tolist())
    image.SetDirection(volume.direction.ravel().tolist())
    SimpleITK.WriteImage(image, str(path), useCompression=False)


def _write_json(path: Path, document: dict[str, Any]) -> None:
    text = json.dumps(document, indent=2, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")
