"""A gate: a value, its limit, and whether it refuses."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hexafix.errors import Fault, Refused


@dataclass(frozen=True, slots=True)
class Gate:
    """One check with its figure.

    Attributes
    ----------
    gate : str
        ``G2`` to ``G9``, or the hazard where it belongs to no numbered gate.
    code : str
        Kebab-case name of the fault it finds.
    name : str
        What is compared.
    hazard : str
    value, limit : float
    unit : str
    passed : bool
    message : str
        One sentence for people.
    next_step : str
        What to do when it is red.
    """

    gate: str
    code: str
    name: str
    hazard: str
    value: float
    limit: float
    unit: str
    passed: bool
    message: str
    next_step: str

    def as_json(self) -> dict[str, Any]:
        """The gate as it stands in ``plan.json``."""
        return {key: getattr(self, key) for key in self.__slots__}

    def as_fault(self) -> Fault:
        """The fault a red gate becomes."""
        return Fault(
            self.code,
            f"{self.gate} {self.name}: {self.message}",
            value=f"{self.value:.4g} {self.unit}".strip(),
            limit=f"{self.limit:.4g} {self.unit}".strip(),
            next_step=self.next_step,
            hazard=self.hazard,
        )


def decide(gates: Iterable[Gate]) -> None:
    """Refuse if any gate is red.

    Raises
    ------
    Refused
        With one fault per red gate.
    """
    red = [gate.as_fault() for gate in gates if not gate.passed]
    if red:
        raise Refused(*red)


def red(gates: Sequence[Gate]) -> tuple[Gate, ...]:
    """The gates that refuse."""
    return tuple(gate for gate in gates if not gate.passed)


def at_most(
    gate: str,
    code: str,
    name: str,
    hazard: str,
    value: float,
    limit: float,
    unit: str,
    **words: str,
) -> Gate:
    """A gate that passes up to its limit; `words` are its ``good``, ``bad`` and ``next`` texts."""
    passed = bool(np.isfinite(value) and value <= limit)
    message = words["good"] if passed else words["bad"]
    return Gate(gate, code, name, hazard, float(value), limit, unit, passed, message, words["next"])
