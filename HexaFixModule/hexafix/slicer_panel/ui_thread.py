"""Work of other threads comes back to Slicer's user interface, by a timer and a queue."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Any

YIELD_S = 0.015
"""How long a tick lets other threads run: Slicer's event loop may hold Python's lock for ever."""


class UiThread:
    """Runs callables on the thread that made it, which is Slicer's.

    Parameters
    ----------
    timer : qt.QTimer
        Ticks while work is under way, and only then.
    """

    def __init__(self, timer: Any) -> None:
        self._timer = timer
        self._owner = threading.get_ident()
        self._waiting: SimpleQueue[Callable[[], Any]] = SimpleQueue()
        self._busy = False
        timer.setInterval(0)
        timer.connect("timeout()", self.tick)

    def post(self, work: Callable[[], Any]) -> None:
        """Run `work` soon, or at once if this is Slicer's thread; from any thread."""
        if threading.get_ident() == self._owner:
            work()
        else:
            self._waiting.put(work)

    def set_busy(self, busy: bool) -> None:
        """Say whether work is under way; called on Slicer's thread."""
        self._busy = busy
        if busy:
            self._timer.start()

    def tick(self) -> None:
        """Let the work go on, then run what it posted."""
        if self._waiting.empty():
            time.sleep(YIELD_S)
        while True:
            try:
                work = self._waiting.get_nowait()
            except Empty:
                break
            work()
        if not self._busy and self._waiting.empty():
            self._timer.stop()

    def close(self) -> None:
        """Tick no more."""
        self._busy = False
        self._timer.stop()
