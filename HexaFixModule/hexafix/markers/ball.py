"""What the search for marker balls returns."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Ball:
    """A marker ball found in the image.

    Attributes
    ----------
    center_mm : ndarray, shape (3,)
        LPS, mm, read-only.
    diameter_mm : float
        Fitted diameter.
    covariance_mm2 : ndarray, shape (3, 3)
        Of the centre, LPS, mm², calibrated on phantoms.
    rms_residual_mm : float
        RMS distance of the edge points from the fitted sphere.
    core_hu : float
        Median HU inside the ball.
    method : str
        ``gradient-rays`` or ``model-fit``.
    warnings : tuple of str
        What the user should look at.
    clipped : bool
        Whether the scanner clipped the ball's core; its diameter then looks too large (H11).
    added : bool
        Whether the user put it there; tests that it failed stand among its warnings.
    """

    center_mm: NDArray[np.float64]
    diameter_mm: float
    covariance_mm2: NDArray[np.float64]
    rms_residual_mm: float
    core_hu: float
    method: str
    warnings: tuple[str, ...] = field(default=())
    clipped: bool = False
    added: bool = False

    @property
    def sigma_mm(self) -> NDArray[np.float64]:
        """Standard deviation of the centre along L, P and S, shape (3,), mm."""
        return np.sqrt(np.diag(self.covariance_mm2))


@dataclass(frozen=True, eq=False)
class Rejected:
    """A candidate that is not a marker ball.

    Attributes
    ----------
    center_mm : ndarray, shape (3,)
        LPS, mm.
    reason : str
        The predicate it failed, with value and limit.
    """

    center_mm: NDArray[np.float64]
    reason: str


@dataclass(frozen=True, eq=False)
class BallSet:
    """All balls of one diameter in an image.

    Attributes
    ----------
    balls : tuple of Ball
    rejected : tuple of Rejected
    warnings : tuple of str
    """

    balls: tuple[Ball, ...]
    rejected: tuple[Rejected, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def centers_mm(self) -> NDArray[np.float64]:
        """Centres, shape (M, 3), LPS mm."""
        return np.array([ball.center_mm for ball in self.balls], float).reshape(-1, 3)
