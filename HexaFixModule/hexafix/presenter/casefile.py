"""The case file on disk: opened as it is, saved whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hexafix.case.read import file_of_case, resolve_fixator
from hexafix.errors import InputError
from hexafix.export import replace_file
from hexafix.presenter.history import Version, document_bytes
from hexafix.strict_json import read_json_object

TYPED_ONCE = "readings_to_repeat"
"""Key of a file whose readings were typed once (H24); the case at work never holds it, so that
repeating them changes no plan."""


def read_case_file(path: Path) -> tuple[Path, bytes, Version]:
    """The case file's path, its bytes, and its content, complete or a draft.

    The content has other bytes than the file where that says that its readings were typed once.

    Raises
    ------
    InputError
        If it is no JSON object or no case file of a known version.
    """
    file = file_of_case(path).resolve()
    raw, content = read_json_object(file, what="case file")
    require_case(content)
    content_bytes = raw
    if content.get(TYPED_ONCE) is True:
        content_bytes = document_bytes({k: v for k, v in content.items() if k != TYPED_ONCE})
    return file, raw, Version(content_bytes, file.parent, label="open the case")


def require_case(content: Mapping[str, Any]) -> None:
    """InputError if a document is no case, complete or a draft."""
    version = content.get("schema_version")
    if not isinstance(version, int) or isinstance(version, bool):
        raise InputError.of(
            "not-a-case",
            "the file is not a case file",
            where="case file",
            next_step="open a case.json, or load an image into a new case",
        )


def file_bytes(version: Version, *, typed_once: bool) -> bytes:
    """A version as it is saved; `typed_once`: its readings were typed and not repeated."""
    if not typed_once:
        return version.raw
    return document_bytes({**version.copy(), "schema_version": 2, TYPED_ONCE: True})


def portable(version: Version) -> dict[str, Any]:
    """The document as it reads anywhere: with the definition of a fixator in place of its file."""
    document = version.copy()
    given, folder = document.get("fixator"), version.folder
    if isinstance(given, str) and folder is not None and (folder / given).is_file():
        _, definition, faults = resolve_fixator(document, set(), folder)
        if not faults:
            document["fixator"] = definition
    return document


def moved(version: Version, folder: Path) -> Version:
    """The version as it reads in another folder: its relative paths lead to the same files."""
    if version.folder == folder:
        return version
    document = version.copy()
    image = document.get("image")
    if isinstance(image, dict) and isinstance(image.get("path"), str):
        image["path"] = _path_from(folder, version.folder, image["path"])
    fixator = document.get("fixator")
    if isinstance(fixator, str) and version.folder and (version.folder / fixator).is_file():
        document["fixator"] = _path_from(folder, version.folder, fixator)
    raw = version.raw if document == version.content else document_bytes(document)
    return Version(raw, folder, version.relaxed, version.label)


def path_in(folder: Path | None, path: Path) -> str:
    """A path as a case in `folder` holds it: relative to it where that is possible."""
    return _path_from(folder, None, str(path)) if folder else str(path)


def _path_from(folder: Path, old: Path | None, given: str) -> str:
    whole = (old / given if old else Path(given)).resolve()
    try:
        return Path(os.path.relpath(whole, folder)).as_posix()
    except ValueError:  # another drive
        return str(whole)


def write_case_file(path: Path, raw: bytes, *, expected: bytes | None) -> None:
    """Write a case file whole or not at all.

    Parameters
    ----------
    path : Path
    raw : bytes
    expected : bytes or None
        What the file held when this program last read or wrote it; None for a file of its own
        choice that the user was asked about.

    Raises
    ------
    InputError
        If somebody else has changed the file meanwhile (H47), or it cannot be written (H46).
    """
    if expected is not None and path.exists() and path.read_bytes() != expected:
        raise InputError.of(
            "case-changed-on-disk",
            "the case file was changed by another program since it was opened",
            where="case file",
            hazard="H47",
            next_step="save under another name, then compare both",
        )
    replace_file(path, raw)
