"""The CT of one pose: rendered, searched for balls, and fitted as the paper did and as we do."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.benchmark.balls import isosurface_center
from hexafix.imaging import Volume
from hexafix.markers import find_balls
from hexafix.phantom import make_phantom
from hexafix.recognition import number_balls
from hexafix.study.experiment_trial import Trial

Array = NDArray[np.float64]

FITS = ("isosurface", "rays")
"""The paper's isosurface with a least-squares sphere, and HexaFix's fit along gradient rays."""

CROP_MM = 12.0
"""Half width of what is cut out around a ball for the isosurface."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What one fit says of the balls.

    Attributes
    ----------
    error_mm : ndarray, shape (2, 4, 3)
        Found minus true centre, proximal ring first, along the ring's own axes.
    covariances_mm2 : ndarray, shape (2, 4, 3, 3), or None
        As the fit states them, in LPS; None: it states none.
    """

    error_mm: Array
    covariances_mm2: Array | None


def scan(trial: Trial) -> dict[str, Seen]:
    """Render the whole CT of a pose, find and number all its balls, and fit them twice.

    Raises
    ------
    MarkersNotFound, NumberingAmbiguous, ImageRefused
        If the search or the numbering does not find every ball.
    """
    spec = trial.spec
    volume = make_phantom(spec, workers=1).volume
    found = find_balls(volume, ball_diameter_mm=spec.ball_diameter_mm)
    proximal, distal = trial.layouts
    numbering = number_balls(found.centers_mm, proximal=proximal, distal=distal)
    order = [numbering.ball_of_number[n] for n in (*proximal.numbers, *distal.numbers)]
    rays = found.centers_mm[order]
    surface = np.array(
        [
            isosurface_center(
                cut_out(volume, center), near_mm=center, diameter_mm=spec.ball_diameter_mm
            )
            for center in rays
        ]
    )
    stated = np.array([found.balls[k].covariance_mm2 for k in order]).reshape(2, 4, 3, 3)
    return {
        "isosurface": Seen(_errors(trial, surface), None),
        "rays": Seen(_errors(trial, rays), stated),
    }


def cut_out(volume: Volume, center_mm: Array) -> Volume:
    """The voxels around a point, LPS mm."""
    middle = np.rint(volume.ijk_from_lps(center_mm)).astype(int)
    reach = np.ceil(CROP_MM / np.asarray(volume.spacing_mm)).astype(int)
    first = np.maximum(middle - reach, 0)
    i, j, k = (slice(a, b) for a, b in zip(first, middle + reach + 1, strict=True))
    affine = np.array(volume.ijk_to_lps)
    affine[:3, 3] += affine[:3, :3] @ first
    return Volume(np.ascontiguousarray(volume.voxels[k, j, i]), affine)


def _errors(trial: Trial, centers: Array) -> Array:
    """Errors of centres, shape (8, 3), LPS mm, along each ring's axes, shape (2, 4, 3)."""
    places = np.array([layout.points_mm for layout in trial.layouts]) + trial.installation_mm
    seen = [
        ring.inverse().apply(part)
        for ring, part in zip(trial.rings, centers.reshape(2, 4, 3), strict=True)
    ]
    return np.array(seen) - places


@dataclass(frozen=True, eq=False)
class ImageError:
    """How one fit errs, measured on the rendered CTs.

    Attributes
    ----------
    bias_mm : ndarray, shape (3,)
        Mean error along the ring's axes.
    covariance_mm2 : ndarray, shape (3, 3)
        Around the mean.
    stated_mm2 : ndarray, shape (3, 3), or None
        Mean of the covariances that the fit states.
    balls : int
    worst_mm : float
        Largest 3D error.
    """

    bias_mm: Array
    covariance_mm2: Array
    stated_mm2: Array | None
    balls: int
    worst_mm: float

    @property
    def rms_mm(self) -> float:
        """RMS of the 3D error."""
        return float(np.sqrt(self.bias_mm @ self.bias_mm + np.trace(self.covariance_mm2)))

    def draw(self, trial: Trial) -> Seen:
        """Errors of a pose without a CT."""
        root = np.linalg.cholesky(self.covariance_mm2)
        stated = None
        if self.stated_mm2 is not None:
            stated = np.broadcast_to(self.stated_mm2, (2, 4, 3, 3))
        return Seen(self.bias_mm + trial.image_z @ root.T, stated)


def measured(scans: list[dict[str, Seen]]) -> dict[str, ImageError]:
    """The image error of each fit over all balls of all rendered CTs."""
    found = {}
    for fit in FITS:
        errors = np.concatenate([seen[fit].error_mm.reshape(-1, 3) for seen in scans])
        stated = [seen[fit].covariances_mm2 for seen in scans]
        known = [part.reshape(-1, 3, 3) for part in stated if part is not None]
        # the rings stand almost upright in LPS and the stated covariances are almost round
        mean = np.concatenate(known).mean(axis=0) if known else None
        worst = float(np.linalg.norm(errors, axis=1).max())
        found[fit] = ImageError(errors.mean(axis=0), np.cov(errors.T), mean, len(errors), worst)
    return found
