"""The versions of the case document: undo and redo by the raw bytes."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from hexafix.strict_json import parse_json_object


@dataclass(frozen=True)
class Origin:
    """Bytes that stand for those of a case file that is not at hand.

    Attributes
    ----------
    raw_sha256 : str
        Hash of the bytes that stand for it.
    told : str
        Hash of the case file, as told by what they were read from.
    """

    raw_sha256: str
    told: str


@dataclass(frozen=True)
class Version:
    """The case at one moment: everything that undo brings back.

    Attributes
    ----------
    raw : bytes
        The case document as read, or as it would be written.
    folder : Path or None
        What relative paths in it are relative to; None for a case never saved.
    relaxed : bool
        Whether the relaxed angle rule is accepted (H17); not part of the case file.
    label : str
        The edit that made this version.
    origin : Origin or None
        Of a case that came in a scene; it speaks of its own bytes alone, so that an edit cannot
        carry the hash on.
    """

    raw: bytes
    folder: Path | None = None
    relaxed: bool = False
    label: str = ""
    origin: Origin | None = None

    @cached_property
    def sha256(self) -> str:
        """Hash of the case file that holds this version: what a plan names as its case."""
        own = hashlib.sha256(self.raw).hexdigest()
        return self.origin.told if self.origin and self.origin.raw_sha256 == own else own

    @cached_property
    def content(self) -> Mapping[str, Any]:
        """The document; not to be changed."""
        return parse_json_object(self.raw, what="case file", where="case.json")

    def copy(self) -> dict[str, Any]:
        """The document as a copy to be changed."""
        return json.loads(self.raw)


def document_bytes(document: Mapping[str, Any]) -> bytes:
    """An edited document as it is written; ValueError or TypeError if it is not JSON."""
    return (json.dumps(document, indent=2, allow_nan=False, ensure_ascii=False) + "\n").encode()


class History:
    """The present version, those before it and those undone."""

    def __init__(self, present: Version) -> None:
        self._past: list[Version] = []
        self._future: list[Version] = []
        self.present = present

    def edit(self, version: Version, *, joined: bool = False) -> None:
        """Make `version` the present; what was undone is forgotten.

        An edit that is joined takes the place of the one before: both are undone at once.
        """
        if not joined:
            self._past.append(self.present)
        self._future.clear()
        self.present = version

    def replace(self, version: Version) -> None:
        """Another present at the same place, as saving elsewhere makes it."""
        self.present = version

    def undo(self) -> bool:
        """Back by one edit; False if there is none."""
        if not self._past:
            return False
        self._future.append(self.present)
        self.present = self._past.pop()
        return True

    def redo(self) -> bool:
        """Forward by one undone edit; False if there is none."""
        if not self._future:
            return False
        self._past.append(self.present)
        self.present = self._future.pop()
        return True

    @property
    def can_undo(self) -> bool:
        """Whether there is an edit to take back."""
        return bool(self._past)

    @property
    def can_redo(self) -> bool:
        """Whether there is an undone edit."""
        return bool(self._future)

    @property
    def undo_label(self) -> str:
        """The edit that undo takes back, or empty."""
        return self.present.label if self._past else ""

    @property
    def redo_label(self) -> str:
        """The edit that redo brings back, or empty."""
        return self._future[-1].label if self._future else ""
