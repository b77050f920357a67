"""Libraries with a fault, here and in the child processes that read images."""

import os

import pytest
from hexafix.selftest import run, run_self_test


@pytest.fixture
def not_yet_passed(monkeypatch):
    """Nothing has passed in this process, and what passes in the test is forgotten after it."""
    monkeypatch.setattr(run, "_passed_with", set())


@pytest.fixture
def failed():
    """Names of the checks that fail now."""
    return lambda **options: {o.check.name for o in run_self_test(**options) if not o.passed}


@pytest.fixture
def in_every_child(monkeypatch, tmp_path_factory):
    """Runs Python code at the start of every child process: `in_every_child("import ...")`."""

    def sabotage(code):
        folder = tmp_path_factory.mktemp("sabotage")
        (folder / "sitecustomize.py").write_text(code)
        paths = [str(folder), *filter(None, [os.environ.get("PYTHONPATH")])]
        monkeypatch.setenv("PYTHONPATH", os.pathsep.join(paths))

    return sabotage


@pytest.fixture
def mirrors():
    """Code that lets SimpleITK turn the stack over without a word, as some versions did."""
    return """
import SimpleITK
read = SimpleITK.GetArrayFromImage
SimpleITK.GetArrayFromImage = lambda image: read(image)[::-1]
"""
