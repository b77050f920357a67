"""Lint and format hold over the whole tree."""

import subprocess
import sys
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("arguments", [["check"], ["format", "--check"]], ids=["lint", "format"])
def test_ruff_finds_no_fault(arguments):
    run = subprocess.run(
        [sys.executable, "-m", "ruff", *arguments, "--no-cache", str(TOP)],
        capture_output=True,
        text=True,
        check=False,
        cwd=TOP,
    )
    assert run.returncode == 0, run.stdout + run.stderr


def test_no_committed_file_names_a_registry_or_an_address_of_a_lock():
    for name in ("requirements.lock", "requirements-workstation.lock", "requirements-test.lock"):
        assert "://" not in (TOP / name).read_text()


def test_the_licence_is_whole():
    text = (TOP / "LICENSE").read_text()
    assert "Apache License" in text
    assert "END OF TERMS AND CONDITIONS" in text
