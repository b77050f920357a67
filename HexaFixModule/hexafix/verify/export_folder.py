"""Reading an export back."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from hexafix.errors import InputError
from hexafix.export import FILES, MANIFEST
from hexafix.strict_json import parse_json_object, read_json_object
from hexafix.verify.check import Check, stated
from hexafix.verify.printed import check_printed
from hexafix.verify.recompute import recompute


def verify_export(folder: Path) -> dict[str, Any]:
    """Read an export back and recompute every number in it by another road.

    Parameters
    ----------
    folder : Path
        An export of ``hexafix plan``.

    Returns
    -------
    dict
        ``verified`` and every check with value and limit.

    Raises
    ------
    InputError
        If there is no export in the folder or it cannot be read.
    """
    folder = Path(folder)
    _, manifest = read_json_object(folder / MANIFEST, what="manifest")
    files = _read_files(folder)
    checks = _file_checks(files, manifest)
    document = parse_json_object(files["plan.json"], what="plan", where="plan.json")
    if document.get("schema_version") != 1 or document.get("kind") != "hexafix-plan":
        raise InputError.of(
            "plan-unknown",
            "plan.json is not a plan of a version that this program knows",
            value=f"{document.get('kind')} {document.get('schema_version')}",
            limit="hexafix-plan 1",
            where="plan.json",
        )
    checks += _content_checks(document, files)
    return {
        "schema_version": 1,
        "verified": all(check.passed for check in checks),
        "case_id": document.get("case_id"),
        "checks": [check.as_json() for check in checks],
    }


def _read_files(folder: Path) -> dict[str, bytes]:
    missing = [name for name in FILES if not (folder / name).is_file()]
    if missing:
        raise InputError.of(
            "export-incomplete",
            "files of the export are missing",
            value=", ".join(missing),
            where="the export",
            hazard="H46",
            next_step="plan the case again",
        )
    return {name: (folder / name).read_bytes() for name in FILES}


def _file_checks(files: dict[str, bytes], manifest: dict[str, Any]) -> list[Check]:
    listed = manifest.get("sha256", {})
    checks = []
    for name in FILES:
        same = listed.get(name) == hashlib.sha256(files[name]).hexdigest()
        checks.append(
            stated(f"{name} as in the manifest", same, "unchanged" if same else "was changed")
        )
    return checks


def _content_checks(document: dict[str, Any], files: dict[str, bytes]) -> list[Check]:
    """Recomputation and print; content that is not a plan's fails instead of raising."""
    try:
        checks = list(recompute(document).checks)
        wrong = check_printed(document, files)
    except (
        KeyError, IndexError, TypeError, ValueError, AttributeError, np.linalg.LinAlgError
    ) as error:  # fmt: skip
        return [stated("content", False, f"not the content of a plan: {type(error).__name__}")]
    message = "every printed number is the plan's" if not wrong else "; ".join(wrong[:5])
    return [*checks, stated("print", not wrong, message)]
