"""Long work off the door's thread, with progress, cancel and an end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from hexafix.errors import Cancelled

Post = Callable[[Callable[[], Any]], Any]
"""Runs a callable on the door's own thread."""

JOIN_S = 10.0
"""How long `Job.join` waits for the work to notice that it was stopped."""


def cancelled() -> Cancelled:
    """The error that stops a job."""
    return Cancelled.of(
        "cancelled",
        "the work was stopped; older results are as they were",
        next_step="start the step again when you want it",
    )


class Job:
    """One piece of work that can be stopped.

    Parameters
    ----------
    work : callable
        Called with the progress to report to; raises what the progress raises.
    report : callable
        Called on the working thread with text and fraction.
    threaded : bool
        Whether `start` returns at once; else it returns when the work is done.
    """

    def __init__(
        self,
        work: Callable[[Job], None],
        *,
        report: Callable[[str, float], None],
        threaded: bool,
    ) -> None:
        self._work, self._report = work, report
        self._stop = threading.Event()
        # A daemon, so that work inside a library cannot keep a closed program alive.
        self._thread = threading.Thread(target=self._run, name="hexafix-work", daemon=True)
        self._threaded = threaded

    def start(self) -> None:
        """Begin."""
        if self._threaded:
            self._thread.start()
        else:
            self._run()

    def cancel(self) -> None:
        """Stop at the next report of progress."""
        self._stop.set()

    @property
    def stopping(self) -> bool:
        """Whether it was told to stop."""
        return self._stop.is_set()

    def check(self) -> None:
        """Raise Cancelled if the job was told to stop."""
        if self._stop.is_set():
            raise cancelled()

    def progress(self, step: str, fraction: float) -> None:
        """What the pipeline reports to."""
        self.check()
        self._report(step, fraction)

    def join(self, timeout_s: float = JOIN_S) -> bool:
        """Wait for the end; False if it did not come."""
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _run(self) -> None:
        self._work(self)
