"""Runs pytest again and again in forks of one process that holds the slow imports.

Reads lists of pytest's arguments as JSON lines, answers each with exit code and output.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import tempfile
import traceback

SLOW_IMPORTS = (
    *("numpy", "scipy.linalg", "scipy.spatial.transform", "scipy.ndimage", "scipy.special"),
    *("pydicom", "pydantic.root_model", "cyclopts", "rich", "pytest", "SimpleITK"),
)
"""Libraries only, pydantic by the part that loads all of it (else PySide6's import hook breaks it):
nothing of HexaFix, which every fork loads from its changed source."""


def answer(arguments: list[str]) -> dict[str, object]:
    """Exit code and output of pytest with these arguments, in a child."""
    with tempfile.TemporaryFile("w+") as output:
        child = os.fork()
        if child == 0:
            os.dup2(output.fileno(), 1)
            os.dup2(output.fileno(), 2)
            code = 70
            try:
                code = int(importlib.import_module("pytest").main(arguments))
            except BaseException:
                traceback.print_exc()
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(code)
        _, status = os.waitpid(child, 0)
        output.seek(0)
        return {"code": os.waitstatus_to_exitcode(status), "output": output.read()}


def main() -> None:
    """Serve until the input ends."""
    for name in SLOW_IMPORTS:
        importlib.import_module(name)
    for line in sys.stdin:
        print(json.dumps(answer(json.loads(line))), flush=True)


if __name__ == "__main__":
    main()
