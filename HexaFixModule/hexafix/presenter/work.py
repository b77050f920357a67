"""Running steps: on a working thread, with progress and cancel, each result under its inputs."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hexafix.errors import Cancelled, Fault, Refused
from hexafix.presenter.compute import defect, image_identity, outcome_of
from hexafix.presenter.core import Core, action
from hexafix.presenter.inputs import ORDER, Inputs
from hexafix.presenter.results import Result
from hexafix.presenter.state import Step
from hexafix.presenter.worker import Job, cancelled

POLL_S = 0.005
"""How often `wait` looks."""

TOLD_FRACTION = 0.02
"""Progress of the same words is told when it grew by this much."""


class Work(Core):
    """Run, cancel, wait, export, close."""

    @action
    def run(self, step: Step | str) -> None:
        """Compute a step with everything stale or missing before it."""
        self._start(Step(step))

    @action
    def run_all(self) -> None:
        """Compute everything to the prescription."""
        self._start(Step.EXPORT)

    def cancel(self) -> None:
        """Stop the work under way; older results stay as they are."""
        with self.lock:
            if self.job is not None:
                self.job.cancel()

    def wait(self, timeout_s: float = 60.0) -> bool:
        """Wait until nothing is under way; False if that took too long.

        Not for a door whose `post` needs the waiting thread.
        """
        end = time.monotonic() + timeout_s
        while self.snapshot.busy:
            if time.monotonic() > end:
                return False
            time.sleep(POLL_S)
        return True

    def close(self) -> None:
        """Stop the work under way and hand out no more snapshots."""
        with self.lock:
            self.closed = True
            job = self.job
            if job is not None:
                job.cancel()
        if job is not None:
            job.join()

    @action
    def export(self, folder: str | Path) -> None:
        """Write the prescription shown as an export folder, all or nothing."""
        if not self.snapshot.can_export:
            raise Refused.of(
                "export-blocked",
                "nothing was exported",
                limit=self.snapshot.export_blocked_by,
                hazard="H40",
                next_step="do what is said here, then export again",
            )
        result = self.result(Step.EXPORT)
        assert result is not None
        folder = Path(folder)

        def work(job: Job) -> None:
            job.progress("write the export", 0.0)
            self.engine.write_prescription(result.value, folder)
            self.post(lambda: self._exported(result.key, folder))

        self._begin(work, Step.EXPORT, None)

    def _exported(self, key: str, folder: Path) -> None:
        self.exported = (key, str(folder))

    # ------------------------------------------------------------ results

    def playback(self) -> Any:
        """The frame day by day as the schedule shown sets it; None without one."""
        with self.lock:
            plan = self.value(Step.SCHEDULE)
            return None if plan is None else self.engine.playback(plan)

    def prescription_files(self) -> Mapping[str, bytes] | None:
        """The files of the prescription, by name; None unless it is fresh."""
        with self.lock:
            if not self.is_done(Step.EXPORT):
                return None
            return MappingProxyType(dict(self.value(Step.EXPORT).files))

    def pictures(self) -> dict[str, str]:
        """SVG pictures by name: of the plan shown, else of the layout."""
        with self.lock:
            shown = self.results.shown(Step.SCHEDULE)
            if shown is not None:
                return dict(self.engine.pictures(shown.document))
            return {}

    # ------------------------------------------------------------ the job

    def _start(self, target: Step) -> None:
        if self.job is not None:
            raise Refused.of(
                "busy", "work is under way", next_step="wait until it is done, or stop it"
            )
        inputs = self.inputs
        missing = inputs.faults_before(target)
        if missing:
            raise Refused(*missing)
        steps = ORDER[: ORDER.index(target) + 1]
        for step in steps:
            found = self.result(step)
            if found is not None and found.value is None:
                self.results.forget(step, found.key)
        known = {step: found for step in steps if (found := self.result(step)) is not None}
        image = self.image(inputs)
        if all(self.is_done(step) for step in steps):
            return

        def work(job: Job) -> None:
            self._compute(job, inputs, steps, dict(known), image)

        self._begin(work, target, inputs)

    def _compute(
        self,
        job: Job,
        inputs: Inputs,
        steps: tuple[Step, ...],
        results: dict[Step, Result],
        image: str | None,
    ) -> None:
        """On the working thread: every missing step in order, until one refuses."""
        for step in steps:
            found = results.get(step)
            if found is None:
                job.check()
                self.post(lambda step=step: self._running(job, step))
                values = {done: result.value for done, result in results.items()}
                if step == Step.LOAD:
                    found = self._loaded(job, inputs)
                    image = found.image
                else:
                    found = self.computed(step, inputs, values, image or "", progress=job.progress)
                job.check()
                results[step] = found
                self.post(lambda found=found: self._store(inputs, found))
            if found.faults or not found.document.get("complete", True):
                return

    def _loaded(self, job: Job, inputs: Inputs) -> Result:
        fingerprint = inputs.fingerprint(Step.LOAD) or ""
        made = self.computed(Step.LOAD, inputs, {}, fingerprint, progress=job.progress)
        image = fingerprint
        if made.value is not None:
            image = image_identity(made.value, made.document)
        key = inputs.key(Step.LOAD, image) or ""
        return Result(Step.LOAD, key, image, made.value, made.document, made.faults, made.kind)

    def _store(self, inputs: Inputs, result: Result) -> None:
        fingerprint = inputs.fingerprint(Step.LOAD)
        if result.step == Step.LOAD and fingerprint is not None:
            self.images[fingerprint] = result.image
        self.results.store(result)
        self.refresh()

    def _running(self, job: Job, step: Step) -> None:
        if job is self.job:
            self.running, self.progress = step, None
            self.refresh()

    def _begin(self, work: Any, target: Step, inputs: Inputs | None) -> None:
        def guarded(job: Job) -> None:
            try:
                work(job)
            except Exception as error:
                caught = error
                self.post(lambda: self._ended(job, caught))
            else:
                self.post(lambda: self._ended(job, None))

        self.job = job = Job(guarded, report=self._report, threaded=self._threaded)
        self.running = target
        job.start()

    def _ended(self, job: Job, error: Exception | None) -> None:
        if job is not self.job:
            return
        self.job, self.running, self.progress = None, None, None
        if isinstance(error, Cancelled):
            self.tell(cancelled().faults[0], kind="info")
        elif error is not None:
            outcome = outcome_of(error)
            for fault in outcome.faults or (defect(error),):
                self.tell(fault, kind=outcome.kind)
        self.refresh()

    def _report(self, text: str, fraction: float) -> None:
        last = self.progress
        if last is not None and last[0] == text and 0 <= fraction - last[1] < TOLD_FRACTION:
            return
        self.post(lambda: self._progressed(text, fraction))

    def _progressed(self, text: str, fraction: float) -> None:
        if self.job is not None:
            self.progress = (text, fraction)
            self.refresh()


def fault_of(code: str, what: str, **more: str) -> Fault:
    """A fault of the workstation itself."""
    return Fault(code, what, **more)
