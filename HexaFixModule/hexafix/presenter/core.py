"""The state behind the workstation: versions, results, what is asked of the user, the snapshot."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Concatenate, ParamSpec

from hexafix.errors import Fault, HexaFixError
from hexafix.presenter import notices
from hexafix.presenter.compute import LIVE, compute, defect, outcome_of
from hexafix.presenter.engine import Engine, pipeline_engine
from hexafix.presenter.history import History, Version, document_bytes
from hexafix.presenter.inputs import ORDER, Inputs
from hexafix.presenter.results import Result, Results
from hexafix.presenter.signal import Signal
from hexafix.presenter.state import Banner, Kind, Snapshot, Step
from hexafix.presenter.view import snapshot_of
from hexafix.presenter.worker import Job, Post

NEW_CASE: Mapping[str, Any] = {"schema_version": 2, "ring_front_confirmed": False}
"""What a new case holds: nothing is guessed, and the rings' front is asked for (H22)."""

P = ParamSpec("P")


def action(
    method: Callable[Concatenate[Any, P], Any],
) -> Callable[Concatenate[Any, P], bool]:
    """A user's action: errors become banners; returns whether it was done."""

    @functools.wraps(method)
    def wrapped(self: Any, /, *args: P.args, **kwargs: P.kwargs) -> bool:
        with self.lock:
            self.notices.clear()
            try:
                method(self, *args, **kwargs)
            except HexaFixError as error:
                for fault in error.faults:
                    self.tell(fault, kind=outcome_of(error).kind)
                done = False
            except Exception as error:
                self.tell(defect(error), kind="error")
                done = False
            else:
                done = True
            self.refresh()
            return done

    return wrapped


class Core:
    """What all parts of the presenter share."""

    def __init__(
        self, *, engine: Engine | None = None, post: Post | None = None, threaded: bool = True
    ) -> None:
        self.lock = threading.RLock()
        self.changed = Signal()
        self.notices: list[Banner] = []
        self.results = Results()
        self.images: dict[str, str] = {}
        """Identity of the image that each fingerprint of `Step.LOAD` last gave."""
        self.history = History(Version(document_bytes(NEW_CASE)))
        self.inputs = Inputs(self.history.present)
        self.case_path: Path | None = None
        self.saved: bytes | None = None
        self.current = Step.LOAD
        self.side_confirmed: str | None = None
        self.readings_given: list[float] | None = None
        self.readings_repeated: list[float] | None = None
        self.series: Mapping[str, Any] | None = None
        self.exported: tuple[str, str] | None = None
        self.split_fraction = 0.5
        self.job: Job | None = None
        self.running: Step | None = None
        self.progress: tuple[str, float] | None = None
        self.closed = False
        self._engine = engine
        self._threaded = threaded
        self._post: Post = post or self._at_once
        self._snapshot = Snapshot()
        self.refresh()

    @property
    def engine(self) -> Engine:
        """The pipeline, or what stands for it."""
        if self._engine is None:
            self._engine = pipeline_engine()
        return self._engine

    @property
    def snapshot(self) -> Snapshot:
        """What is to be shown now."""
        return self._snapshot

    def post(self, work: Callable[[], Any]) -> None:
        """Run `work` on the door's thread, under the lock, unless the door is closed."""

        def locked() -> None:
            with self.lock:
                if not self.closed:
                    work()

        self._post(locked)

    def _at_once(self, work: Callable[[], Any]) -> None:
        work()

    # ------------------------------------------------------------ what is fresh

    @property
    def version(self) -> Version:
        """The case as it is now."""
        return self.history.present

    def image(self, inputs: Inputs) -> str | None:
        """Identity of the image of these inputs, once it was read."""
        fingerprint = inputs.fingerprint(Step.LOAD)
        return None if fingerprint is None else self.images.get(fingerprint)

    def key(self, step: Step) -> str | None:
        """Hash of what the step's result depends on now; None while that is not known."""
        return self.inputs.key(step, self.image(self.inputs))

    def result(self, step: Step) -> Result | None:
        """The result of exactly the present inputs, done or refused."""
        return self.results.of(step, self.key(step))

    def is_fresh(self, step: Step) -> bool:
        """Whether the step's value belongs to the present inputs."""
        found = self.result(step)
        return found is not None and found.value is not None

    def is_done(self, step: Step) -> bool:
        """Whether the step's value belongs to the present inputs and nothing refuses it."""
        found = self.result(step)
        return (
            found is not None
            and found.value is not None
            and not found.faults
            and found.document.get("complete", True)
        )

    def value(self, step: Step) -> Any:
        """The newest value of a step, fresh or grey; None if there is none."""
        with self.lock:
            found = self.result(step)
            if found is None or found.value is None:
                found = self.results.shown(step)
            return None if found is None else found.value

    # ------------------------------------------------------------ changes

    def tell(self, fault: Fault, *, kind: Kind, step: Step | None = None) -> None:
        """Show a fault until the next action."""
        self.notices.append(notices.banner(fault, kind=kind, step=step))

    def refresh(self) -> None:
        """Bring live steps up to date and hand out a new snapshot."""
        if self.inputs.version is not self.history.present:
            self.inputs = Inputs(self.history.present)
        if not self.closed:
            self._live()
        for step in ORDER:
            found = self.result(step)
            if found is not None and found.value is not None:
                self.results.show(found)
        self._snapshot = snapshot_of(self)
        self.changed.emit(self._snapshot)

    def _live(self) -> None:
        before = {
            Step.NUMBERING: Step.MARKERS,
            Step.READINGS: Step.POSES,
            Step.CORRECTION: Step.POSES,
        }
        for step in LIVE:
            source = self.result(before[step])
            if source is None or source.value is None or source.faults:
                continue
            key, image = self.key(step), self.image(self.inputs)
            if key is None or image is None or self.results.of(step, key) is not None:
                continue
            self.results.store(
                self.computed(step, self.inputs, {before[step]: source.value}, image)
            )

    def computed(
        self, step: Step, inputs: Inputs, values: Mapping[Step, Any], image: str, **more: Any
    ) -> Result:
        """The result of a step, an error as its refusal; Cancelled passes through."""
        from hexafix.errors import Cancelled

        try:
            outcome = compute(step, self.engine, inputs, values, **more)
        except Cancelled:
            raise
        except Exception as error:
            outcome = outcome_of(error)
        return Result(
            step,
            inputs.key(step, image) or "",
            image,
            outcome.value,
            dict(outcome.document or {}),
            outcome.faults,
            outcome.kind,
        )
