"""One comparison between an export and its recomputation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True, slots=True)
class Check:
    """What was compared, by how much it differs, and whether that is allowed.

    Attributes
    ----------
    name : str
    value, limit : float
    unit : str
    passed : bool
    message : str
    """

    name: str
    value: float
    limit: float
    unit: str
    passed: bool
    message: str

    def as_json(self) -> dict[str, Any]:
        """The check as ``verify --json`` prints it."""
        return {key: getattr(self, key) for key in self.__slots__}


def largest(name: str, difference: ArrayLike, limit: float, unit: str) -> Check:
    """A check on the largest absolute difference; anything not finite fails."""
    array = np.abs(np.asarray(difference, float))
    value = float(np.max(array)) if array.size else 0.0
    passed = bool(np.isfinite(value) and value <= limit)
    message = f"differs by {value:.3g} {unit} (limit {limit:g})".replace("  ", " ")
    return Check(name, value if np.isfinite(value) else -1.0, limit, unit, passed, message)


def stated(name: str, passed: bool, message: str) -> Check:
    """A check without a number."""
    return Check(name, 0.0 if passed else 1.0, 0.0, "", bool(passed), message)
