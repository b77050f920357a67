"""The desktop command."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def desktop(
    case: Annotated[
        Path | None,
        Parameter(help="A case file, a folder that holds case.json, or a scene (.mrb)."),
    ] = None,
) -> int:
    """Open the workstation in a window; needs a display and hexafix[qt]."""
    from hexafix.qt.app import run_desktop

    return run_desktop(case)
