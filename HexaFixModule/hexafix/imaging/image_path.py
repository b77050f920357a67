"""What must hold of the path of an image, of whatever kind."""

from __future__ import annotations

from pathlib import Path

from hexafix.errors import InputError


def require_path(path: Path) -> Path:
    """The path itself; refused if nothing is there."""
    if not path.exists():
        raise InputError.of(
            "image-not-found",
            "the image file or folder does not exist",
            where="image",
            next_step="check the path; image.path is relative to the case file",
        )
    return path
