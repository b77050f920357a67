"""Results under the hash of their inputs: a result of other inputs can never pass for fresh (H40)."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass, field
from typing import Any

from hexafix.errors import Fault
from hexafix.presenter.state import Step

CAPACITY = {
    Step.LOAD: 2,
    Step.MARKERS: 8,
    Step.NUMBERING: 32,
    Step.POSES: 8,
    Step.READINGS: 16,
    Step.CORRECTION: 32,
    Step.SCHEDULE: 8,
    Step.EXPORT: 4,
}
"""Results kept of each step; volumes are large."""


@dataclass(frozen=True, eq=False)
class Result:
    """What one step gave for one set of inputs.

    Attributes
    ----------
    step : Step
    key : str
        Hash of exactly the inputs it depends on.
    image : str
        Identity of the image it depends on.
    value : object or None
        The pipeline's value; None where the step refused.
    document : mapping
        The value as plain data, for tables.
    faults : tuple of Fault
        Why the step refused; empty where it is done.
    """

    step: Step
    key: str
    image: str
    value: Any = None
    document: dict[str, Any] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    kind: str = "refused"


class Results:
    """The results kept, and for each step the one shown last."""

    def __init__(self) -> None:
        self._kept: dict[Step, OrderedDict[str, Result]] = {step: OrderedDict() for step in Step}
        self._shown: dict[Step, Result] = {}

    def store(self, result: Result) -> None:
        """Keep a result; the one used longest ago gives way."""
        kept = self._kept[result.step]
        kept[result.key] = result
        kept.move_to_end(result.key)
        while len(kept) > CAPACITY[result.step]:
            _, gone = kept.popitem(last=False)
            if gone.step == Step.LOAD:
                self._forget_image(gone.image)
        if result.value is not None:
            self._shown[result.step] = result

    def forget(self, step: Step, key: str | None) -> None:
        """Drop a result, so that it is computed again."""
        if key is not None:
            self._kept[step].pop(key, None)

    def of(self, step: Step, key: str | None) -> Result | None:
        """The result of exactly these inputs, done or refused."""
        return None if key is None else self._kept[step].get(key)

    def show(self, result: Result) -> None:
        """Remember a result as the one that stays on screen when its inputs change."""
        self._kept[result.step].move_to_end(result.key)
        self._shown[result.step] = result

    def shown(self, step: Step) -> Result | None:
        """The result that was on screen last."""
        return self._shown.get(step)

    def clear(self) -> None:
        """Forget what is shown; another case was opened."""
        self._shown.clear()

    def _forget_image(self, image: str) -> None:
        """Drop every result that holds an image which gave way."""
        for kept in self._kept.values():
            for key in [key for key, result in kept.items() if result.image == image]:
                del kept[key]
