"""The numbering while it is being made: complete or not, how well it fits, how unique it is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix import gates
from hexafix.case import Case, CaseParts
from hexafix.errors import Fault, HexaFixError
from hexafix.hardware import MarkerLayout
from hexafix.markers import BallSet
from hexafix.pipeline.numbers import rounded
from hexafix.pipeline.recognise import StrutJudge, judge_by_struts
from hexafix.recognition import Numbering, check_user_numbering, number_balls
from hexafix.recognition.fits import RingFit, ring_fit
from hexafix.recognition.least_squares import RING_RMS_LIMIT_MM
from hexafix.recognition.user_numbering import PICK_RADIUS_MM


@dataclass(frozen=True, eq=False)
class _Assigned:
    """Numbers with balls, and what is wrong with the others."""

    ball_of: dict[int, int]
    faults: tuple[Fault, ...]


def judge_numbering(
    balls: BallSet,
    *,
    proximal: MarkerLayout,
    distal: MarkerLayout,
    assigned: Mapping[Any, Any] | None = None,
    strut_judge: StrutJudge | None = None,
) -> dict[str, Any]:
    """How a numbering stands; a misfit is told and never raised.

    Parameters
    ----------
    balls : BallSet
    proximal, distal : MarkerLayout
    assigned : mapping of int or str to int or array_like, shape (3,), optional
        Of marker numbers the ball's index or its centre, LPS mm: what the user assigned so far,
        perhaps not all. Without, the automatic numbering is judged.
    strut_judge : callable, optional
        From `judge_by_struts`; asked where the layouts leave the automatic numbering a choice.

    Returns
    -------
    dict
        ``complete``: every marker has a ball and nothing speaks against it; ``settled_by``:
        ``layout``, ``strut-readings``, ``user``, or None where it is not settled; ``assigned``:
        ball index of each number; ``unused`` balls; ``margin_mm``; ``rings``: of each ring how
        many ``markers``, how many ``assigned``, ``rms_mm`` and ``residuals_mm`` of the best rigid
        fit of those assigned (None below three), ``next_best_mm``, the RMS of the best other
        choice of balls for this ring, and whether that is only a lower bound
        (``next_best_is_bound``); ``alternatives``; ``faults``.
    """
    layouts = {"proximal": proximal, "distal": distal}
    numbering: Numbering | None = None
    if assigned is None:
        ball_of, faults = {}, ()
        try:
            numbering = number_balls(
                balls.centers_mm, proximal=proximal, distal=distal, judge=strut_judge
            )
            ball_of = numbering.ball_of_number
        except HexaFixError as error:
            faults = error.faults
    else:
        given = _read(assigned, balls.centers_mm, layouts)
        ball_of, faults = given.ball_of, given.faults
        if not faults:
            numbering, faults = _checked(given, balls, proximal, distal)
    if numbering is not None:
        unique = gates.numbering_unique(numbering.margin_mm, numbering.settled_by)
        faults = tuple(gate.as_fault() for gate in gates.red([unique]))
    fits = {
        ring: ring_fit(balls.centers_mm, layout, ball_of, others=_others(layouts, ring, ball_of))
        for ring, layout in layouts.items()
    }
    if numbering is None:
        faults = (*faults, *_misfits(fits, faults))
    return _document(balls, layouts, ball_of, numbering, fits, faults)


def judge_case_numbering(case: Case | CaseParts, balls: BallSet) -> dict[str, Any]:
    """`judge_numbering` with the case's layouts, numbers and readings, as `recognise` uses them.

    Raises
    ------
    InputError
        If a layout is missing or wrong.
    """
    if case.proximal is None or case.distal is None:
        raise HexaFixError.of("no-layout", "the numbering needs both layouts", where="markers")
    return judge_numbering(
        balls,
        proximal=case.proximal,
        distal=case.distal,
        assigned=case.numbering,
        strut_judge=judge_by_struts(case.fixator, case.strut_readings_mm),
    )


def _others(layouts: Mapping[str, MarkerLayout], ring: str, ball_of: Mapping[int, int]) -> set[int]:
    """Balls that the other ring holds."""
    other = layouts["distal" if ring == "proximal" else "proximal"]
    return {ball_of[number] for number in other.numbers if number in ball_of}


def _read(
    assigned: Mapping[Any, Any], points: NDArray[np.float64], layouts: Mapping[str, MarkerLayout]
) -> _Assigned:
    """Balls of the numbers assigned so far, and every fault of single numbers."""
    known = [number for layout in layouts.values() for number in layout.numbers]
    ball_of: dict[int, int] = {}
    faults = []
    for key, value in assigned.items():
        number = int(key)
        ball = _ball_at(value, points)
        if number not in known:
            faults.append(_fault("number-unknown", number, "the layout has no such number"))
        elif ball is None:
            faults.append(_fault("number-no-ball", number, "no ball was found at this point"))
        elif ball in ball_of.values():
            taken = next(other for other, index in ball_of.items() if index == ball)
            faults.append(_fault("ball-twice", number, f"its ball already has number {taken}"))
        else:
            ball_of[number] = ball
    missing = [number for number in known if number not in ball_of]
    if missing and not faults:
        faults.append(
            Fault(
                "number-missing",
                "these markers have no ball yet",
                value=", ".join(map(str, missing)),
                limit="every marker of both layouts",
                next_step="assign each of them to a ball, or number automatically",
                hazard="H19",
                where="numbering",
            )
        )
    return _Assigned(dict(sorted(ball_of.items())), tuple(faults))


def _ball_at(value: Any, points: NDArray[np.float64]) -> int | None:
    """The ball of an index or of a point, None where there is none."""
    if isinstance(value, int | np.integer) and not isinstance(value, bool):
        return int(value) if 0 <= value < len(points) else None
    place = np.asarray(value, float)
    if place.shape != (3,) or not np.all(np.isfinite(place)) or not len(points):
        return None
    distance = np.linalg.norm(points - place, axis=-1)
    nearest = int(np.argmin(distance))
    return nearest if distance[nearest] <= PICK_RADIUS_MM else None


def _fault(code: str, number: int, what: str) -> Fault:
    return Fault(
        code,
        what,
        next_step="assign each number of the layout to one ball that was found",
        hazard="H19",
        where=f"numbering.{number}",
    )


def _checked(
    given: _Assigned, balls: BallSet, proximal: MarkerLayout, distal: MarkerLayout
) -> tuple[Numbering | None, tuple[Fault, ...]]:
    """The user's whole numbering as the chain judges it."""
    centers = balls.centers_mm
    points: dict[int, ArrayLike] = {n: centers[k] for n, k in given.ball_of.items()}
    try:
        return check_user_numbering(points, centers, proximal=proximal, distal=distal), ()
    except HexaFixError as error:
        return None, error.faults


def _misfits(fits: Mapping[str, RingFit], known: Sequence[Fault]) -> list[Fault]:
    """Rings whose balls so far do not fit, where nothing else told it."""
    if any(fault.code in ("numbering-does-not-fit", "mirrored-balls") for fault in known):
        return []
    return [
        Fault(
            "numbering-does-not-fit",
            f"the balls assigned so far do not fit the layout of the {ring} ring",
            value=f"RMS {fit.rms_mm:.2f} mm",
            limit=f"{RING_RMS_LIMIT_MM:g} mm",
            next_step="check the numbers against the picture, or number automatically",
            hazard="H19",
            where="numbering",
        )
        for ring, fit in fits.items()
        if fit.rms_mm is not None and fit.rms_mm > RING_RMS_LIMIT_MM
    ]


def _document(
    balls: BallSet,
    layouts: Mapping[str, MarkerLayout],
    ball_of: Mapping[int, int],
    numbering: Numbering | None,
    fits: Mapping[str, RingFit],
    faults: Sequence[Fault],
) -> dict[str, Any]:
    used = set(ball_of.values())
    return {
        "schema_version": 1,
        "complete": numbering is not None and not faults,
        "settled_by": None if numbering is None else numbering.settled_by,
        "assigned": {str(number): ball for number, ball in ball_of.items()},
        "unused": [k for k in range(len(balls.balls)) if k not in used],
        "margin_mm": None if numbering is None else rounded(numbering.margin_mm),
        "rings": {
            ring: {
                "markers": len(layouts[ring]),
                "assigned": len(fit.residuals_mm),
                "rms_mm": None if fit.rms_mm is None else rounded(fit.rms_mm),
                "residuals_mm": {
                    str(number): None if value is None else rounded(value)
                    for number, value in fit.residuals_mm.items()
                },
                "next_best_mm": None if fit.next_best_mm is None else rounded(fit.next_best_mm),
                "next_best_is_bound": fit.next_best_is_bound,
            }
            for ring, fit in fits.items()
        },
        "alternatives": []
        if numbering is None
        else [
            {"choice": other.words, "rms_mm": rounded(other.rms_mm)}
            for other in numbering.alternatives[:6]
        ],
        "faults": [fault.as_json() for fault in faults],
    }
