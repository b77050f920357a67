"""Running steps: on a working thread, with progress and stop, each result under its inputs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from hexafix.errors import Cancelled, Refused
from hexafix.presenter.compute import compute, faults_of_error, kind_of, search
from hexafix.presenter.core import Core, action
from hexafix.presenter.inputs import ORDER, Inputs
from hexafix.presenter.results import Result
from hexafix.presenter.state import Step
from hexafix.presenter.worker import Job, cancelled

POLL_S = 0.002
"""How often `wait` looks."""

TOLD_FRACTION = 0.01
"""Progress of the same words is told when it grew by this much."""


class Work(Core):
    """Run, stop, wait, export, close."""

    _target: Step | None = None
    """How far the job under way goes; None if it computes no steps."""
    _pending: Step | None = None
    """How far to go once the job under way has ended."""
    _playback: tuple[Result, Any] | None = None
    _pictures: tuple[Any, dict[str, str]] | None = None

    @action
    def run(self, step: Step | str) -> None:
        """Compute a step with everything stale or missing before it."""
        self.start(Step(step))

    @action
    def run_all(self) -> None:
        """Compute everything to the prescription."""
        self.start(Step.EXPORT)

    @action
    def cancel(self) -> None:
        """Stop the work under way; older results stay as they are."""
        self._pending = None
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
            job.join()

    @action
    def export(self, folder: str | Path) -> None:
        """Write the prescription shown as an export folder, all or nothing."""
        self.look_again()
        self.refresh()
        blocked, result = self.snapshot.export_blocked_by, self.result(Step.EXPORT)
        if blocked or result is None:
            raise Refused.of(
                "export-blocked",
                f"nothing was exported: {blocked}",
                hazard="H40",
                next_step="do what is said here, then export again",
            )
        target = Path(folder)

        def work(job: Job) -> None:
            job.progress("write the export", 0.0)
            self.engine.write_prescription(result.value, target)
            with self.lock:
                self.exported = (result.key, str(target))

        self._begin(work, Step.EXPORT)

    @action
    def list_series(self, path: str | Path) -> None:
        """List the series of a DICOM folder in the table ``series``."""

        def work(job: Job) -> None:
            series = self.engine.image_series(Path(path), progress=job.progress)
            with self.lock:
                self.series = series

        self._begin(work, Step.LOAD)

    # ------------------------------------------------------------ results

    def playback(self) -> Any:
        """The frame day by day as the schedule shown sets it; None without one."""
        with self.lock:
            shown = self.results.shown(Step.SCHEDULE)
            if shown is None:
                return None
            if self._playback is None or self._playback[0] is not shown:
                self._playback = (shown, self.engine.playback(shown.value))
            return self._playback[1]

    def prescription_files(self) -> Mapping[str, bytes] | None:
        """The files of the prescription, by name; None unless it is fresh."""
        with self.lock:
            if not all(self.is_done(step) for step in ORDER):
                return None
            return MappingProxyType(dict(self.value(Step.EXPORT).files))

    def pictures(self) -> dict[str, str]:
        """SVG pictures by name: of the plan shown; the layouts always as the case has them now."""
        with self.lock:
            shown, fresh = self.results.shown(Step.SCHEDULE), self.is_fresh(Step.SCHEDULE)
            made_of = (shown, fresh, self.layout[0])
            if self._pictures is None or self._pictures[0] != made_of:
                self._pictures = (made_of, self._drawn(shown, fresh))
            return dict(self._pictures[1])

    def _drawn(self, plan: Result | None, fresh: bool) -> dict[str, str]:
        made = {} if plan is None else dict(self.engine.pictures(plan.document))
        parts = self.inputs.parts
        if fresh or parts.proximal is None or parts.distal is None:
            return made
        return {**made, **self.engine.layout_pictures(parts.proximal, parts.distal)}

    # ------------------------------------------------------------ the job

    def start(self, target: Step) -> None:
        """Compute up to `target`; work under way goes on, and further if need be."""
        self.look_again()
        if self.job is not None:
            if self._target is not None and not self.job.stopping:
                self._target = max(self._target, target, key=ORDER.index)
            else:
                self._pending = max(self._pending or target, target, key=ORDER.index)
            return
        for step in ORDER[: ORDER.index(target) + 1]:
            found = self.result(step)
            if found is not None and not found.done:
                self.results.forget(found)
        self._target = target
        self._begin(self._compute_all, None)

    def _begin(self, work: Callable[[Job], Any], step: Step | None) -> None:
        if self.job is not None:
            raise Refused.of(
                "busy", "work is under way", next_step="wait until it is done, or stop it"
            )

        def guarded(job: Job) -> None:
            error = None
            try:
                work(job)
            except Exception as caught:
                error = caught
            self.post(lambda: self._ended(job, error))

        self.running, self.progress = step, None
        self.job = Job(guarded, report=self._report, threaded=self._threaded)
        self.job.start()

    def _compute_all(self, job: Job) -> None:
        """On the working thread: always the first step that is not done, of the case as it is."""
        while (begun := self._begin_step(job)) is not None:
            step, inputs, image, values = begun
            self.post(self.refresh)
            try:
                result = self._computed(job, step, inputs, image, values)
                job.check()
            except Cancelled:
                if job.stopping:
                    raise
                continue  # the case was changed meanwhile: what was computed is of the past
            with self.lock:
                self._store(inputs, result)
            self.post(self.refresh)

    def _begin_step(self, job: Job) -> tuple[Step, Inputs, str, dict[Step, Any]] | None:
        with self.lock:
            job.next_step()
            self.update_inputs()
            target = self._target or Step.LOAD
            values = {}
            for step in ORDER[: ORDER.index(target) + 1]:
                found = self.result(step)
                if found is not None and found.done:
                    values[step] = found.value
                    continue
                missing = self.inputs.faults_before(step)
                if found is not None and not found.faults:
                    missing = self.inputs.faults_before(target)  # judged, but not complete
                if found is not None or missing:
                    self.tell(*missing, kind="error", step=step)
                    break
                self.running, self.progress = step, None
                return step, self.inputs, self.image or "", values
            self._target = None
            return None

    def _computed(
        self, job: Job, step: Step, inputs: Inputs, image: str, values: dict[Step, Any]
    ) -> Result:
        found = None
        if step == Step.MARKERS and any(inputs.marker_edits.values()):
            with self.lock:
                searched = self.results.of(step, inputs.search_key(image))
            if searched is None:
                searched = self._searched(job, inputs, image, values[Step.LOAD])
            found = None if searched is None else searched.value
        return compute(
            step, self.engine, inputs, values, image=image, found=found, progress=job.progress
        )

    def _searched(self, job: Job, inputs: Inputs, image: str, volume: Any) -> Result | None:
        """The balls before the user's edits; None if the search refuses, as the step will tell."""
        try:
            result = search(self.engine, inputs, volume, image=image, progress=job.progress)
        except Cancelled:
            raise
        except Exception:
            return None
        with self.lock:
            self.results.store(result)
        return result

    def _store(self, inputs: Inputs, result: Result) -> None:
        fingerprint = inputs.fingerprint(Step.LOAD)
        if result.step == Step.LOAD and fingerprint is not None:
            self.images[fingerprint] = result.image
        self.results.store(result)

    def _ended(self, job: Job, error: Exception | None) -> None:
        if job is not self.job:
            return
        self.job, self.running, self.progress, self._target = None, None, None, None
        if isinstance(error, Cancelled):
            self.tell(*cancelled().faults, kind="info")
        elif error is not None:
            self.tell(*faults_of_error(error), kind=kind_of(error))
        pending, self._pending = self._pending, None
        if pending is not None:
            self.start(pending)
        self.refresh()

    def _report(self, text: str, fraction: float) -> None:
        last = self.progress
        if last is not None and last[0] == text and 0 <= fraction - last[1] < TOLD_FRACTION:
            return
        self.progress = (text, fraction)
        self.post(self.refresh)
