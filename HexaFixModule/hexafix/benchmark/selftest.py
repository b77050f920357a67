"""What the self-test adds to the start of a plan."""

from __future__ import annotations

import os
import subprocess
import sys
from typing import Any

_PROGRAM = """
import time
import hexafix.pipeline
from hexafix.selftest import require_self_test, run_self_test
start = time.perf_counter()
require_self_test()
end = time.perf_counter()
print(end - start)
require_self_test()
print(time.perf_counter() - end)
print(sum(outcome.passed for outcome in run_self_test()))
"""


def self_test_time(rounds: int = 7) -> dict[str, Any]:
    """Time of the self-test in new processes that have loaded the chain, best of `rounds`.

    Returns
    -------
    dict
        ``first_s``, ``again_s`` (asked a second time in one process) and ``checks``, how many
        pass.
    """
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    first, again, checks = [], [], 0
    for _ in range(rounds):
        run = subprocess.run(
            [sys.executable, "-c", _PROGRAM],
            check=True,
            env=environment,
            capture_output=True,
            text=True,
        )
        seconds, repeated, passed = run.stdout.split()
        first.append(float(seconds))
        again.append(float(repeated))
        checks = int(passed)
    return {"first_s": min(first), "again_s": min(again), "checks": checks}
