"""Is a marker layout accurate, unique and buildable: what ``hexafix check-layout`` says."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hexafix.accuracy.jacobian import group_covariance, least_squares_covariance, volume_error
from hexafix.accuracy.uniqueness import best_exchange, best_relabelling, mirror_rms_mm
from hexafix.errors import LayoutRejected
from hexafix.hardware import MarkerLayout
from hexafix.recognition.alternatives import relabelling_words
from hexafix.recognition.least_squares import IMAGE_SIGMA_MM, INSTALLATION_SIGMA_MM
from hexafix.recognition.rigid import Array, best_triangle_height_mm

PREFERRED_DEG = 45.0
"""Smallest minimum and median included angle (Section 4.3.2)."""

RELAXED_MIN_DEG, RELAXED_SPREAD_DEG = 15.0, 150.0
"""Smallest minimum, largest maximum minus median included angle (Section 4.3.2)."""

UNIQUENESS_TARGET_MM = 8.0
"""Uniqueness that advised layouts reach: the limit of 5 mm and room for building them."""

ANGLE_TOLERANCE_DEG = 1e-6
"""Rounding of angles given in degrees."""

COLLINEAR_MM = 1e-3
"""Below this triangle height no error can be predicted."""


@dataclass(frozen=True, eq=False)
class LayoutVerdict:
    """What is to be said about one ring's layout.

    Attributes
    ----------
    included_angles_rad : ndarray, shape (N,)
        Between neighbours around the ring, read-only.
    rule : str
        ``preferred``, ``relaxed`` or ``violated``, Section 4.3.2.
    uniqueness_mm : float
        RMS of the best wrong numbering (H18).
    uniqueness_words : str
        That numbering.
    mirror_mm : float
        RMS of the mirror image; 0 means that a mirrored image cannot be seen in this ring (H01).
    out_of_plane_mm : float
        Extent of the markers normal to their best plane.
    triangle_height_mm : float
        Smallest height of the least flat triangle (H16).
    second_singular_mm : float
        Second singular value of the centred layout over √N: RMS distance from its best line.
    predicted_error_mm, predicted_error_rad : float or None
        Expected volume error, Eq. (28), of the least-squares pose; None if collinear.
    group_error_mm, group_error_rad : float or None
        The same of the paper's group method; None if every group is nearly collinear.
    """

    included_angles_rad: NDArray[np.float64]
    rule: str
    uniqueness_mm: float
    uniqueness_words: str
    mirror_mm: float
    out_of_plane_mm: float
    triangle_height_mm: float
    second_singular_mm: float
    predicted_error_mm: float | None
    predicted_error_rad: float | None
    group_error_mm: float | None
    group_error_rad: float | None

    def as_json(self) -> dict[str, Any]:
        """The keys of ``check-layout``, angles in degrees."""
        return {
            "included_angles_deg": np.degrees(self.included_angles_rad).tolist(),
            "rule": self.rule,
            "uniqueness_mm": self.uniqueness_mm,
            "nearest_wrong_numbering": self.uniqueness_words,
            "predicted_error_mm": self.predicted_error_mm,
            "predicted_error_deg": _degrees(self.predicted_error_rad),
            "group_method_error_mm": self.group_error_mm,
            "group_method_error_deg": _degrees(self.group_error_rad),
            "mirror_mm": self.mirror_mm,
            "out_of_plane_mm": self.out_of_plane_mm,
            "triangle_height_mm": self.triangle_height_mm,
        }


@dataclass(frozen=True, eq=False)
class LayoutCheck:
    """Both rings together.

    Attributes
    ----------
    proximal, distal : LayoutVerdict
    exchange_mm : float or None
        RMS of the better-fitting ring taken for the other; None if their counts differ (H20).
    advice : tuple of str
        What would be better, concretely.
    """

    proximal: LayoutVerdict
    distal: LayoutVerdict
    exchange_mm: float | None
    advice: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """The document of ``check-layout``."""
        return {
            "proximal": self.proximal.as_json(),
            "distal": self.distal.as_json(),
            "exchange_mm": self.exchange_mm,
            "advice": list(self.advice),
        }


def check_layout(
    layout: MarkerLayout,
    *,
    sigma_image_mm: float = IMAGE_SIGMA_MM,
    sigma_installation_mm: ArrayLike = INSTALLATION_SIGMA_MM,
    covariances_mm2: ArrayLike | None = None,
) -> LayoutVerdict:
    """Check one ring's layout.

    Parameters
    ----------
    layout : MarkerLayout
    sigma_image_mm : float
        Error of a ball centre along each axis; the default is the paper's.
    sigma_installation_mm : array_like, shape (), (3,) or (N, 3)
        Installation error along the ring's axes.
    covariances_mm2 : array_like, shape (N, 3, 3), optional
        Of the ball centres in the ring frame, in place of `sigma_image_mm`.

    Raises
    ------
    LayoutRejected
        Fewer than three markers (H13).
    """
    if len(layout) < 3:
        raise LayoutRejected.of(
            "too-few-markers",
            "a ring's pose needs three markers",
            value=str(len(layout)),
            limit="at least 3",
            hazard="H13",
            next_step="add markers to the layout",
        )
    points = layout.points_mm
    height = best_triangle_height_mm(points)
    spread = np.linalg.svd(points - points.mean(axis=0))
    normal = spread[2][2]
    along = points @ normal
    fit, groups = _predicted(
        layout,
        height,
        sigma_image_mm=sigma_image_mm,
        sigma_installation_mm=sigma_installation_mm,
        covariances_mm2=covariances_mm2,
    )
    uniqueness, order = best_relabelling(layout)
    angles = layout.included_angles_rad.copy()
    angles.setflags(write=False)
    return LayoutVerdict(
        included_angles_rad=angles,
        rule=angle_rule(layout),
        uniqueness_mm=uniqueness,
        uniqueness_words=relabelling_words(order, layout),
        mirror_mm=mirror_rms_mm(layout),
        out_of_plane_mm=float(np.ptp(along)),
        triangle_height_mm=height,
        second_singular_mm=float(spread[1][1] / np.sqrt(len(layout))),
        predicted_error_mm=float(fit[0]) if fit else None,
        predicted_error_rad=float(fit[1]) if fit else None,
        group_error_mm=float(groups[0]) if groups else None,
        group_error_rad=float(groups[1]) if groups else None,
    )


def _predicted(
    layout: MarkerLayout, height_mm: float, **errors: Any
) -> tuple[tuple[Array, Array] | None, tuple[Array, Array] | None]:
    """Volume errors of the least-squares and the group pose, None where there is no pose."""
    fit = None
    if height_mm > COLLINEAR_MM:
        fit = volume_error(least_squares_covariance(layout, **errors))
    try:
        groups = volume_error(group_covariance(layout, **errors))
    except LayoutRejected:
        groups = None
    return fit, groups


def angle_rule(layout: MarkerLayout) -> str:
    """The rule that a layout's included angles meet: preferred, relaxed or violated.

    Notes
    -----
    Source: Section 4.3.2, for three markers. Departs: more markers meet a rule if three of them
    do, because another marker only adds knowledge; taken literally, ten even markers (36°)
    would break the rule that three even ones meet.
    """
    phi = np.array([site.sweep_rad for site in layout.sites])
    rules = set(np.unique(triple_rules(phi[list(map(list, combinations(range(len(phi)), 3)))])))
    return next(name for name in ("preferred", "relaxed", "violated") if name in rules)


def triple_rules(sweep_rad: Array) -> NDArray[np.str_]:
    """Rule of each triple of sweep angles, shape (K, 3) to (K,)."""
    phi = np.sort(np.mod(np.degrees(sweep_rad), 360.0), axis=-1)
    gaps = np.sort(np.diff(np.concatenate([phi, phi[:, :1] + 360.0], axis=-1), axis=-1), axis=-1)
    smallest, median, largest = gaps.T
    preferred = smallest >= PREFERRED_DEG - ANGLE_TOLERANCE_DEG
    relaxed = (smallest >= RELAXED_MIN_DEG - ANGLE_TOLERANCE_DEG) & (
        largest - median <= RELAXED_SPREAD_DEG + ANGLE_TOLERANCE_DEG
    )
    return np.where(preferred, "preferred", np.where(relaxed, "relaxed", "violated"))


def exchange_rms_mm(proximal: MarkerLayout, distal: MarkerLayout) -> float | None:
    """RMS of one ring's balls taken for the other's; None if their counts differ (H20)."""
    return best_exchange(proximal, distal)[0] if len(proximal) == len(distal) else None


def _degrees(angle_rad: float | None) -> float | None:
    return None if angle_rad is None else float(np.degrees(angle_rad))
