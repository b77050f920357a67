"""The application around the panel: Slicer's own modules, imported when they are used."""

from __future__ import annotations

from typing import Any


def slicer() -> Any:
    """The module ``slicer`` of the running application."""
    import slicer as module

    return module


def qt() -> Any:
    """PythonQt's module ``qt``."""
    import qt as module  # pyright: ignore[reportMissingImports]

    return module
