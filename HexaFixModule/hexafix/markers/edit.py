"""The user's corrections of what the search found: balls removed, balls added."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.errors import InputError, MarkersNotFound
from hexafix.imaging.volume import Volume
from hexafix.markers import predicates
from hexafix.markers.ball import Ball, BallSet, Rejected
from hexafix.markers.crop import Crop
from hexafix.markers.find import (
    OVERLAP_MM,
    SURROUND_MM,
    FittedBall,
    check_diameter,
    distinct,
    finished_fit,
    shape_reasons,
)
from hexafix.markers.rays import RayFit, fine_fit, rough_fit

REMOVED = "removed by the user"
"""Reason of a ball that the user took out."""

REMOVE_REACH_MM = 3.0
"""A ball that the user removes lies this close to the point."""

CAPTURE_SHARE = 1.0
"""A ball that the user adds has its centre within this share of its radius from the point."""

FITS = 4
"""So often a fit is begun again from its own centre: a click is off by millimetres."""

ADDED_SLACK = 3.0
"""Factor on the limits of size and shape beyond which there is nothing like a ball to add."""


@dataclass(frozen=True, eq=False)
class MarkerEdits:
    """What the user changed about the balls found.

    Attributes
    ----------
    added_lps_mm, removed_lps_mm : ndarray, shape (N, 3)
        Points in LPS, mm, read-only. A ball that was dragged stands in both.
    """

    added_lps_mm: NDArray[np.float64] = field(default_factory=lambda: _points(()))
    removed_lps_mm: NDArray[np.float64] = field(default_factory=lambda: _points(()))

    def __post_init__(self) -> None:
        object.__setattr__(self, "added_lps_mm", _points(self.added_lps_mm))
        object.__setattr__(self, "removed_lps_mm", _points(self.removed_lps_mm))

    def __bool__(self) -> bool:
        return bool(len(self.added_lps_mm) or len(self.removed_lps_mm))


def edited_balls(
    volume: Volume, found: BallSet, edits: MarkerEdits, *, ball_diameter_mm: float
) -> BallSet:
    """The balls found, without those the user removed and with those the user added.

    Parameters
    ----------
    volume : Volume
    found : BallSet
        What `find_balls` found in it.
    edits : MarkerEdits
        First all are removed, then all are added.
    ball_diameter_mm : float
        Nominal diameter.

    Raises
    ------
    InputError
        No ball where one is to be removed; a ball already where one is to be added; a point
        outside the image.
    MarkersNotFound
        Nothing like a ball where one is to be added.
    """
    if not edits:
        return found
    check_diameter(volume, ball_diameter_mm)
    radius = ball_diameter_mm / 2.0
    kept, removed = _without(found.balls, edits.removed_lps_mm)
    for place, point in enumerate(edits.added_lps_mm):
        ball = _restored(removed, point, radius)
        if ball is None:
            ball = _added(volume, point, radius, kept, place)
        _refuse_double(ball, kept, radius, place)
        kept.append(ball)
    balls = tuple(sorted(kept, key=lambda b: tuple(b.center_mm[::-1])))
    taken_out = [Rejected(ball.center_mm, REMOVED) for ball in removed]
    rejected = distinct([*taken_out, *found.rejected], balls, radius)
    return replace(found, balls=balls, rejected=rejected)


def _without(balls: tuple[Ball, ...], points: NDArray[np.float64]) -> tuple[list[Ball], list[Ball]]:
    """The balls kept and those removed."""
    kept, removed = list(balls), []
    for place, point in enumerate(points):
        away = [float(np.linalg.norm(ball.center_mm - point)) for ball in kept]
        if not away or min(away) > REMOVE_REACH_MM:
            raise InputError.of(
                "no-ball-to-remove",
                "there is no ball at the point where one is to be removed",
                value=f"nearest {min(away):.1f} mm away" if away else "no ball left",
                limit=f"{REMOVE_REACH_MM:g} mm",
                where=f"marker_edits.removed_lps_mm[{place}]",
                hazard="H15",
                next_step="take this point out of the edits, or choose a ball that was found",
            )
        removed.append(kept.pop(int(np.argmin(away))))
    return kept, removed


def _restored(removed: list[Ball], point: NDArray[np.float64], radius: float) -> Ball | None:
    """The removed ball that lies at the point: it keeps the centre that the search gave it."""
    for ball in removed:
        if np.linalg.norm(ball.center_mm - point) <= CAPTURE_SHARE * radius:
            return replace(ball, added=True)
    return None


def _added(
    volume: Volume, point: NDArray[np.float64], radius: float, others: list[Ball], place: int
) -> Ball:
    """The ball at a point of the user, with the tests it failed among its warnings."""
    if predicates.border_distance_mm(volume, point) < radius:
        raise InputError.of(
            "added-ball-outside",
            "a ball is to be added where the image does not show it whole",
            value=f"{predicates.border_distance_mm(volume, point):.1f} mm from the image's edge",
            limit=f"at least the ball's radius, {radius:g} mm",
            where=f"marker_edits.added_lps_mm[{place}]",
            hazard="H14",
            next_step="choose a point inside the image",
        )
    crop = Crop.around(volume, point, radius + SURROUND_MM + CAPTURE_SHARE * radius)
    rays = _settled(crop, point, radius)
    if rays is None:
        raise _nothing_there("no round edge is to be seen about this point", place)
    away = float(np.linalg.norm(rays.center_mm - point))
    if away > CAPTURE_SHARE * radius:
        raise _nothing_there(f"the nearest round thing lies {away:.1f} mm from this point", place)
    hard = shape_reasons(volume, rays, rays.radius_mm, radius, slack=ADDED_SLACK)
    if hard:
        raise _nothing_there("; ".join(hard), place)
    reason = predicates.border_failure(volume, rays.center_mm, radius)
    # the voxels about the fitted centre, as the search takes them
    crop = Crop.around(volume, rays.center_mm, radius + SURROUND_MM)
    fitted = finished_fit(volume, crop, rays, radius, despite=[reason] if reason else [])
    assert isinstance(fitted, FittedBall)
    return _with_material(fitted, others)


def _settled(crop: Crop, point: NDArray[np.float64], radius: float) -> RayFit | None:
    """The roundest fit about a point that need not be near the ball's centre."""
    fits = []
    for start in (point, _brightest_about(crop, point, radius)):
        rough = None
        for _ in range(FITS):
            rough = rough_fit(crop, start, radius)
            if rough is None or np.linalg.norm(rough.center_mm - point) > 2.0 * radius:
                break
            start = rough.center_mm
        else:
            fits.append(None if rough is None else fine_fit(crop, rough, radius))
    return min((fit for fit in fits if fit is not None), key=lambda fit: fit.rms_mm, default=None)


def _brightest_about(crop: Crop, point: NDArray[np.float64], radius: float) -> NDArray[np.float64]:
    """The middle of what is bright within a radius, followed from a point: rays need an inside."""
    bright = crop.voxels > 0.5 * (float(np.median(crop.voxels)) + crop.brightest)
    places = crop.points_mm[bright]
    middle = point
    for _ in range(FITS):
        near = places[np.linalg.norm(places - middle, axis=-1) <= radius]
        if not len(near):
            break
        middle = near.mean(axis=0)
    return middle


def _with_material(fitted: FittedBall, others: list[Ball]) -> Ball:
    """A warning where the ball is not of the other balls' material."""
    ball = fitted.ball
    if not others:
        return ball
    middle = float(np.median([other.core_hu for other in others]))
    reach = predicates.CORE_SHARE * fitted.contrast_hu
    if abs(ball.core_hu - middle) <= reach:
        return ball
    why = f"core HU: {ball.core_hu:.0f}, limit {middle:.0f} ± {reach:.0f} as the others"
    return replace(ball, warnings=(*ball.warnings, f"added by the user although: {why}"))


def _refuse_double(ball: Ball, others: list[Ball], radius: float, place: int) -> None:
    """A ball that overlaps another one is not a second ball."""
    away = [float(np.linalg.norm(ball.center_mm - other.center_mm)) for other in others]
    if away and min(away) < 2.0 * radius - OVERLAP_MM:
        raise InputError.of(
            "added-ball-twice",
            "a ball is to be added where there is one already",
            value=f"{min(away):.1f} mm from another ball",
            limit=f"{2.0 * radius - OVERLAP_MM:.1f} mm",
            where=f"marker_edits.added_lps_mm[{place}]",
            hazard="H15",
            next_step="take this point out of the edits, or remove the other ball first",
        )


def _nothing_there(why: str, place: int) -> MarkersNotFound:
    return MarkersNotFound.of(
        "no-ball-to-add",
        f"nothing like a marker ball is at the point where one is to be added: {why}",
        where=f"marker_edits.added_lps_mm[{place}]",
        hazard="H15",
        next_step="choose the middle of a ball in the image, or check the ball's diameter",
    )


def _points(points_mm: ArrayLike) -> NDArray[np.float64]:
    array = np.array(points_mm, float).reshape(-1, 3)
    if not np.all(np.isfinite(array)):
        raise InputError.of(
            "marker-edit-not-a-point", "three finite numbers are needed", where="marker_edits"
        )
    array.setflags(write=False)
    return array
