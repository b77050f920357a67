"""Expected pose errors of layouts by three roads: exact, sampled and fully simulated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hexafix.accuracy.jacobian import expected_errors
from hexafix.errors import Fault, InputError
from hexafix.progress import Progress, silent
from hexafix.study.error_model import ErrorModel, error_maps, exact_covariances
from hexafix.study.jacobians import model_jacobians
from hexafix.study.layouts import RingLayouts
from hexafix.study.sampling import LinearKernel, Moments, sample_moments
from hexafix.study.simulation import METHODS, FullKernel

Array = NDArray[np.float64]

PAPER_SAMPLES = 2000
"""K_s of Section 4.3."""

PAPER_AND_FIT, TRUE_AND_FIT = [0, 2], [1, 2]
"""Models of `jacobians.MODELS` for the linear answers, and for the full simulation."""


@dataclass(frozen=True)
class StudySettings:
    """How a study is run.

    Attributes
    ----------
    samples : int
        For each layout in the linear models; K_s.
    full_samples : int
        For each layout in the full simulation.
    seed : int
    errors : ErrorModel
    workers, backend
        As in `runner.in_order`.

    Raises
    ------
    InputError
        Fewer than two samples, a negative seed or no worker: before hours of work, not after.
    """

    samples: int = PAPER_SAMPLES
    full_samples: int = PAPER_SAMPLES
    seed: int = 0
    errors: ErrorModel = ErrorModel()  # noqa: RUF009 (frozen)
    workers: int | None = None
    backend: str | None = None

    def __post_init__(self) -> None:
        faults = [
            Fault("bad-study", f"{name} is too small", value=str(value), limit=f"{least} or more")
            for name, value, least in (
                ("samples", self.samples, 2),
                ("full_samples", self.full_samples, 2),
                ("seed", self.seed, 0),
                ("workers", 1 if self.workers is None else self.workers, 1),
            )
            if value < least
        ]
        if faults:
            raise InputError(*faults)


@dataclass(frozen=True, eq=False)
class Estimates:
    """E|ΔX| of G layouts by the group method and by weighted least squares, mm and radians.

    Attributes
    ----------
    layouts : RingLayouts
    exact : ndarray, shape (G, 2, 6)
        By covariance: the paper's linear model, and the linear model of the fit.
    covariance : ndarray, shape (G, 2, 6, 6)
        Of ΔX in the same models.
    sampled : Moments
        The same by Monte Carlo.
    full : ndarray, shape (G, 2, 6)
        By full simulation of both recognitions; NaN where recognition refuses the layout (H16).
        Layouts that are one ring turned share the figures of the first: their volume errors are
        the same.
    full_volume_error : tuple of ndarray, shape (G, 2) each
        Standard errors of `full`'s volume errors.

    Notes
    -----
    Source: Eq. (23), (24).
    """

    layouts: RingLayouts
    exact: Array
    covariance: Array
    sampled: Moments
    full: Array
    full_volume_error: tuple[Array, Array]


def volumes(expected: Array) -> tuple[Array, Array]:
    """Volume errors of expectations, shape (..., 6) to (...) in mm and in rad. Source: Eq. (28)."""
    return np.linalg.norm(expected[..., :3], axis=-1), np.linalg.norm(expected[..., 3:], axis=-1)


def estimate(
    layouts: RingLayouts,
    settings: StudySettings,
    progress: Progress = silent,
    *,
    stream: int = 0,
) -> Estimates:
    """Every answer for every layout; layout g draws from the random stream ``stream + g``."""
    maps = error_maps(model_jacobians(layouts, settings.errors), layouts, settings.errors)
    covariances = exact_covariances(maps)
    expected = expected_errors(covariances)
    sampled = sample_moments(
        LinearKernel(
            np.ascontiguousarray(maps[:, PAPER_AND_FIT]), stream + np.arange(len(layouts))
        ),
        samples=settings.samples,
        seed=settings.seed,
        workers=settings.workers,
        backend=settings.backend,
        progress=progress,
        step=f"sample {len(layouts)} layouts",
    )
    full, spread = _simulated(layouts, maps, expected, settings, stream, progress)
    linear = covariances[:, PAPER_AND_FIT]
    return Estimates(layouts, expected[:, PAPER_AND_FIT], linear, sampled, full, spread)


def _simulated(
    layouts: RingLayouts,
    maps: Array,
    expected: Array,
    settings: StudySettings,
    stream: int,
    progress: Progress,
) -> tuple[Array, tuple[Array, Array]]:
    """Full simulation of the recognisable layouts, and standard errors of its volume errors."""
    shape = (len(layouts), len(METHODS))
    full = np.full((*shape, 6), np.nan)
    spread = np.full(shape, np.nan), np.full(shape, np.nan)
    usable = np.flatnonzero(layouts.recognisable)
    if len(usable) == 0:
        return full, spread
    first, same = _distinct(layouts.take(usable), settings.errors)
    chosen = usable[first]
    moments = sample_moments(
        FullKernel(
            layouts.take(chosen), settings.errors, maps[chosen][:, TRUE_AND_FIT], stream + chosen
        ),
        samples=settings.full_samples,
        seed=settings.seed,
        workers=settings.workers,
        backend=settings.backend,
        progress=progress,
        step=f"recognise {len(chosen)} layouts",
    )
    # The linear model's expectation is known, so only the difference carries chance.
    difference = Moments(moments.samples, moments.mean[:, 2:], moments.covariance[:, 2:])
    at = expected[chosen][:, TRUE_AND_FIT] + difference.mean
    full[usable] = at[same]
    for into, found in zip(spread, difference.volume_standard_error(at), strict=True):
        into[usable] = found[same]
    return full, spread


def _distinct(
    layouts: RingLayouts, errors: ErrorModel
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """First of each set of layouts that are one ring turned, and each layout's set.

    Only where errors and rings look alike from every side; else every layout stands alone.
    """
    every = np.arange(len(layouts))
    sigma = (errors.image_sigma_mm, errors.installation_sigma_mm)
    alike = all(s[0] == s[1] for s in sigma) and all(
        np.ptp(column) == 0.0 for column in (layouts.radius_mm, layouts.height_mm)
    )
    if not alike:
        return every, every
    gaps = np.round(np.degrees(layouts.included_angles_rad), 6)
    turned = np.stack([np.roll(gaps, k, axis=1) for k in range(layouts.markers)], axis=1)
    order = np.lexsort(np.moveaxis(turned, -1, 0)[::-1], axis=-1)[:, 0]
    _, first, same = np.unique(turned[every, order], axis=0, return_index=True, return_inverse=True)
    return first, same.ravel()
