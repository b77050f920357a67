"""Results under the hash of their inputs: one of other inputs can never pass for fresh (H40)."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from hexafix.errors import Fault
from hexafix.presenter.state import Kind, Step

CAPACITY = {
    Step.LOAD: 2,
    Step.MARKERS: 16,
    Step.NUMBERING: 64,
    Step.POSES: 16,
    Step.READINGS: 64,
    Step.CORRECTION: 64,
    Step.SCHEDULE: 16,
    Step.EXPORT: 8,
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
        The pipeline's value; None where the step refused and gave nothing.
    document : mapping
        The value as plain data, for tables.
    faults : tuple of Fault
        Why the step refused; empty where it did not.
    kind : str
        How its faults are shown.
    """

    step: Step
    key: str
    image: str
    value: Any = None
    document: Mapping[str, Any] = field(default_factory=dict)
    faults: tuple[Fault, ...] = ()
    kind: Kind = "refused"

    @property
    def done(self) -> bool:
        """Whether nothing is missing in it and nothing refuses it."""
        complete = self.document.get("complete", True)
        return self.value is not None and not self.faults and bool(complete)


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

    def of(self, step: Step, key: str | None) -> Result | None:
        """The result of exactly these inputs, done or refused."""
        return None if key is None else self._kept[step].get(key)

    def forget(self, result: Result) -> None:
        """Drop a result, so that it is computed again."""
        self._kept[result.step].pop(result.key, None)

    def show(self, result: Result) -> None:
        """Remember a result as the one that stays on screen when its inputs change."""
        kept = self._kept[result.step]
        if result.key in kept:
            kept.move_to_end(result.key)
        self._shown[result.step] = result

    def shown(self, step: Step) -> Result | None:
        """The result that was on screen last."""
        return self._shown.get(step)

    def clear_shown(self) -> None:
        """Nothing is on screen: another case was opened."""
        self._shown.clear()

    def _forget_image(self, image: str) -> None:
        """Drop every result that holds an image which gave way."""
        if any(result.image == image for result in self._kept[Step.LOAD].values()):
            return
        for kept in self._kept.values():
            for key in [key for key, result in kept.items() if result.image == image]:
                del kept[key]
