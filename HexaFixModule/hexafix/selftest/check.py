"""One check of the self-test and what came of it."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from hexafix.errors import Fault, HexaFixError, MissingLibrary
from hexafix.libraries import named, untrusted

Measure = Callable[[], str]
"""Runs a known case; returns in words what differs from the known answer, empty if nothing does."""


@dataclass(frozen=True)
class Check:
    """A known case and its answer.

    Attributes
    ----------
    name : str
    library : str
        The library most likely at fault if the answer is wrong; several joined by " + ".
    expected : str
        The known answer in words.
    measure : callable
    """

    name: str
    library: str
    expected: str
    measure: Measure

    def run(self) -> Outcome:
        """Run the case; any error is a wrong answer."""
        start = time.perf_counter()
        try:
            found = self.measure()
        except MissingLibrary as missing:
            found = missing.faults[0].what
        except HexaFixError as error:
            fault = error.faults[0]
            found = fault.value if fault.code == "self-test" and fault.value else fault.code
        except Exception as error:
            found = type(error).__name__
        return Outcome(self, found, time.perf_counter() - start)


@dataclass(frozen=True)
class Outcome:
    """What came of a check.

    Attributes
    ----------
    check : Check
    found : str
        What differs from the known answer, empty if nothing does.
    seconds : float
    """

    check: Check
    found: str
    seconds: float

    @property
    def passed(self) -> bool:
        """Whether the known answer came."""
        return not self.found

    @property
    def fault(self) -> Fault:
        """The refusal of a check that did not pass."""
        check = self.check
        return untrusted(check.name, check.library, expected=check.expected, found=self.found)

    def as_json(self) -> dict[str, Any]:
        """The outcome as ``hexafix selftest --json`` prints it."""
        document = {
            "name": self.check.name,
            "library": named(self.check.library),
            "passed": self.passed,
            "expected": self.check.expected,
            "seconds": round(self.seconds, 4),
        }
        return document if self.passed else {**document, "found": self.found}
