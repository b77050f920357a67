"""From a DICOM folder or file to a `Volume`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from typing import TypeVar

from hexafix.errors import Fault, ImageRefused
from hexafix.imaging.decoding import LOSSY_SYNTAXES
from hexafix.imaging.dicom_header import SliceHeader
from hexafix.imaging.dicom_series import (
    DicomFolder,
    choose,
    exclusion,
    faults_of_patients,
    scan,
)
from hexafix.imaging.fingerprint import combine
from hexafix.imaging.gantry_tilt import TILT_TOLERANCE_DEG
from hexafix.imaging.grey_doubts import no_air, thick_slices
from hexafix.imaging.header_words import shown_modality
from hexafix.imaging.hounsfield import faults_of_values
from hexafix.imaging.pixel_data import (
    Pixels,
    faults_of_doubles,
    faults_of_length,
    read_pixels,
)
from hexafix.imaging.slice_stack import SliceStack, arrange
from hexafix.imaging.volume import Acquisition, ImageSource, Volume
from hexafix.progress import Progress

_Value = TypeVar("_Value", bound=Hashable)


def read_dicom(path: Path, series_instance_uid: str | None, progress: Progress) -> Volume:
    """Read one series; see `hexafix.imaging.read_volume`."""
    folder = scan(path, progress)
    slices = choose(folder, series_instance_uid)
    stack, faults = arrange(slices)
    readable = faults_of_values(slices) + faults_of_length(slices)
    faults += readable + _repeated_instances(slices) + faults_of_patients(slices)
    if stack is not None and not readable:
        # Doubles are a fault only if their pixels differ, which needs pixels that can be read.
        faults += faults_of_doubles(stack)
    if stack is None or faults:
        raise ImageRefused(*faults)
    pixels = read_pixels(stack, progress)
    grid = stack.orthogonal_grid()
    source = ImageSource(
        kind="dicom",
        sha256=combine(
            pixels.slice_hashes,
            size_ijk=stack.size_ijk,
            dtype=pixels.voxels.dtype,
            ijk_to_lps=stack.ijk_to_lps,
        ),
        slice_thickness_mm=_most_common(item.thickness_mm for item in slices),
        laterality=_most_common(item.laterality for item in slices),
        body_part=_most_common(item.body_part for item in slices),
        patient_position=_most_common(item.patient_position for item in slices),
        warnings=tuple(_warnings(folder, slices, stack, pixels)),
        acquisition=grid and Acquisition(stack.ijk_to_lps, stack.size_ijk, stack.tilt_deg),
    )
    return Volume(pixels.voxels, (grid or stack).ijk_to_lps, source)


def _most_common(values: Iterable[_Value | None]) -> _Value | None:
    counts = Counter(value for value in values if value is not None)
    return counts.most_common(1)[0][0] if counts else None


def _repeated_instances(slices: Sequence[SliceHeader]) -> list[Fault]:
    """One SOPInstanceUID at two positions: a copy whose geometry somebody changed (H04)."""
    places: dict[tuple[str, int], set[tuple[float, ...] | None]] = {}
    for item in slices:
        if item.sop_uid:
            places.setdefault((item.sop_uid, item.frame), set()).add(item.position_mm)
    repeated = [found for found in places.values() if len(found) > 1]
    if not repeated:
        return []
    return [
        Fault(
            "duplicate-instance",
            "slices at different positions carry the same SOPInstanceUID",
            value=f"{len(repeated)} SOPInstanceUIDs",
            limit="0",
            next_step="export the original CT series",
            hazard="H04",
        )
    ]


def _warnings(
    folder: DicomFolder, slices: Sequence[SliceHeader], stack: SliceStack, pixels: Pixels
) -> Iterable[str]:
    """What the user should know about the series that was read."""
    if abs(stack.tilt_deg) > TILT_TOLERANCE_DEG:
        yield (
            f"gantry tilt (H02): the slices were acquired with a tilt of {stack.tilt.words}; they "
            "were resampled from per-slice geometry, each moved within its own plane"
        )
    spacing = float(stack.gaps_mm.mean())
    yield from thick_slices(spacing, thickest_mm=max(item.thickness_mm or 0.0 for item in slices))
    if any(item.lossy or item.pixels.transfer_syntax in LOSSY_SYNTAXES for item in slices):
        yield "lossy (H10): the pixels were compressed with loss"
    modality = stack.slices[0].modality
    if modality != "CT":
        shown = shown_modality(modality) or "unknown"
        yield f"modality {shown} (H10): the grey values are no Hounsfield units"
    elif any(item.rescale_type not in (None, "HU", "US") for item in slices):
        yield "rescale type (H10): the header does not call the grey values Hounsfield units"
    yield from no_air(pixels.lowest_hu)
    if stack.slices[0].image_type[:2] and "PRIMARY" not in stack.slices[0].image_type[:2]:
        yield "secondary images (H05): the slices were computed from other slices"
    if stack.doubled:
        yield f"duplicate slices (H04): {len(stack.doubled)} identical copies were left out"
    taken = {id(item) for item in slices}
    left_out = Counter(
        exclusion(item) or "other series" for item in folder.slices if id(item) not in taken
    )
    for reason, count in sorted(left_out.items()):
        yield f"left out (H05): {count} x {reason}"
    others = sum(item.patient != slices[0].patient for item in folder.slices)
    if others:
        yield f"other patient (H38): {others} images in the folder name another patient"
    for reason, count in sorted(folder.skipped.items()):
        yield f"skipped: {count} x {reason}"
