"""The refusals of the automatic numbering, naming what was met."""

from __future__ import annotations

from hexafix.errors import ImageRefused, MarkersNotFound, NumberingAmbiguous
from hexafix.hardware import MarkerLayout
from hexafix.recognition.alternatives import describe
from hexafix.recognition.choices import (
    MAX_CHOICES,
    OTHER_BALLS_LIMIT_MM,
    UNIQUENESS_LIMIT_MM,
    UNIQUENESS_NOISE_FACTOR,
    Choices,
)
from hexafix.recognition.congruence import embeddings
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM
from hexafix.recognition.partial_match import matched_count
from hexafix.recognition.rigid import Array


def ambiguous(
    choices: Choices, rivals: list[int], *, proximal: MarkerLayout, distal: MarkerLayout
) -> NumberingAmbiguous:
    """The refusal that names the alternatives."""
    if not rivals:
        return NumberingAmbiguous.of(
            "numbering-too-symmetric",
            "the layouts fit the balls in too many ways to compare them all",
            value=f"more than {len(choices.rms_mm)}",
            limit=str(MAX_CHOICES),
            hazard="H18",
            next_step="assign the numbers by hand, or move markers",
        )
    best = choices.balls(0)
    named = [
        f"{describe(best, choices.balls(row), proximal=proximal, distal=distal)}"
        f" (RMS {choices.rms_mm[row]:.2f} mm)"
        for row in rivals[:6]
    ]
    more = f" and {len(rivals) - 6} more" if len(rivals) > 6 else ""
    exchanged = any(set(choices.balls(row)[0]) == set(best[1]) for row in rivals)
    return NumberingAmbiguous.of(
        "numbering-ambiguous",
        "more than one numbering fits the balls: " + "; ".join(named) + more,
        value=f"other choice {choices.rms_mm[rivals[0]]:.2f} mm RMS,"
        f" best {choices.rms_mm[0]:.2f} mm",
        limit=f"same balls above {UNIQUENESS_LIMIT_MM:g} mm, other balls above"
        f" {OTHER_BALLS_LIMIT_MM:g} mm, {UNIQUENESS_NOISE_FACTOR:g} × noise",
        hazard="H20" if exchanged else "H18",
        next_step="give strut readings, assign the numbers by hand, or move a marker"
        " (check-layout proposes where)",
    )


def not_found(
    points: Array, choices: Choices, *, proximal: MarkerLayout, distal: MarkerLayout
) -> MarkersNotFound | ImageRefused:
    """Why no choice passes G2: mirrored, balls missing, or a wrong layout."""
    rings = (("proximal", proximal, choices.proximal), ("distal", distal, choices.distal))
    words = []
    for side, layout, found in rings:
        if len(found) and found.rms_mm[0] <= RING_RMS_LIMIT_MM:
            words.append(f"{side} {len(layout)} of {len(layout)}")
            continue
        mirrored = embeddings(
            points_mm=points,
            layout_mm=layout.points_mm,
            max_rms_mm=RING_RMS_LIMIT_MM,
            mirrored=True,
        )
        if len(points) >= len(layout) and len(mirrored):
            near = f"{found.rms_mm[0]:.2f} mm" if len(found) else "no fit"
            return ImageRefused.of(
                "mirrored-balls",
                f"the {side} ring's balls are the mirror image of its layout",
                value=f"RMS {near} as built, {mirrored.rms_mm[0]:.2f} mm mirrored",
                limit=f"{RING_RMS_LIMIT_MM:g} mm as built",
                hazard="H01",
                next_step="check the image's orientation and the signs of the heights",
            )
        count = matched_count(points, layout.points_mm, limit_mm=RING_RMS_LIMIT_MM)
        nearest = f", all {len(layout)} only to {found.rms_mm[0]:.2f} mm" if len(found) else ""
        words.append(f"{side} {count} of {len(layout)}{nearest}")
    needed = len(proximal) + len(distal)
    return MarkersNotFound.of(
        "ring-not-found",
        f"the balls do not hold both rings' layouts (balls that fit: {'; '.join(words)})",
        value=f"{len(points)} balls",
        limit=f"{needed} markers within {RING_RMS_LIMIT_MM:g} mm RMS, each ball once",
        hazard="H12" if len(points) == 0 else "H13" if len(points) < needed else "H15",
        next_step="look at the found and the rejected balls, and check the layout's"
        " radii, angles and heights",
    )
