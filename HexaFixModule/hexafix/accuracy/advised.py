"""What the layout advisor is asked and what it answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.jacobian import least_squares_covariance
from hexafix.accuracy.joint_error import ErrorTarget, PlaceError, bone_covariance_mm2, place_error
from hexafix.accuracy.layout_check import UNIQUENESS_TARGET_MM, LayoutVerdict, check_layout
from hexafix.errors import InputError
from hexafix.hardware import MarkerLayout, Places
from hexafix.recognition.choices import UNIQUENESS_LIMIT_MM
from hexafix.recognition.least_squares import IMAGE_SIGMA_MM, INSTALLATION_SIGMA_MM
from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM

SPACING_MM = 20.0
"""Smallest distance of two balls: two diameters of the usual 10 mm, so that no image joins them."""


@dataclass(frozen=True, slots=True)
class AdviceRules:
    """What advised layouts keep, and the errors they are judged by.

    Attributes
    ----------
    relaxed : bool
        Allow the relaxed angle rule (H17).
    margin_mm : float
        Smallest RMS of a wrong numbering (H18) and of rings taken for each other (H20).
    spacing_mm : float
        Smallest distance of two balls, seen along the ring's axis.
    sigma_image_mm, sigma_installation_mm : float
        Error of a ball's centre and of its place, each along every axis.
    """

    relaxed: bool = False
    margin_mm: float = UNIQUENESS_TARGET_MM
    spacing_mm: float = SPACING_MM
    sigma_image_mm: float = IMAGE_SIGMA_MM
    sigma_installation_mm: float = INSTALLATION_SIGMA_MM

    def __post_init__(self) -> None:
        if not self.margin_mm >= UNIQUENESS_LIMIT_MM:
            raise InputError.of(
                "margin-too-small",
                "a layout with this margin would be refused by the gate",
                value=f"{self.margin_mm:g} mm",
                limit=f"at least {UNIQUENESS_LIMIT_MM:g} mm",
                hazard="H18",
            )

    @property
    def sigma_mm(self) -> float:
        """Image and installation error together, along each axis."""
        return float(np.hypot(self.sigma_image_mm, self.sigma_installation_mm))


@dataclass(frozen=True, slots=True)
class RingPlaces:
    """Where a ring can carry markers and where its error counts."""

    places: Places
    target: ErrorTarget


@dataclass(frozen=True, eq=False)
class RingTask:
    """One ring to be advised on.

    Attributes
    ----------
    name : str
        ``proximal``, ``distal`` or ``ring``.
    places : HoleCircle or SiteList
    count : int
        Markers wanted.
    target : ErrorTarget
    present : MarkerLayout, optional
        The layout it has now.
    first_number : int
        Number of its first marker where there is no present layout of as many markers.
    """

    name: str
    places: Places
    count: int
    target: ErrorTarget
    present: MarkerLayout | None = None
    first_number: int = 1


@dataclass(frozen=True, slots=True)
class Move:
    """A marker that changes its place; angles in degrees from 0 to 360."""

    number: int
    from_deg: float
    to_deg: float
    from_height_mm: float
    to_height_mm: float
    from_radius_mm: float
    to_radius_mm: float

    @property
    def words(self) -> str:
        """The move as part of a sentence."""
        steps = []
        if abs(self.from_deg - self.to_deg) > 1e-6:
            steps.append(f"from {self.from_deg:g} to {self.to_deg:g} degrees")
        if abs(self.from_height_mm - self.to_height_mm) > 1e-6:
            steps.append(f"from height {self.from_height_mm:g} to {self.to_height_mm:g} mm")
        if abs(self.from_radius_mm - self.to_radius_mm) > 1e-6:
            steps.append(f"from radius {self.from_radius_mm:g} to {self.to_radius_mm:g} mm")
        return f"marker {self.number} " + " and ".join(steps)


@dataclass(frozen=True, eq=False)
class AssessedRing:
    """A layout of one ring with its figures.

    Attributes
    ----------
    layout : MarkerLayout
    verdict : LayoutVerdict
    place_error : PlaceError or None
        None for markers on one line.
    bone_covariance_mm2 : ndarray, shape (3, 3), or None
        Of the bone's point, ring frame.
    places : tuple of int or None
        Hole or site of each marker, counted from 1, None for one that is on none; None in all for
        a layout as it is.
    moves : tuple of Move
        What changes against the present layout.
    """

    layout: MarkerLayout
    verdict: LayoutVerdict
    place_error: PlaceError | None
    bone_covariance_mm2: NDArray[np.float64] | None
    places: tuple[int | None, ...] | None = None
    moves: tuple[Move, ...] = ()

    @property
    def error_mm(self) -> float:
        """The ranking error, infinite where there is none."""
        return np.inf if self.place_error is None else self.place_error.error_mm

    def as_json(self) -> dict[str, Any]:
        """Figures and markers, angles in degrees."""
        error, verdict = self.place_error, self.verdict.as_json()
        markers = [
            {
                "number": site.number,
                "radius_mm": site.radius_mm,
                "sweep_deg": round(float(np.degrees(site.sweep_rad)), 9),
                "height_mm": site.height_mm,
            }
            for site in self.layout.sites
        ]
        for marker, place in zip(markers, self.places or (), strict=False):
            marker["hole"] = place
        keys = ("included_angles_deg", "rule", "uniqueness_mm", "nearest_wrong_numbering",
                "mirror_mm", "predicted_error_mm", "predicted_error_deg")  # fmt: skip
        return {
            "error_mm": error.error_mm if error else None,
            "joints_mm": error.joints_mm if error else None,
            "bone_mm": error.bone_mm if error else None,
            **{key: verdict[key] for key in keys},
            "markers": markers,
            "moves": [move.words for move in self.moves],
        }


@dataclass(frozen=True, slots=True)
class Weakness:
    """One reason why a present layout is weaker than the advised one.

    Attributes
    ----------
    term : str
        ``line``, ``sweep-gap``, ``relabelling``, ``mirror``, ``exchange`` or ``predicted-error``.
    words : str
    refused : bool
        Whether a gate refuses the layout for it.
    """

    term: str
    words: str
    refused: bool


@dataclass(frozen=True, eq=False)
class RingReport:
    """One ring's part of an advice.

    Attributes
    ----------
    task : RingTask
    present : AssessedRing or None
    weaknesses : tuple of Weakness
        Of the present layout against the first proposal.
    mirror_shown : bool
        Whether the proposals can show a mirrored image; three markers never can.
    compared : int
        Layouts compared, turned and reflected copies counted once.
    fewest : AssessedRing or None
        Where the present layout breaks a rule: the best that mends it by one move, or by two.
    """

    task: RingTask
    present: AssessedRing | None
    weaknesses: tuple[Weakness, ...]
    mirror_shown: bool
    compared: int
    fewest: AssessedRing | None = None

    def as_json(self) -> dict[str, Any]:
        """The ring's present layout and what it lacks."""
        return {
            "present": self.present.as_json() if self.present else None,
            "weaker_because": [
                {"term": w.term, "words": w.words, "refused": w.refused} for w in self.weaknesses
            ],
            "fewest_moves": self.fewest.as_json() if self.fewest else None,
            "mirror_shown": self.mirror_shown,
            "layouts_compared": self.compared,
        }


@dataclass(frozen=True, eq=False)
class Proposal:
    """An advised layout, of one ring or of both together.

    Attributes
    ----------
    rings : tuple of AssessedRing
        In the order of the tasks.
    error_mm : float
        Root of the sum of the rings' squared ranking errors: the error of one ring seen from
        the other.
    exchange_mm : float or None
        RMS of the rings taken for each other; None if there is one, or their counts differ.
    """

    rings: tuple[AssessedRing, ...]
    error_mm: float
    exchange_mm: float | None


@dataclass(frozen=True, eq=False)
class Advice:
    """The layouts advised for one ring or for both.

    Attributes
    ----------
    rules : AdviceRules
    rings : tuple of RingReport
    proposals : tuple of Proposal
        Lowest error first.
    present_error_mm : float or None
        As `Proposal.error_mm`; None unless every ring has a present layout that holds a pose.
    present_exchange_mm : float or None
    keep_present : bool
        The present layouts keep every rule and no proposal has a smaller error.
    """

    rules: AdviceRules
    rings: tuple[RingReport, ...]
    proposals: tuple[Proposal, ...]
    present_error_mm: float | None
    present_exchange_mm: float | None
    keep_present: bool

    def as_json(self) -> dict[str, Any]:
        """The document of ``advise``."""
        names = [ring.task.name for ring in self.rings]
        return {
            "rules": {
                "angle_rule": "relaxed" if self.rules.relaxed else "preferred",
                "margin_mm": self.rules.margin_mm,
                "spacing_mm": self.rules.spacing_mm,
                "sigma_mm": self.rules.sigma_mm,
            },
            "present": {"error_mm": self.present_error_mm, "exchange_mm": self.present_exchange_mm},
            "keep_present": self.keep_present,
            "rings": {ring.task.name: ring.as_json() for ring in self.rings},
            "advised": [
                {
                    "rank": rank,
                    "error_mm": proposal.error_mm,
                    "exchange_mm": proposal.exchange_mm,
                    "rings": {
                        name: ring.as_json()
                        for name, ring in zip(names, proposal.rings, strict=True)
                    },
                }
                for rank, proposal in enumerate(self.proposals, start=1)
            ],
        }


def assess(
    layout: MarkerLayout,
    target: ErrorTarget,
    rules: AdviceRules,
    *,
    places: tuple[int | None, ...] | None = None,
    moves: tuple[Move, ...] = (),
) -> AssessedRing:
    """A layout with every figure, by the full check."""
    errors = {
        "sigma_image_mm": rules.sigma_image_mm,
        "sigma_installation_mm": rules.sigma_installation_mm,
    }
    verdict = check_layout(layout, **errors)
    error = bone = None
    if verdict.triangle_height_mm >= MIN_TRIANGLE_HEIGHT_MM:
        covariance = least_squares_covariance(layout, **errors)
        error = place_error(covariance, target)
        bone = bone_covariance_mm2(covariance, target)
        bone.setflags(write=False)
    return AssessedRing(layout, verdict, error, bone, places, moves)
