"""The whole self-test, and the gate that plans pass."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hexafix.errors import SelfTestFailed
from hexafix.libraries import versions
from hexafix.selftest.check import Check, Outcome

_passed_with: set[tuple[tuple[str, str], ...]] = set()
"""Versions of all libraries with which the self-test has passed in this process."""


def checks() -> list[Check]:
    """What every plan relies on: uncompressed DICOM, rotations, fits, kinematics."""
    # Not at the top: these import NumPy, SciPy and pydicom.
    from hexafix.selftest.images import image_checks
    from hexafix.selftest.motion import motion_checks

    return [*image_checks(), *motion_checks()]


def foreign_checks() -> list[Check]:
    """What only some images need, each in a child process as when such an image is read."""
    from hexafix.selftest.foreign import codec_checks, image_file_checks

    return [*image_file_checks(), *codec_checks()]


def run_self_test(*, foreign: bool = False) -> list[Outcome]:
    """Run every check, whatever came of the others.

    Parameters
    ----------
    foreign : bool
        Also SimpleITK's readers and the codecs. The chain proves those by itself, in the process
        that reads the image and just before it, because only there it is known which are needed.
    """
    wanted = [*checks(), *(foreign_checks() if foreign else ())]
    return [check.run() for check in wanted]


def self_test_document(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """What ``hexafix selftest --json`` prints; ``refused`` only where a check did not pass."""
    document: dict[str, Any] = {
        "schema_version": 1,
        "passed": all(outcome.passed for outcome in outcomes),
        "seconds": round(sum(outcome.seconds for outcome in outcomes), 4),
        "versions": versions(),
        "checks": [outcome.as_json() for outcome in outcomes],
    }
    if not document["passed"]:
        document["refused"] = [o.fault.as_json() for o in outcomes if not o.passed]
    return document


def require_self_test() -> None:
    """Refuse unless the installed libraries give the known answers (H54).

    Once passed, it is not repeated in this process while the versions stay the same.

    Raises
    ------
    SelfTestFailed
        With a fault for each check that did not pass.
    """
    key = tuple(versions().items())
    if key in _passed_with:
        return
    failed = [outcome.fault for outcome in run_self_test() if not outcome.passed]
    if failed:
        raise SelfTestFailed(*failed)
    _passed_with.add(key)
