"""Where the resources lie: in a wheel, an editable install, a flat Slicer install or a checkout."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from hexafix.errors import InputError


@cache
def resources() -> Path:
    """The folder ``Resources``: the first of package, parent and grandparent that holds one.

    Raises
    ------
    InputError
        If the installation lacks its resources.
    """
    here = Path(__file__).resolve().parent
    for folder in (here, here.parent, here.parent.parent):
        if (folder / "Resources" / "Hardware").is_dir():
            return folder / "Resources"
    raise InputError.of(
        "resources-missing",
        "the folder Resources/Hardware of this installation is missing",
        where=str(here),
        next_step="install HexaFix again",
    )
