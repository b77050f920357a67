"""What HexaFix needs besides Slicer's own Python, asked for when the user wants it, not before."""

from __future__ import annotations

import importlib
import re
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from hexafix.errors import MissingLibrary
from hexafix.paths import resources
from hexafix.slicer_panel import host

REQUESTER = "HexaFix"


def requirements_file() -> Path:
    """The list, in pip's format."""
    return resources() / "requirements.txt"


def stated() -> tuple[str, ...]:
    """All that is needed, one requirement each."""
    lines = requirements_file().read_text("utf-8").splitlines()
    return tuple(line for line in map(str.strip, lines) if line and not line.startswith("#"))


def missing() -> tuple[str, ...]:
    """What is needed and not installed; since Slicer 5.11 also what is of another version."""
    check = getattr(_manager(), "pip_check", None) or _is_installed
    return tuple(need for need in stated() if not check(need))


def install() -> None:
    """Ask the user, then install what is missing into Slicer's Python.

    Raises
    ------
    MissingLibrary
        If the user declines, or if something is still missing afterwards.
    """
    needed = missing()
    if not needed:
        return
    ensure = getattr(_manager(), "pip_ensure", None)
    if ensure is not None:
        try:
            ensure(list(needed), requester=REQUESTER)
        except RuntimeError as error:
            raise _not_installed(needed) from error
    else:
        _install_simply(needed)
    left = missing()
    if left:
        raise _not_installed(left)


def _install_simply(needed: tuple[str, ...]) -> None:
    """As `install`, where `slicer.packaging` has no question of its own."""
    util = host.slicer().util
    question = (
        "HexaFix needs these Python packages. Installing them changes Slicer's Python "
        "environment. Continue?\n\n" + "\n".join(needed)
    )
    if not util.confirmOkCancelDisplay(question, REQUESTER):
        raise _not_installed(needed)
    util.pip_install(list(needed))


def _manager() -> Any | None:
    try:
        return importlib.import_module("slicer.packaging")
    except ImportError:
        return None


def _is_installed(requirement: str) -> bool:
    name = re.split(r"[^A-Za-z0-9._-]", requirement, maxsplit=1)[0]
    try:
        version(name)
    except PackageNotFoundError:
        return False
    return True


def _not_installed(needed: tuple[str, ...]) -> MissingLibrary:
    return MissingLibrary.of(
        "library-missing",
        "HexaFix cannot work without Python packages that are not installed",
        value=", ".join(needed),
        next_step="install them by the panel's button, or ask who looks after this Slicer",
    )
