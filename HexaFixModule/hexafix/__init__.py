"""HexaFix: from a CT of a hexapod external fixator to a verified strut schedule.

Research software, not a medical device. A plain ``import hexafix`` loads nothing heavy; the
public names below are loaded when used.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

_PUBLIC = {
    "read_volume": "hexafix.imaging",
    "find_balls": "hexafix.markers",
    "plan_correction": "hexafix.pipeline",
    "load_case": "hexafix.case",
    "verify_export": "hexafix.verify",
}

__all__ = ["__version__", *_PUBLIC]


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'hexafix' has no attribute {name!r}")
