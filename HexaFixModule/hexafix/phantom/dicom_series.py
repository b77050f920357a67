"""A volume as a real CT Image Storage series."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.uid import UID, CTImageStorage, ExplicitVRLittleEndian, generate_uid

from hexafix.imaging import Volume
from hexafix.progress import Progress, silent

INTERCEPT_HU = -1024
UID_PREFIX = "1.2.826.0.1.3680043.8.498."
"""pydicom's root, under which anyone may hash UIDs."""


def decimal_string(value: float) -> str:
    """The number in the 16 characters of a DICOM decimal string (VR DS), as exact as they allow."""
    for digits in range(17, 0, -1):
        text = f"{value + 0.0:.{digits}g}"
        if len(text) <= 16:
            return text
    raise AssertionError("a number with one digit always fits")


def write_dicom_series(
    volume: Volume,
    folder: Path,
    *,
    identity: str,
    psf_note: str = "",
    header: Mapping[str, Any] | None = None,
    progress: Progress = silent,
) -> str:
    """Write one file per slice; the file names are not in slice order.

    Parameters
    ----------
    volume : Volume
        HU, int16 range.
    folder : Path
        Made if needed.
    identity : str
        Decides the UIDs together with the voxels: the same input gives the same bytes.
    psf_note : str
        Convolution kernel's name in the header.
    header : mapping of str to value, optional
        Further elements of every slice, by DICOM keyword; they replace the usual ones.
    progress : Progress

    Returns
    -------
    str
        The SeriesInstanceUID.
    """
    folder.mkdir(parents=True, exist_ok=True)
    digest = hashlib.sha256(f"{identity} {volume.source.sha256}".encode())
    digest.update(volume.ijk_to_lps.tobytes())
    root = digest.hexdigest()
    template = _template(volume, root, psf_note)
    for keyword, value in (header or {}).items():
        setattr(template, keyword, value)
    affine = volume.ijk_to_lps
    normal = volume.direction[:, 2]
    slices = volume.size_ijk[2]
    for k in range(slices):
        position = affine[:3, 3] + k * affine[:3, 2]
        uid = _uid(root, "instance", k)
        dataset = FileDataset("", template, file_meta=_meta(uid), preamble=b"\0" * 128)
        dataset.SOPInstanceUID = uid
        dataset.InstanceNumber = k + 1
        dataset.ImagePositionPatient = [decimal_string(v) for v in position]
        dataset.SliceLocation = decimal_string(float(position @ normal))
        stored = volume.voxels[k].astype(np.int32) - INTERCEPT_HU
        dataset.PixelData = stored.astype("<i2").tobytes()
        name = hashlib.sha256(f"{root} {k}".encode()).hexdigest()[:8].upper()
        dataset.save_as(folder / f"IM{name}.dcm", enforce_file_format=True)
        if k % 16 == 15 or k == slices - 1:
            progress("writing DICOM", (k + 1) / slices)
    return str(template.SeriesInstanceUID)


def _uid(root: str, *parts: object) -> UID:
    return generate_uid(prefix=UID_PREFIX, entropy_srcs=[root, *map(str, parts)])


def _meta(uid: UID) -> FileMetaDataset:
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = CTImageStorage
    meta.MediaStorageSOPInstanceUID = uid
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.ImplementationClassUID = UID(UID_PREFIX + "1")
    meta.ImplementationVersionName = "HEXAFIX"
    return meta


def _template(volume: Volume, root: str, psf_note: str) -> Dataset:
    """What all slices share."""
    source, spacing = volume.source, volume.spacing_mm
    d = Dataset()
    d.SpecificCharacterSet = "ISO_IR 192"
    d.ImageType = ["ORIGINAL", "PRIMARY", "AXIAL"]
    d.SOPClassUID = CTImageStorage
    d.StudyDate = d.SeriesDate = d.AcquisitionDate = d.ContentDate = "20261130"
    d.StudyTime = d.SeriesTime = d.AcquisitionTime = d.ContentTime = "101500"
    d.AccessionNumber = ""
    d.Modality = "CT"
    d.Manufacturer = "HexaFix"
    d.ManufacturerModelName = "synthetic phantom"
    d.ReferringPhysicianName = ""
    d.StudyDescription = "Synthetic phantom, no patient"
    d.SeriesDescription = "External fixator"
    d.PatientName = "Phantom^Synthetic"
    d.PatientID = "HEXAFIX-" + root[:8].upper()
    d.PatientBirthDate = ""
    d.PatientSex = "O"
    d.BodyPartExamined = source.body_part or "EXTREMITY"
    d.SliceThickness = decimal_string(source.slice_thickness_mm or float(spacing[2]))
    d.KVP = "120"
    d.GantryDetectorTilt = "0"
    d.ConvolutionKernel = psf_note or "PHANTOM"
    d.PatientPosition = source.patient_position or "HFS"
    d.StudyInstanceUID = _uid(root, "study")
    d.SeriesInstanceUID = _uid(root, "series")
    d.StudyID = "1"
    d.SeriesNumber = 2
    d.AcquisitionNumber = 1
    d.ImageOrientationPatient = [decimal_string(v) for v in volume.direction[:, :2].T.ravel()]
    d.FrameOfReferenceUID = _uid(root, "frame")
    d.PositionReferenceIndicator = ""
    if source.laterality:
        d.Laterality = source.laterality
    d.SamplesPerPixel = 1
    d.PhotometricInterpretation = "MONOCHROME2"
    d.Rows, d.Columns = volume.size_ijk[1], volume.size_ijk[0]
    d.PixelSpacing = [decimal_string(float(spacing[1])), decimal_string(float(spacing[0]))]
    d.BitsAllocated = d.BitsStored = 16
    d.HighBit, d.PixelRepresentation = 15, 1
    d.WindowCenter, d.WindowWidth = "400", "2400"
    d.RescaleIntercept, d.RescaleSlope, d.RescaleType = str(INTERCEPT_HU), "1", "HU"
    return d
