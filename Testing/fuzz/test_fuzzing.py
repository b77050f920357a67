"""Thousands of spoiled files: each is refused, or read as what it says; the program lives."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

CAMPAIGN = Path(__file__).with_name("campaign.py")
MUTANTS, SEED = 2000, 20261201


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    out = tmp_path_factory.mktemp("fuzz") / "report.json"
    command = [sys.executable, str(CAMPAIGN), "--mutants", str(MUTANTS), "--seed", str(SEED)]
    subprocess.run([*command, "--out", str(out)], check=False, stdout=subprocess.DEVNULL)
    return json.loads(out.read_text())


def test_no_mutant_is_read_wrong_and_none_kills_the_program(report):
    assert report["defects"] == []


def test_every_mutant_came_to_its_end(report):
    assert report["mutants"] == report["asked"] >= 2000


def test_every_seed_was_both_read_and_refused(report):
    for name, counts in report["seeds"].items():
        assert {"loaded", "refused"} <= set(counts), name
    assert len(report["seeds"]) == 32


def test_mutants_reach_many_refusals(report):
    reached = set(report["refused_by_code"])
    assert len(reached) >= 30
    assert {"bad-codestream", "truncated-pixel-data", "no-geometry", "missing-slice"} <= reached
