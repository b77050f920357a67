"""A plain signal, the same in every toolkit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Signal:
    """Callbacks, called in the order of their connection; each always sees the newest value last.

    A callback may cause the next emission: every callback then gets the older value before the
    newer one, never the other way round.
    """

    def __init__(self) -> None:
        self._callbacks: list[Callable[[Any], Any]] = []
        self._waiting: list[Any] = []
        self._emitting = False

    def connect(self, callback: Callable[[Any], Any]) -> None:
        """Call `callback` at every emission from now on; connecting it again does nothing."""
        if callback not in self._callbacks:
            self._callbacks.append(callback)

    def disconnect(self, callback: Callable[[Any], Any]) -> None:
        """Do not call `callback` any more; one that is not connected does nothing."""
        if callback in self._callbacks:
            self._callbacks.remove(callback)

    def emit(self, value: Any) -> None:
        """Call every callback with `value`."""
        self._waiting.append(value)
        if self._emitting:
            return
        self._emitting = True
        try:
            while self._waiting:
                value = self._waiting.pop(0)
                for callback in tuple(self._callbacks):
                    callback(value)
        finally:
            self._emitting = False
            self._waiting.clear()
