"""From ball centres to the bones' final pose: the paper's chain and ours, errors switched on."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from hexafix.correction import (
    Compensation,
    FragmentMotion,
    RecognisedRings,
    compensate,
    reading_covariance,
    target_of,
)
from hexafix.correction.compensation import CompensationMode
from hexafix.correction.rounding import pose_of_row, round_rows
from hexafix.geometry import Pose
from hexafix.hardware import Fixator, MarkerLayout
from hexafix.kinematics import forward_kinematics, strut_lengths
from hexafix.recognition import RingPose, ring_pose, ring_pose_by_groups
from hexafix.study.experiment_scan import FITS, Seen
from hexafix.study.experiment_trial import MECHANISM_MM, MECHANISM_RAD, Trial

Array = NDArray[np.float64]

Mode = Literal["none", "additive", "fused", "calibrated"]
"""`calibrated` is `fused` told of the mechanism's residual error; the others as in `compensate`."""

METHODS = {"groups": ring_pose_by_groups, "least-squares": ring_pose}

MOTOR_MM, HAND_MM = 0.01, 0.5
"""Steps of the struts: a motor's encoder (the paper prints none) and a scale turned by hand."""
SCALES_MM = (MOTOR_MM, HAND_MM)

CALIBRATION = np.diag([MECHANISM_MM**2] * 3 + [MECHANISM_RAD**2] * 3)
"""Covariance of the mechanism's residual error, mm² and rad²."""


@dataclass(frozen=True)
class Sources:
    """Which errors act."""

    image: bool = True
    installation: bool = True
    rounding: bool = True
    mechanism: bool = True


ALL = Sources()
ALONE = {
    "image": Sources(installation=False, rounding=False, mechanism=False),
    "installation": Sources(image=False, rounding=False, mechanism=False),
    "rounding": Sources(image=False, installation=False, mechanism=False),
    "mechanism": Sources(image=False, installation=False, rounding=False),
}
"""One source at a time: the error budget."""


@dataclass(frozen=True)
class Road:
    """How balls become ring poses.

    Attributes
    ----------
    fit : {'isosurface', 'rays'}
    method : {'groups', 'least-squares'}
    markers : int
        3 or 4 on each ring.
    """

    fit: str
    method: str
    markers: int


@dataclass(frozen=True)
class Way:
    """A road and what is done about its error.

    Attributes
    ----------
    road : Road
    mode : {'none', 'additive', 'fused', 'calibrated'}
    scale_mm : float
        Step of the struts, read and set.
    """

    road: Road
    mode: Mode
    scale_mm: float

    @property
    def best_rounding(self) -> bool:
        """Whether the last row is the best of the 64 roundings, as HexaFix does it by hand."""
        return self.mode in ("fused", "calibrated") and self.scale_mm == HAND_MM


PAPER, OURS = Road("isosurface", "groups", 3), Road("rays", "least-squares", 3)
FOUR = Road("rays", "least-squares", 4)
ROADS = (*(Road(fit, method, 3) for fit in FITS for method in METHODS), FOUR)


def ways_of(road: Road, *modes: Mode) -> tuple[Way, ...]:
    """The given modes on both scales."""
    return tuple(Way(road, mode, scale) for scale in SCALES_MM for mode in modes)


WAYS = (
    *ways_of(PAPER, "none", "additive"),
    *ways_of(OURS, "none", "additive", "fused", "calibrated"),
    *ways_of(FOUR, "calibrated"),
)
"""What Table 2 is made for."""

BUDGET_WAYS = (*ways_of(PAPER, "additive"), *ways_of(OURS, "calibrated"))
"""What the error budget is made for."""


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of one pose; pose vectors x y z α β γ, mm and radians.

    Attributes
    ----------
    before : ndarray, shape (6,)
        Relative pose of the bones before reduction.
    recognised : dict of Road to ndarray, shape (6,)
        Recognised minus true pose of the mechanism.
    measured : dict of Way to ndarray, shape (6,)
        Recognised pose minus the struts', Eq. (31): what the paper could measure.
    compensated : dict of Way to ndarray, shape (6,)
        Error of the mechanism's pose that the plan starts from; with `none` the image's, with
        `additive` the struts'.
    after : dict of Way to ndarray, shape (6,)
        Relative pose of the bones after reduction.
    """

    before: Array
    recognised: dict[Road, Array]
    measured: dict[Way, Array]
    compensated: dict[Way, Array]
    after: dict[Way, Array]


def enact(
    trial: Trial,
    seen: dict[str, Seen],
    sources: Sources = ALL,
    *,
    roads: Iterable[Road] = ROADS,
    ways: Iterable[Way] = WAYS,
) -> Outcome:
    """Recognise, compensate, correct and execute one pose.

    Parameters
    ----------
    trial : Trial
    seen : dict of str to Seen
        By fit.
    sources : Sources
        Errors that act; what a chain assumes of them stays the same.
    roads, ways : iterable
        What to do; the roads of the ways are added.
    """
    ways = tuple(ways)
    rings = {
        road: _recognise(trial, seen[road.fit], road, sources)
        for road in dict.fromkeys([*roads, *(way.road for way in ways)])
    }
    true = trial.spec.mechanism_pose
    outcome = Outcome(
        before=vector(bones(trial, true)),
        recognised={road: vector(pair.mechanism, true) for road, pair in rings.items()},
        measured={},
        compensated={},
        after={},
    )
    for way in ways:
        compensation = _compensate(trial, rings[way.road], way, sources)
        outcome.measured[way] = vector(compensation.recognised, compensation.start)
        outcome.compensated[way] = vector(_believed(compensation), true)
        end = _execute(trial, compensation, way, sources)
        outcome.after[way] = vector(bones(trial, end))
    return outcome


def vector(pose: Pose, minus: Pose | None = None) -> Array:
    """Pose vector x y z α β γ, or the difference of two, shape (6,), mm and radians."""
    found = np.concatenate([pose.position_mm, pose.angles_rad])
    if minus is None:
        return found
    found -= np.concatenate([minus.position_mm, minus.angles_rad])
    found[3:] = np.mod(found[3:] + np.pi, 2.0 * np.pi) - np.pi
    return found


def bones(trial: Trial, mechanism: Pose) -> Pose:
    """Pose of the proximal bone in the distal one where {A} stands on {B}; reduced: identity."""
    return trial.bone.inverse() @ mechanism @ trial.spec.target_pose.inverse() @ trial.bone


def _recognise(trial: Trial, seen: Seen, road: Road, sources: Sources) -> RecognisedRings:
    found: list[RingPose] = []
    for ring, (pose, layout) in enumerate(zip(trial.rings, trial.layouts, strict=True)):
        part = MarkerLayout(layout.sites[: road.markers])
        places = part.points_mm.copy()
        if sources.installation:
            places += trial.installation_mm[ring, : road.markers]
        if sources.image:
            places += seen.error_mm[ring, : road.markers]
        stated = seen.covariances_mm2
        weights = None if stated is None else stated[ring, : road.markers]
        found.append(METHODS[road.method](pose.apply(places), part, covariances_mm2=weights))
    proximal, distal = found
    return RecognisedRings(
        proximal=proximal.pose,
        distal=distal.pose,
        proximal_covariance=proximal.covariance,
        distal_covariance=distal.covariance,
    )


def _compensate(trial: Trial, rings: RecognisedRings, way: Way, sources: Sources) -> Compensation:
    """Read the struts, solve the mechanism from them, and bring image and struts together."""
    fixator = trial.spec.fixator
    lengths = strut_lengths(_nominal(trial, sources), fixator)
    if sources.rounding:
        lengths = _nearest(lengths, way.scale_mm, fixator)
    struts = forward_kinematics(lengths, fixator, start=rings.mechanism).pose
    mode: CompensationMode = "fused" if way.mode == "calibrated" else way.mode
    doubt = reading_covariance(struts, fixator, resolution_mm=way.scale_mm)
    if way.mode == "calibrated":
        doubt = doubt + CALIBRATION
    return compensate(rings, theoretical=struts, mode=mode, theoretical_covariance=doubt)


def _nominal(trial: Trial, sources: Sources) -> Pose:
    """The pose that the strut lengths would give on a mechanism without error."""
    true = trial.spec.mechanism_pose
    if not sources.mechanism:
        return true
    return true @ Pose.exp(trial.mechanism_twists[0]).inverse()


def _believed(compensation: Compensation) -> Pose:
    """The mechanism's pose in the CT as the plan has it."""
    if compensation.mode == "additive":
        return compensation.start
    return compensation.distal.inverse() @ compensation.proximal


def _execute(trial: Trial, compensation: Compensation, way: Way, sources: Sources) -> Pose:
    """Plan the bones' reduction in the image, set the struts; the mechanism's true final pose."""
    ring_a, ring_b = trial.rings
    fixator = trial.spec.fixator
    reduction = FragmentMotion("proximal", ring_b @ trial.spec.target_pose @ ring_a.inverse())
    target = target_of(reduction, compensation)
    end = target
    if sources.rounding and way.best_rounding:
        end = _best_rounded(trial, target, way.scale_mm)
    elif sources.rounding:
        set_ = _nearest(strut_lengths(target, fixator), way.scale_mm, fixator)
        end = forward_kinematics(set_, fixator, start=target).pose
    if sources.mechanism:
        end = end @ Pose.exp(trial.mechanism_twists[1])
    return end


def _nearest(lengths: Array, scale_mm: float, fixator: Fixator) -> Array:
    """Lengths as the scale shows them, mm."""
    offset = fixator.strut.scale_offset_mm
    return np.round((lengths - offset) / scale_mm) * scale_mm + offset


def _best_rounded(trial: Trial, target: Pose, scale_mm: float) -> Pose:
    """Where the best of the 64 roundings puts {A}, the bone's end being what counts."""
    at_end = (trial.spec.target_pose.inverse() @ trial.bone).position_mm
    rows = round_rows(
        rotations=target.rotation[None],
        positions_mm=target.position_mm[None],
        interest_in_a_mm=at_end[None, None],
        fixator=trial.spec.fixator,
        step_mm=scale_mm,
    )
    return pose_of_row(rows, 0)
