"""The schema of the comparison's document."""

import json
import math

import pytest
from hexafix.benchmark.comparison import SCHEMA_VERSION

TOP = {"schema_version", "hexafix", "simulated", "quick", "seed", "command", "machine",
       "libraries", "groups", "controls", "limits"}  # fmt: skip
GROUP = {"name", "title", "data", "tools", "not_measured"}
TOOL = {"name", "words", "against", "control", "libraries", "seconds", "cpu_seconds", "ratio",
        "ratio_low", "ratio_high", "cpu_ratio", "pairs", "peak_mb", "accuracy"}  # fmt: skip
CONTROL = {"name", "value", "at_least", "unit", "told_apart"}


@pytest.fixture(scope="session")
def check_schema():
    """Asserts that a document has every key and no other, and that every number is finite."""
    return _check


def _check(document):
    """Every key and no other, every number finite, HexaFix beside every rival."""
    assert set(document) == TOP
    assert document["schema_version"] == SCHEMA_VERSION
    assert set(document["machine"]) == {"system", "processor", "cores", "load_before", "load_after"}
    for group in document["groups"]:
        assert set(group) == GROUP
        names = {row["name"] for row in group["tools"]}
        cases = [[case["case"] for case in row["accuracy"]] for row in group["tools"]]
        assert all(one == cases[0] and one for one in cases)
        for row in group["tools"]:
            assert set(row) == TOOL
            assert row["against"] in names
            assert 0.0 < row["ratio_low"] <= row["ratio"] <= row["ratio_high"] < math.inf
            assert row["seconds"] > 0.0
            assert row["pairs"] >= 1
            assert row["peak_mb"] is None or row["peak_mb"] >= 0.0
    for control in document["controls"]:
        assert set(control) == CONTROL
    json.dumps(document, allow_nan=False)
