"""Remove one gate at a time from a copy of the checkout and demand that a test notices.

    python Testing/hazards/remove_gate.py [H03 H24.2 ...] [--sample N --seed S]

Names select rows or single gates; without them all gates are removed in turn. Ends with 0 when
the chosen rows' tests pass as they are and, for each gate removed, at least one of them fails.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import hazard_table
from hazard_table import TOP, Gate

COPIED = ("HexaFixModule", "Resources", "Testing", "pyproject.toml", "README.md", "LICENSE")
SLOW = ("cli", "export", "markers", "pipeline", "privacy", "report", "selftest", "verify")
"""Folders whose tests plan whole cases, print or fit many balls."""
NO_PROOF = ("ImportError", "NameError", "SyntaxError", "ModuleNotFoundError")
"""A removal that fails with these broke the program instead of taking a gate away."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the removals; the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="rows or gates, e.g. H03 H24.2")
    parser.add_argument("--sample", type=int, help="only so many, drawn by the seed")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--quick", action="store_true", help="only gates with quick tests")
    given = parser.parse_args(arguments)
    gates = chosen(given.names)
    if given.quick:
        gates = [g for g in gates if all(test.split("/")[0] not in SLOW for test in g.tests)]
    if given.sample is not None:
        gates = random.Random(given.seed).sample(gates, min(given.sample, len(gates)))
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "checkout"
        copy_checkout(copy)
        return run(copy, gates)


def chosen(names: Sequence[str]) -> list[Gate]:
    """The gates of the named rows, or the named gates; all without a name."""
    gates = [gate for row in hazard_table.load()[0] for gate in row.gates]
    known = {gate.name for gate in gates} | {gate.row for gate in gates}
    unknown = sorted(set(names) - known)
    if unknown:
        raise SystemExit("no such row or gate: " + ", ".join(unknown))
    return [gate for gate in gates if not names or gate.name in names or gate.row in names]


def copy_checkout(copy: Path) -> None:
    """What the tests need, and the third-party CT where it lies beside the checkout."""
    copy.mkdir()
    for name in COPIED:
        if (TOP / name).is_dir():
            ignore = shutil.ignore_patterns("__pycache__", ".*")
            shutil.copytree(TOP / name, copy / name, ignore=ignore)
        else:
            shutil.copy2(TOP / name, copy / name)
    if (TOP.parent / "shared").is_dir():
        (copy.parent / "shared").symlink_to(TOP.parent / "shared")


class Tests:
    """Pytest in a copy of the checkout, in forks of one process where the system can fork."""

    def __init__(self, copy: Path) -> None:
        self.copy = copy
        # hash-checked byte code: a source changed and put back within a second is noticed
        compiling = [sys.executable, "-m", "compileall", "-q", "--invalidation-mode"]
        compiling += ["checked-hash", str(copy / "HexaFixModule")]
        subprocess.run(compiling, check=True)
        own = {"PYTHONPATH": str(copy / "HexaFixModule"), "COLUMNS": "300"}
        own |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        self.environment = {k: v for k, v in os.environ.items() if k != "HEXAFIX_CI"} | own
        self.server = self._start() if hasattr(os, "fork") else None

    def _start(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name("remove_server.py"))],
            cwd=self.copy,
            env=self.environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Tests:
        return self

    def __exit__(self, *_: object) -> None:
        if self.server is not None:
            with self.server:
                self.server.kill()

    def run(self, tests: Sequence[str], *, first_only: bool = False) -> tuple[int, str]:
        """Exit code and output of pytest on these tests."""
        arguments = ["-q", "-rf", "--tb=no", "-p", "no:cacheprovider"]
        arguments += [*(["-x"] if first_only else []), *(f"Testing/{test}" for test in tests)]
        if self.server is not None and self.server.stdin and self.server.stdout:
            print(json.dumps(arguments), file=self.server.stdin, flush=True)
            answer = json.loads(self.server.stdout.readline())
            return answer["code"], answer["output"]
        done = subprocess.run(
            [sys.executable, "-B", "-m", "pytest", *arguments],
            cwd=self.copy,
            env=self.environment,
            capture_output=True,
            text=True,
            check=False,
        )
        return done.returncode, done.stdout + done.stderr


def run(copy: Path, gates: Sequence[Gate]) -> int:
    """Prove every gate in the copy: in one session what can be, the others one by one."""
    started = time.monotonic()
    with Tests(copy) as tests:
        proved, output = in_one_session(tests, gates)
        if output:
            print(output)
            print("the tests do not pass as they are: nothing is proved")
            return 1
        rest = [gate for gate in gates if gate.name not in proved]
        if rest:
            code, output = tests.run(sorted({test for gate in rest for test in gate.tests}))
            if code != 0:
                print(output)
                print("the tests do not pass as they are: nothing is proved")
                return 1
        for gate in rest:
            why = without(tests, gate)
            print(f"{gate.name:<7} {'UNPROVED: ' + why if why else 'proved by itself'}", flush=True)
            if not why:
                proved.add(gate.name)
    seconds = time.monotonic() - started
    print(f"{len(gates)} gates removed, {len(proved)} proved, {seconds:.0f} s")
    return 0 if len(proved) == len(gates) else 1


def in_one_session(tests: Tests, gates: Sequence[Gate]) -> tuple[set[str], str]:
    """Names of the gates that one pytest session proved, and what failed before any removal."""
    command = [sys.executable, str(Path(__file__).with_name("remove_session.py"))]
    log = tests.copy / "removals.jsonl"
    log.write_text("")
    done = subprocess.run(
        [*command, *(gate.name for gate in gates)],
        cwd=tests.copy,
        env=tests.environment,
        capture_output=True,
        text=True,
        check=False,
    )
    proved: set[str] = set()
    for row in map(json.loads, log.read_text("utf-8").splitlines()):
        if "baseline" in row:
            return set(), "\n".join(row["baseline"])
        failed = [text for text in row["failed"] if text.startswith("call ")]
        if failed and not any(word in failed[0] for word in NO_PROOF):
            proved.add(row["gate"])
            print(f"{row['gate']:<7} proved", flush=True)
    if done.returncode not in (0, 1, 5):
        print(done.stdout[-2000:] + done.stderr[-2000:])
    return proved, ""


def without(tests: Tests, gate: Gate) -> str:
    """Why the gate's removal proves nothing, empty if a test fails without it."""
    file = tests.copy / gate.removal.file
    source = file.read_text("utf-8")
    try:
        file.write_text(gate.removal.applied(source), "utf-8")
        code, output = tests.run(gate.tests, first_only=True)
    finally:
        file.write_text(source, "utf-8")
    failed = re.findall(r"^FAILED .*$", output, re.MULTILINE)
    if code != 1 or not failed:
        return f"pytest ended with {code} and {len(failed)} failed tests"
    broken = [word for word in NO_PROOF if any(f"- {word}" in line for line in failed)]
    return f"the program broke: {failed[0]}" if broken else ""


if __name__ == "__main__":
    sys.exit(main())
