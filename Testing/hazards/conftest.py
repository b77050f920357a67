"""The modules of this folder as fixtures: tests here are not a package."""

import importlib.util
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).resolve().parent


def load(name):
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, HERE / f"{name}.py")
        sys.modules[name] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(sys.modules[name])
    return sys.modules[name]


@pytest.fixture(scope="session")
def hazard_table():
    """The hazard table as data."""
    return load("hazard_table")


@pytest.fixture(scope="session")
def remove_gate(hazard_table):
    """The tool that removes gates."""
    return load("remove_gate")


@pytest.fixture(scope="session")
def measured():
    """Section 2 of the hazards on points."""
    return load("measured")


@pytest.fixture(scope="session")
def faults(measured):
    """The rows of section 2 by name."""
    return {fault.name: fault for fault in measured.FAULTS}
