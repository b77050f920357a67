"""What users, archives and writers do to an image or a case before it is planned."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pydicom
from pydicom.dataset import Dataset
from pydicom.uid import UID, DeflatedExplicitVRLittleEndian, RLELossless

from hexafix.imaging import Volume
from hexafix.scenarios.scenario import CaseChange, FolderChange, VolumeChange

OTHER_UID = "1.2.826.0.1.3680043.8.498.77"
"""Root of the UIDs of what does not belong to the phantom's series."""

BASIC_TEXT_SR = UID("1.2.840.10008.5.1.4.1.1.88.11")


# The image before it is stored


def mirrored(axis: Literal["i", "j", "k"]) -> VolumeChange:
    """The voxels turned over along one axis while the geometry stays as it was."""

    def change(volume: Volume) -> Volume:
        voxels = np.ascontiguousarray(np.flip(volume.voxels, "kji".index(axis)))
        return replace(volume, voxels=voxels)

    return change


# The DICOM folder


def _slices(folder: Path) -> list[tuple[Path, Dataset]]:
    """Files and their datasets from the feet of the stack to its head, by position."""
    found = [(path, pydicom.dcmread(path)) for path in sorted(folder.rglob("*.dcm"))]
    row, column = np.array(found[0][1].ImageOrientationPatient, float).reshape(2, 3)
    normal = np.cross(row, column)
    return sorted(found, key=lambda item: float(normal @ np.array(item[1].ImagePositionPatient)))


def lost_slice(folder: Path) -> None:
    """One slice in the middle was not exported."""
    slices = _slices(folder)
    slices[len(slices) // 2][0].unlink()


def uneven_spacing(folder: Path) -> None:
    """The upper half of the stack lies 0.4 mm further up."""
    slices = _slices(folder)
    for path, dataset in slices[len(slices) // 2 :]:
        position = [float(value) for value in dataset.ImagePositionPatient]
        dataset.ImagePositionPatient = [*position[:2], round(position[2] + 0.4, 6)]
        dataset.save_as(path)


def pixel_spacing_scaled(factor: float) -> FolderChange:
    """The header's pixels are larger than the scanner's, about the middle of each slice."""

    def change(folder: Path) -> None:
        for path, dataset in _slices(folder):
            pitch = np.array(dataset.PixelSpacing, float)
            axes = np.array(dataset.ImageOrientationPatient, float).reshape(2, 3)
            half = 0.5 * np.array([dataset.Columns - 1, dataset.Rows - 1])
            shift = (half * pitch[::-1] * (factor - 1.0)) @ axes
            moved = np.array(dataset.ImagePositionPatient, float) - shift
            dataset.ImagePositionPatient = [f"{value:.6f}" for value in moved]
            dataset.PixelSpacing = [f"{value:.8f}" for value in pitch * factor]
            dataset.save_as(path)

    return change


def without_geometry(folder: Path) -> None:
    """The positions were stripped, as some anonymisers do."""
    for path, dataset in _slices(folder):
        del dataset.ImagePositionPatient
        dataset.save_as(path)


def two_frames_of_reference(folder: Path) -> None:
    """The patient was registered anew half way."""
    slices = _slices(folder)
    for path, dataset in slices[len(slices) // 2 :]:
        dataset.FrameOfReferenceUID = OTHER_UID + ".1"
        dataset.save_as(path)


def doubled_slice(folder: Path) -> None:
    """One slice was exported twice."""
    path = _slices(folder)[5][0]
    shutil.copy(path, path.with_name("COPY.dcm"))


def in_subfolders(folder: Path) -> None:
    """The archive spread the slices over folders, without regard to their order."""
    for number, path in enumerate(sorted(folder.glob("*.dcm"))):
        place = folder / f"DIR{number % 3}"
        place.mkdir(exist_ok=True)
        path.rename(place / path.with_suffix("").name)


def localizer_and_dose_report(folder: Path) -> None:
    """Two scouts and a structured report lie beside the slices."""
    dataset = _slices(folder)[0][1]
    for number, axes in enumerate(([0, 1, 0, 0, 0, -1], [1, 0, 0, 0, 0, -1])):
        dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = UID(
            f"{OTHER_UID}.2.{number}"
        )
        dataset.SeriesInstanceUID = OTHER_UID + ".3"
        dataset.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
        dataset.ImageOrientationPatient = axes
        dataset.save_as(folder / f"SCOUT{number}.dcm")
    for keyword in ("PixelData", "Rows", "Columns", "PixelSpacing", "ImagePositionPatient",
                    "ImageOrientationPatient", "BitsAllocated", "ImageType"):  # fmt: skip
        delattr(dataset, keyword)
    dataset.Modality = "SR"
    dataset.SOPClassUID = dataset.file_meta.MediaStorageSOPClassUID = BASIC_TEXT_SR
    dataset.SeriesInstanceUID = OTHER_UID + ".4"
    dataset.save_as(folder / "DOSE.dcm")


def second_series(folder: Path) -> None:
    """The same scan reconstructed again, shifted and under another SeriesInstanceUID."""
    for number, (_, dataset) in enumerate(_slices(folder)):
        uid = UID(f"{OTHER_UID}.5.{number}")
        dataset.SOPInstanceUID = dataset.file_meta.MediaStorageSOPInstanceUID = uid
        dataset.SeriesInstanceUID = OTHER_UID + ".6"
        position = [float(value) for value in dataset.ImagePositionPatient]
        dataset.ImagePositionPatient = [round(position[0] + 25.0, 6), *position[1:]]
        dataset.save_as(folder / f"SECOND{number}.dcm")


def stored_as(syntax: Literal["rle", "deflated"]) -> FolderChange:
    """The pixels in another lossless transfer syntax."""

    def change(folder: Path) -> None:
        for path, dataset in _slices(folder):
            if syntax == "rle":
                dataset.compress(RLELossless)
            else:
                dataset.file_meta.TransferSyntaxUID = DeflatedExplicitVRLittleEndian
            dataset.save_as(path)

    return change


# The case document


def merged(**parts: Any) -> CaseChange:
    """Keys of the document's parts given other values: ``merged(schedule={...})``."""

    def change(case: dict[str, Any], _: Mapping[str, Any]) -> None:
        for key, value in parts.items():
            both = isinstance(value, dict) and isinstance(case.get(key), dict)
            case[key] = {**case[key], **value} if both else value

    return change


def reading(strut: int, error_mm: float) -> CaseChange:
    """The reading of a strut, 1 to 6, mistyped by so much."""

    def change(case: dict[str, Any], _: Mapping[str, Any]) -> None:
        case["strut_readings_mm"][strut - 1] += error_mm

    return change


def readings(*order: int, plus_mm: float = 0.0, times: float = 1.0) -> CaseChange:
    """The readings in another order, strut 1 to 6, shifted or in another unit."""

    def change(case: dict[str, Any], _: Mapping[str, Any]) -> None:
        given = case["strut_readings_mm"]
        case["strut_readings_mm"] = [
            round(given[number - 1] * times + plus_mm, 6) for number in order
        ]

    return change


IN_ORDER = (1, 2, 3, 4, 5, 6)


def marker(number: int, **values: float) -> CaseChange:
    """A marker of the layout written with other values than it was built with."""

    def change(case: dict[str, Any], _: Mapping[str, Any]) -> None:
        for ring in ("proximal", "distal"):
            for site in case["markers"][ring]:
                if site["number"] == number:
                    site.update(values)

    return change


def one_more_marker(ring: str, **values: float) -> CaseChange:
    """The layout tells a ball that is not on the ring (it fell off, or was never there)."""

    def change(case: dict[str, Any], _: Mapping[str, Any]) -> None:
        case["markers"][ring].append(values)

    return change


def rings_exchanged(case: dict[str, Any], _: Mapping[str, Any]) -> None:
    """The two rings' layouts stand under each other's name."""
    rings = case["markers"]
    rings["proximal"], rings["distal"] = rings["distal"], rings["proximal"]


def numbered_by_hand(*swapped: int) -> CaseChange:
    """The user clicked every ball, to half a millimetre; two numbers may be taken for each other.

    Parameters
    ----------
    *swapped : int
        Two marker numbers, or none.
    """

    def change(case: dict[str, Any], truth: Mapping[str, Any]) -> None:
        places = {
            ball["number"]: [round(2.0 * x) / 2.0 for x in ball["center_mm"]]
            for ball in truth["balls"]
        }
        if swapped:
            one, other = swapped
            places[one], places[other] = places[other], places[one]
        case["numbering"] = {str(number): place for number, place in places.items()}

    return change


def structures_at_risk(case: dict[str, Any], truth: Mapping[str, Any]) -> None:
    """A nerve and a vessel beside the moving fragment's end are named."""
    fragment = truth["target"]["moving"]
    center = np.array(truth["fracture"][f"center_{fragment}_lps_mm"])
    points = center + np.array([[14.0, 22.0, -6.0], [-18.0, 15.0, 9.0]])
    case["schedule"]["structures_at_risk_lps_mm"] = np.round(points, 1).tolist()


def series_named(case: dict[str, Any], truth: Mapping[str, Any]) -> None:
    """The user names the series; its UID is looked up in the folder when the case is written."""
    case["image"]["series_instance_uid"] = truth["series_instance_uid"]
