"""The user's own assignment of numbers, checked against the balls and the layouts."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from hexafix.errors import Fault, InputError, Refused
from hexafix.hardware import MarkerLayout
from hexafix.recognition.alternatives import describe
from hexafix.recognition.choices import NOISE_MM, Choices, search, with_choice
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM, refuse_mirrored
from hexafix.recognition.numbering import Numbering, check_numbers, numbering_value
from hexafix.recognition.rigid import Array

PICK_RADIUS_MM = 3.0
"""A ball lies this close to the point that the user assigned."""

BETTER_FACTOR = 3.0
"""Another numbering this many times better, by more than the noise, refuses the user's."""


def check_user_numbering(
    assigned: Mapping[int, ArrayLike],
    centers_mm: ArrayLike,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    noise_mm: float = NOISE_MM,
    pick_radius_mm: float = PICK_RADIUS_MM,
) -> Numbering:
    """Balls of the numbers that the user assigned, if they fit the layouts.

    Parameters
    ----------
    assigned : mapping of int to array_like, shape (3,)
        Marker number to the ball's centre, LPS mm.
    centers_mm : array_like, shape (M, 3)
        All balls found, LPS mm.
    proximal, distal : MarkerLayout
    noise_mm : float
        Noise of a ball against its place along one axis, mm.
    pick_radius_mm : float
        Largest distance from an assigned point to its ball.

    Returns
    -------
    Numbering
        Settled by ``user``; other numberings that fit stand among its alternatives.

    Raises
    ------
    InputError
        Numbers missing or unknown, no ball at a point, a ball taken twice: all at once.
    ImageRefused
        Only the mirrored layout fits (H01).
    Refused
        The numbering does not fit the layout (G2), or another one fits clearly better (H19).
    """
    points = np.asarray(centers_mm, float).reshape(-1, 3)
    check_numbers(proximal, distal)
    ball_of = _picked(assigned, points, proximal, distal, pick_radius_mm)
    chosen = (
        tuple(ball_of[number] for number in proximal.numbers),
        tuple(ball_of[number] for number in distal.numbers),
    )
    found = search(points, proximal=proximal, distal=distal, noise_mm=noise_mm)
    if len(found.rms_mm) == 0 or found.rms_mm[0] > RING_RMS_LIMIT_MM:
        # With a fitting numbering among the choices, exchanged numbers only look like a mirror.
        for balls, layout in zip(chosen, (proximal, distal), strict=True):
            refuse_mirrored(points[list(balls)], layout)
    choices, row = with_choice(points, found, chosen, proximal=proximal, distal=distal)
    _refuse_worse(choices, row, noise_mm=noise_mm, proximal=proximal, distal=distal)
    return numbering_value(
        points, choices, row, "user", proximal=proximal, distal=distal, noise_mm=noise_mm
    )


def _picked(
    assigned: Mapping[int, ArrayLike],
    points: Array,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    radius_mm: float,
) -> dict[int, int]:
    """Ball index of each number, or every fault of the assignment at once."""
    known = (*proximal.numbers, *distal.numbers)
    faults, ball_of = [], {}
    for number in known:
        if number not in assigned:
            faults.append(_fault("number-missing", number, "no ball is assigned to this number"))
    for number in assigned:
        if number not in known:
            faults.append(_fault("number-unknown", number, "the layout has no such number"))
            continue
        place = np.asarray(assigned[number], float)
        if place.shape != (3,) or not np.all(np.isfinite(place)):
            faults.append(_fault("number-not-a-point", number, "three finite numbers are needed"))
            continue
        distance = np.linalg.norm(points - place, axis=-1)
        if len(points) == 0 or distance.min() > radius_mm:
            value = f"nearest {distance.min():.1f} mm" if len(points) else "no ball in the image"
            what = "no ball was found at this point"
            faults.append(_fault("number-no-ball", number, what, value, f"{radius_mm:g} mm"))
            continue
        ball = int(np.argmin(distance))
        taken = [other for other, index in ball_of.items() if index == ball]
        if taken:
            faults.append(_fault("ball-twice", number, f"its ball already has number {taken[0]}"))
        ball_of[number] = ball
    if faults:
        raise InputError(*faults)
    return ball_of


def _fault(
    code: str, number: int, what: str, value: str | None = None, limit: str | None = None
) -> Fault:
    step = "assign each number of the layout to one ball that was found"
    return Fault(code, what, value, limit, step, "H19", f"numbering.{number}")


def _refuse_worse(
    choices: Choices, row: int, *, noise_mm: float, proximal: MarkerLayout, distal: MarkerLayout
) -> None:
    """Refuse a numbering that fails G2 or that another one clearly beats."""
    mine = float(choices.rms_mm[row])
    others = [k for k in range(len(choices.rms_mm)) if k != row]
    best = others[0] if others else None
    beaten = (
        best is not None
        and BETTER_FACTOR * choices.rms_mm[best] < mine
        and mine > BETTER_FACTOR * noise_mm
    )
    if mine <= RING_RMS_LIMIT_MM and not beaten:
        return
    step = "check the numbers against the picture, or leave the numbering automatic"
    if best is not None and choices.rms_mm[best] < mine:
        named = describe(choices.balls(row), choices.balls(best), proximal=proximal, distal=distal)
        step = f"look at: {named} (RMS {choices.rms_mm[best]:.2f} mm); {step}"
    raise Refused.of(
        "numbering-does-not-fit",
        "the assigned numbers do not fit the layouts"
        if mine > RING_RMS_LIMIT_MM
        else "another numbering fits the layouts clearly better than the assigned one",
        value=f"RMS {mine:.2f} mm",
        limit=f"{RING_RMS_LIMIT_MM:g} mm",
        hazard="H19",
        where="numbering",
        next_step=step,
    )
