"""JSON as a safety-critical file: no duplicate keys, no NaN, a readable place for each fault."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from hexafix.errors import Fault, InputError

MAX_BYTES = 8 * 1024 * 1024
"""A case or definition file larger than this is refused before it is parsed."""


def read_json_object(path: Path, *, what: str) -> tuple[bytes, dict[str, Any]]:
    """Bytes and content of a JSON file that holds one object.

    Parameters
    ----------
    path : Path
    what : str
        What the file is, for messages, e.g. ``case file``; its own name may hold a patient's and
        is never shown (H51).

    Raises
    ------
    InputError
        If the file cannot be read, is not UTF-8 JSON, repeats a key, holds NaN or infinity, or
        is not an object (H55).
    """
    try:
        if path.stat().st_size > MAX_BYTES:
            raise InputError.of(
                "file-too-large",
                f"the {what} is too large",
                value=f"{path.stat().st_size} bytes",
                limit=f"{MAX_BYTES} bytes",
                where=what,
            )
        raw = path.read_bytes()
    except OSError as error:
        raise InputError.of(
            "file-unreadable",
            f"the {what} cannot be read: {error.strerror}",
            where=what,
            next_step="check the path",
        ) from error
    return raw, parse_json_object(raw, what=what, where=what)


def parse_json_object(raw: bytes, *, what: str, where: str) -> dict[str, Any]:
    """Content of JSON bytes that hold one object; see `read_json_object`."""
    repeated: list[str] = []

    def pairs(items: list[tuple[str, Any]]) -> dict[str, Any]:
        keys = [key for key, _ in items]
        repeated.extend(sorted({key for key in keys if keys.count(key) > 1}))
        return dict(items)

    def constant(name: str) -> Any:
        raise ValueError(f"{name} is not a number of a {what}")

    try:
        content = json.loads(raw.decode("utf-8"), object_pairs_hook=pairs, parse_constant=constant)
    except (ValueError, RecursionError) as error:
        raise InputError.of(
            "not-json", f"the {what} is not JSON: {error}", where=where, hazard="H55"
        ) from error
    if not isinstance(content, dict):
        raise InputError.of("not-json", f"the {what} must hold one JSON object", where=where)
    if repeated:
        raise InputError(
            *(
                Fault(
                    "duplicate-key",
                    f"key given twice: {key}",
                    where=where,
                    hazard="H55",
                    next_step="keep one of them",
                )
                for key in repeated
            )
        )
    return content
