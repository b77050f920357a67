"""Long work off the door's thread: progress, stop, end."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from hexafix.errors import Cancelled

Post = Callable[[Callable[[], Any]], Any]
"""Runs a callable on the door's own thread."""

JOIN_S = 10.0
"""How long a door that closes waits for work that was told to stop."""


def cancelled() -> Cancelled:
    """The error that stops work."""
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
        Called with the job; what it runs reports to `progress`, which stops it.
    report : callable
        Called on the working thread with text and fraction.
    threaded : bool
        Whether `start` returns at once; else it returns when the work is done.
    """

    def __init__(
        self, work: Callable[[Job], Any], *, report: Callable[[str, float], Any], threaded: bool
    ) -> None:
        self._work, self._report, self._threaded = work, report, threaded
        self._stop, self._skip = threading.Event(), threading.Event()
        # A daemon, so that work inside a library cannot keep a closed program alive.
        self._thread = threading.Thread(target=self._run, name="hexafix-work", daemon=True)

    def start(self) -> None:
        """Begin."""
        if self._threaded:
            self._thread.start()
        else:
            self._run()

    def cancel(self) -> None:
        """Stop at the next report of progress."""
        self._stop.set()

    def skip(self) -> None:
        """Stop the step under way, whose inputs have changed, and go on with the work."""
        self._skip.set()

    def next_step(self) -> None:
        """A step begins; Cancelled if the job was told to stop."""
        self._skip.clear()
        self.check()

    @property
    def stopping(self) -> bool:
        """Whether the whole job was told to stop."""
        return self._stop.is_set()

    def check(self) -> None:
        """Raise Cancelled if the job or its step was told to stop."""
        if self._stop.is_set() or self._skip.is_set():
            raise cancelled()

    def progress(self, step: str, fraction: float) -> None:
        """What the pipeline reports to."""
        self.check()
        self._report(step, fraction)

    def join(self) -> bool:
        """Wait for the end, at most `JOIN_S`; False if it did not come."""
        if self._thread is not threading.current_thread() and self._thread.is_alive():
            self._thread.join(JOIN_S)
        return not self._thread.is_alive()

    def _run(self) -> None:
        self._work(self)
