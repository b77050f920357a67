"""The English words of the prescription: times of day, directions, instructions, conventions."""

from __future__ import annotations

from dataclasses import dataclass

LONGER, SHORTER, SAME = "longer", "shorter", "no change"

ARROWS = {LONGER: "▲", SHORTER: "▼", SAME: "="}
"""The sign behind each value: turn the strut longer, shorter, or not at all."""

TIMES_OF_DAY = {
    1: ("morning",),
    2: ("morning", "evening"),
    3: ("morning", "noon", "evening"),
    4: ("morning", "noon", "evening", "night"),
}

LOWER_LIMB = {"tibia", "fibula", "femur", "foot", "ankle", "talus", "calcaneus"}
UPPER_LIMB = {"humerus", "radius", "ulna", "forearm", "hand"}


@dataclass(frozen=True, slots=True)
class StrutColour:
    """How a strut is coloured in tables and pictures.

    Attributes
    ----------
    name : str
    fill, ink : str
        Hex colour of the area and of the text on it.
    """

    name: str
    fill: str
    ink: str


STRUT_COLOURS = (
    StrutColour("red", "#c62828", "#ffffff"),
    StrutColour("orange", "#ef7d00", "#000000"),
    StrutColour("yellow", "#f7d002", "#000000"),
    StrutColour("green", "#2e7d32", "#ffffff"),
    StrutColour("blue", "#1559b7", "#ffffff"),
    StrutColour("violet", "#7b2fa0", "#ffffff"),
)
"""Struts 1 to 6; the number always stands beside the colour."""

RING_COLOURS = {"proximal": "#00838f", "distal": "#8d5a2b"}
"""Rings {A} and {B} in the pictures."""


def time_of_day(adjustment: int, per_day: int) -> str:
    """The word for the time of an adjustment, or ``turn`` where a day has more than four."""
    words = TIMES_OF_DAY.get(per_day)
    return words[adjustment - 1] if words else "turn"


def digits_word(bone: str) -> str:
    """Toes, fingers or both, for the warning signs."""
    name = bone.lower()
    if name in LOWER_LIMB:
        return "toes"
    return "fingers" if name in UPPER_LIMB else "fingers or toes"


def adjustment_steps(per_day: int) -> list[str]:
    """What the patient does at each adjustment, in order."""
    times = TIMES_OF_DAY.get(per_day)
    when = f" ({', '.join(times)})" if times else ""
    often = "once a day" if per_day == 1 else f"{per_day} times a day"
    return [
        f"Do one row {often}{when}. Take the first row without a tick.",
        "Read all six scales. They must show the row before. If one does not, stop and call.",
        "Set strut 1 to 6, one after the other: unlock, turn until the scale shows the value of "
        "the row, lock. ▲ means the strut gets longer, ▼ shorter, = leave it.",
        "Check with your hand that all six struts are locked.",
        "Only then tick the row. Bold values close a day: compare all six once more.",
    ]


MISSED = [
    "Never do two rows at one time, and never make up for a missed row with a bigger turn.",
    "Leave the struts at the values of the last row you ticked.",
    "Call your clinic, read out the six scale values and the last ticked row. They tell you "
    "which row comes next and on which date.",
]

DONE_TWICE = (
    "Turned too far, the wrong way, or a row twice? Do not turn back by yourself. Write down the "
    "six values and call."
)


def warning_signs(bone: str) -> list[str]:
    """When the patient stops and calls at once."""
    digits = digits_word(bone)
    return [
        f"numb, tingling, cold, pale or blue {digits}, or {digits} you can no longer move",
        "strong pain that stays after an adjustment or does not get better with your medicine",
        "a pin or wire that is loose, broken, very red, hot or with pus; fever above 38 °C",
        "a strut that turns by itself, will not lock, is very hard to turn, or has come off",
        "a scale that does not show the value of the last row you ticked",
    ]


PSEUDONYMOUS = "Pseudonymous: this file does not name the patient"
"""At the foot of each page of a prescription without identity."""

IDENTIFIED = "IDENTIFIED: names the patient, handle as patient data"
"""At the foot of each page of a prescription with the patient's identity."""

FRAME_CONVENTIONS = [
    "Image frame {W}: the patient frame of the CT (DICOM LPS), millimetres. +x points to the "
    "patient's left, +y to the patient's back (posterior), +z to the patient's head (superior).",
    "Ring frames: {A} proximal ring, {B} distal ring. Origin at the ring's centre in the upper "
    "plane of the plate; +z points from the distal towards the proximal ring, +x to the ring's "
    "front mark, +y completes a right-handed frame.",
    "Mechanism pose: {A} seen in {B}. +z is distraction, -z compression of the rings.",
    "Angles are X-Y-Z fixed angles in degrees: first α about x, then β about the fixed y, then γ "
    "about the fixed z, each positive by the right-hand rule.",
    "Strut length is joint centre to joint centre; scale reading = length - scale offset.",
    "Direction words mean the strut itself: longer, its scale value grows; shorter, it falls.",
]
