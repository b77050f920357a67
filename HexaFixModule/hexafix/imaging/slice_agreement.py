"""What the slices of one series must have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from hexafix.errors import Fault
from hexafix.imaging.dicom_header import SliceHeader

ORIENTATION_TOLERANCE = 1e-4
SPACING_TOLERANCE_MM = 1e-6

_LISTED = 12


def faults_of_missing_geometry(missing: int, total: int) -> list[Fault]:
    """Slices that lack what a grid is made of."""
    if not missing:
        return []
    return [
        Fault(
            "no-geometry",
            "slices without ImagePositionPatient, ImageOrientationPatient or PixelSpacing",
            value=f"{missing} of {total} slices",
            limit="0",
            next_step="export the original CT series with its geometry",
            hazard="H07",
        )
    ]


def faults_of_mixture(slices: Sequence[SliceHeader]) -> list[Fault]:
    """Attributes in which the slices of one series must agree."""
    first = slices[0]
    agreements: list[tuple[str, str, str, str, Callable[[SliceHeader], bool]]] = [
        (
            "mixed-frame-of-reference",
            "slices in different frames of reference",
            "H05",
            "one FrameOfReferenceUID",
            lambda s: s.frame_of_reference == first.frame_of_reference,
        ),
        (
            "mixed-image-type",
            "slices of different ImageType",
            "H05",
            "one ImageType",
            lambda s: s.image_type[:3] == first.image_type[:3],
        ),
        (
            "mixed-size",
            "slices with different numbers of rows or columns",
            "H06",
            f"{first.columns} x {first.rows}",
            lambda s: (s.rows, s.columns) == (first.rows, first.columns),
        ),
        (
            "mixed-orientation",
            "slices with different ImageOrientationPatient",
            "H06",
            f"{ORIENTATION_TOLERANCE:g}",
            lambda s: differs(s.orientation, first.orientation) <= ORIENTATION_TOLERANCE,
        ),
        (
            "mixed-spacing",
            "slices with different PixelSpacing",
            "H06",
            f"{SPACING_TOLERANCE_MM:g} mm",
            lambda s: differs(s.pixel_spacing_mm, first.pixel_spacing_mm) <= SPACING_TOLERANCE_MM,
        ),
    ]
    faults = []
    for code, what, hazard, limit, agrees in agreements:
        odd = [item for item in slices if not agrees(item)]
        if odd:
            minority = min(odd, [item for item in slices if agrees(item)], key=len)
            faults.append(
                Fault(
                    code,
                    what,
                    value=f"{len(minority)} of {len(slices)} slices, origins at "
                    + listed([_point(item.position_mm) for item in minority])
                    + " mm LPS",
                    limit=limit,
                    next_step="export the CT series alone, without other reconstructions",
                    hazard=hazard,
                )
            )
    return faults


def differs(a: tuple[float, ...] | None, b: tuple[float, ...] | None) -> float:
    """Greatest difference of two headers' numbers."""
    return max(abs(x - y) for x, y in zip(a or (), b or (), strict=True))


def _point(position: tuple[float, ...] | None) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in position or ()) + ")"


def listed(items: object) -> str:
    """Up to a dozen entries, and how many more there are."""
    entries = list(items)  # type: ignore[call-overload]
    more = f" and {len(entries) - _LISTED} more" if len(entries) > _LISTED else ""
    return ", ".join(entries[:_LISTED]) + more
