"""Which series lie in a folder, and the one that is read."""

from __future__ import annotations

import os
import warnings
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from hexafix.errors import Fault, ImageRefused, InputError, MissingLibrary
from hexafix.imaging.dicom_header import NotAnImage, SliceHeader, read_headers
from hexafix.imaging.header_words import shown_image_type, shown_modality
from hexafix.imaging.hounsfield import faults_of_values
from hexafix.imaging.image_path import require_path
from hexafix.imaging.pixel_data import faults_of_length
from hexafix.imaging.slice_stack import TILT_TOLERANCE_DEG, arrange, listed
from hexafix.progress import Progress, silent

# A study with all its reconstructions has some ten thousand; a whole disk has millions.
MAX_FILES = 200_000
SECONDARY_CAPTURE = "1.2.840.10008.5.1.4.1.1.7"
_SCOUT_WORDS = {"LOCALIZER", "SCOUT", "TOPOGRAM", "SURVIEW"}


@dataclass(frozen=True, slots=True)
class SeriesSummary:
    """One series of a folder, for the user's choice; nothing in it names a patient.

    Attributes
    ----------
    number : int
        Place in the list, from 1.
    series_instance_uid : str
        Shown only where the user asks for it: it leads to the patient in the hospital's archive.
    modality : str
    image_type : tuple of str
    slices : int
        Number of slices (frames) that would be read.
    size_ij : tuple of int
        Columns and rows.
    spacing_mm : tuple of float or None
        Between columns, between rows, between slices along their normal; None where the header
        lacks it.
    orientation : str
        ``axial``, ``coronal``, ``sagittal``, ``oblique`` or ``unknown``.
    tilt_deg : float or None
        Angle between the slice normal and the line of slice origins, signed as at
        `hexafix.imaging.gantry_tilt.GantryTilt`; None where there is no line.
    excluded : str or None
        Why the series can never be the volume (localizer, secondary capture, ...).
    faults : tuple of Fault
        What would make reading it be refused, as far as headers tell.
    """

    number: int
    series_instance_uid: str
    modality: str
    image_type: tuple[str, ...]
    slices: int
    size_ij: tuple[int, int]
    spacing_mm: tuple[float, float, float] | None
    orientation: str
    tilt_deg: float | None
    excluded: str | None
    faults: tuple[Fault, ...] = ()

    @property
    def description(self) -> str:
        """One line for people."""
        spacing = "no spacing"
        if self.spacing_mm:
            spacing = " x ".join(f"{value:.3f}" for value in self.spacing_mm) + " mm"
        text = (
            f"{self.modality or 'no modality'}, {self.slices} slices of "
            f"{self.size_ij[0]} x {self.size_ij[1]}, {spacing}, {self.orientation}"
        )
        if self.tilt_deg is not None and abs(self.tilt_deg) > TILT_TOLERANCE_DEG:
            text += f", tilted by {self.tilt_deg:+.2f} deg"
        return text + (f", left out: {self.excluded}" if self.excluded else "")


@dataclass(frozen=True)
class DicomFolder:
    """All slices below a folder and how many files were passed over, by reason."""

    slices: tuple[SliceHeader, ...]
    skipped: dict[str, int]


def scan(path: Path, progress: Progress = silent) -> DicomFolder:
    """Headers of every DICOM slice in a file or below a folder, in no meaningful order."""
    files = [path] if path.is_file() else list(_files(path))
    slices: list[SliceHeader] = []
    skipped: Counter[str] = Counter()
    with warnings.catch_warnings():
        # pydicom quotes header values in its warnings, and those may name the patient.
        warnings.simplefilter("ignore")
        for index, file in enumerate(files):
            if index % 32 == 0:
                progress("read DICOM headers", index / len(files))
            try:
                slices += read_headers(file)
            except NotAnImage as reason:
                skipped[str(reason)] += 1
    progress("read DICOM headers", 1.0)
    return DicomFolder(tuple(slices), dict(skipped))


def _files(folder: Path) -> Iterable[Path]:
    def fail(error: OSError) -> None:
        raise InputError.of(
            "unreadable-folder",
            "the image folder or a folder in it cannot be read",
            value=error.strerror,
            next_step="check the path and its access rights",
        )

    count = 0
    for root, folders, names in os.walk(folder, onerror=fail):
        folders.sort()
        count += len(names)
        if count > MAX_FILES:
            raise InputError.of(
                "too-many-files",
                "the image folder holds more files than any CT",
                value=f"more than {MAX_FILES}",
                limit=str(MAX_FILES),
                next_step="give the folder of the series alone",
            )
        yield from (Path(root, name) for name in sorted(names))


def exclusion(item: SliceHeader) -> str | None:
    """Why a slice can never belong to the volume, None for an ordinary slice."""
    if _SCOUT_WORDS & {word.upper() for word in item.image_type[2:]}:
        return "localizer"
    if item.sop_class.startswith(SECONDARY_CAPTURE):
        return "secondary capture"
    if item.pixels.samples != 1:
        return "colour image"
    return None


def faults_of_patients(slices: Sequence[SliceHeader]) -> list[Fault]:
    """Slices of one series that name different patients, told without naming them (H38)."""
    counts = Counter(item.patient for item in slices)
    if len(counts) < 2:
        return []
    usual = counts.most_common(1)[0][0]
    odd = [item.position_mm for item in slices if item.patient != usual]
    places = ("(" + ", ".join(f"{v:.2f}" for v in place or ()) + ")" for place in odd)
    return [
        Fault(
            "mixed-patient",
            "the slices of one series differ in the patient's name, id or birth date",
            value=f"{len(odd)} of {len(slices)} slices, origins at {listed(places)} mm LPS",
            limit="one patient",
            next_step="export the series of one patient alone, from the archive",
            hazard="H38",
        )
    ]


def list_series(folder: str | Path) -> tuple[SeriesSummary, ...]:
    """Every series below a folder, for the choice; series left out come with their reason.

    Parameters
    ----------
    folder : str or Path

    Returns
    -------
    tuple of SeriesSummary
        Usable series first, then by number of slices, descending.

    Raises
    ------
    InputError
        If the folder cannot be read.
    """
    return summarise(scan(require_path(Path(folder))).slices)


def summarise(slices: Iterable[SliceHeader]) -> tuple[SeriesSummary, ...]:
    """Summaries of the series that the slices belong to."""
    groups: dict[tuple[str, str | None], list[SliceHeader]] = {}
    for item in slices:
        groups.setdefault((item.series_uid, exclusion(item)), []).append(item)
    found = [_summary(reason, items) for (_, reason), items in groups.items()]
    found.sort(key=lambda s: (s.excluded is not None, -s.slices, s.series_instance_uid))
    return tuple(replace(summary, number=place) for place, summary in enumerate(found, 1))


def _summary(excluded: str | None, items: list[SliceHeader]) -> SeriesSummary:
    first = items[0]
    stack, faults = arrange(items)
    faults = faults_of_patients(items) + faults
    if excluded is None:
        faults += _faults_of_pixels(items)
    spacing, orientation, tilt = None, "unknown", None
    if stack is not None:
        i, j, k = np.diag(stack.axes @ stack.ijk_to_lps[:3, :3])
        spacing = (float(i), float(j), float(k))
        normal = np.abs(stack.axes[2])
        names = ("sagittal", "coronal", "axial")
        orientation = names[int(normal.argmax())] if normal.max() > 0.999 else "oblique"
        tilt = stack.tilt_deg if len(stack.slices) > 1 else None
    return SeriesSummary(
        number=0,
        series_instance_uid=first.series_uid,
        modality=shown_modality(first.modality),
        image_type=shown_image_type(first.image_type),
        slices=len(items),
        size_ij=(first.columns, first.rows),
        spacing_mm=spacing,
        orientation=orientation,
        tilt_deg=tilt,
        excluded=excluded,
        faults=tuple(faults),
    )


def _faults_of_pixels(items: list[SliceHeader]) -> list[Fault]:
    """What forbids to read the pixels, found without decoding any."""
    faults = faults_of_values(items)
    try:
        return faults + faults_of_length(items)
    except MissingLibrary as missing:
        return faults + list(missing.faults)


def choose(folder: DicomFolder, series_instance_uid: str | None) -> list[SliceHeader]:
    """The slices of the one series to read.

    Raises
    ------
    InputError
        If there is no DICOM image, or none of the series asked for.
    ImageRefused
        If several series could be meant and none was asked for, or none can be used.
    """
    if not folder.slices:
        reasons = ", ".join(f"{count} x {why}" for why, count in sorted(folder.skipped.items()))
        raise InputError.of(
            "no-dicom-image",
            "no DICOM image was found",
            value=reasons or "no files",
            next_step="give the folder that holds the CT slices",
        )
    usable = [item for item in folder.slices if exclusion(item) is None]
    if not usable:
        raise ImageRefused(*_nothing_usable(folder))
    uids = sorted({item.series_uid for item in usable})
    if series_instance_uid is None:
        if len(uids) > 1:
            raise ImageRefused(_ambiguous(folder))
        series_instance_uid = uids[0]
    chosen = [item for item in usable if item.series_uid == series_instance_uid]
    if not chosen:
        raise InputError.of(
            "series-not-found",
            "the folder does not hold the series asked for as a usable image",
            value=f"{len(uids)} other series",
            where="image.series_instance_uid",
            next_step="run `hexafix series FOLDER` and choose one of them",
        )
    return chosen


def _nothing_usable(folder: DicomFolder) -> list[Fault]:
    counts = Counter(str(exclusion(item)) for item in folder.slices)
    faults = [
        Fault(
            "no-usable-series",
            "the folder holds only images that are no CT volume",
            value=", ".join(f"{count} x {why}" for why, count in sorted(counts.items())),
            next_step="export the original CT series",
            hazard="H05",
        )
    ]
    for summary in summarise(folder.slices):
        faults += [fault for fault in summary.faults if fault.code == "no-geometry"]
    return faults + [f for f in faults_of_values(folder.slices) if f.code == "modality-lut"]


def _ambiguous(folder: DicomFolder) -> Fault:
    # Without the UIDs: they lead to the patient, and `hexafix series` shows them when asked.
    return Fault(
        "several-series",
        "the folder holds more than one series",
        value="; ".join(f"[{s.number}: {s.description}]" for s in summarise(folder.slices)),
        limit="1",
        where="image.series_instance_uid",
        next_step="run `hexafix series FOLDER` and give the SeriesInstanceUID of the one to read, "
        "in the case or with --series",
        hazard="H05",
    )
