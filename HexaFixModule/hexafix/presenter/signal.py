"""A plain signal, the same in every toolkit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any


class Signal:
    """Callbacks that are called in the order of their connection."""

    def __init__(self) -> None:
        self._callbacks: list[Callable[..., Any]] = []

    def connect(self, callback: Callable[..., Any]) -> None:
        """Call `callback` at every emission from now on; connecting it again does nothing."""
        if callback not in self._callbacks:
            self._callbacks.append(callback)

    def disconnect(self, callback: Callable[..., Any]) -> None:
        """Do not call `callback` any more; one that is not connected does nothing."""
        if callback in self._callbacks:
            self._callbacks.remove(callback)

    def emit(self, *values: Any) -> None:
        """Call every callback."""
        for callback in tuple(self._callbacks):
            callback(*values)
