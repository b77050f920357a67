"""What an import brings with it, seen in a process of its own."""

import subprocess
import sys
from pathlib import Path

import pytest

MODULE = Path(__file__).resolve().parents[2] / "HexaFixModule"


@pytest.fixture(scope="session")
def modules_after():
    """`modules_after(code)`: names of all packages that are loaded once it has run."""

    def run(code):
        listing = f"{code}\nimport sys\nprint(*sorted({{m.split('.')[0] for m in sys.modules}}))"
        done = subprocess.run(
            [sys.executable, "-c", listing],
            capture_output=True,
            text=True,
            check=True,
            env={"PYTHONPATH": str(MODULE), "PATH": ""},
        )
        return set(done.stdout.split())

    return run
