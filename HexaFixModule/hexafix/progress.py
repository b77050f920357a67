"""How long steps report progress and can be stopped."""

from __future__ import annotations

from typing import Protocol


class Progress(Protocol):
    """Called by long steps between pieces of work.

    An implementation stops the work by raising `hexafix.errors.Cancelled`.
    """

    def __call__(self, step: str, fraction: float) -> None:
        """Report that `step` is done to `fraction` in [0, 1]."""
        ...


def silent(step: str, fraction: float) -> None:
    """Progress that nobody watches."""
