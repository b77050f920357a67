"""One pytest session in a copy of the checkout that removes gate after gate in memory.

Run by remove_gate.py with the copy as working folder: the tests are collected and run once as they
are, then again for each gate with its source changed on disk (for child processes) and in the
loaded module. Prints a JSON line for each gate.
"""

from __future__ import annotations

import functools
import importlib
import json
import sys
import types
from pathlib import Path
from typing import Any

import hazard_table
import numpy as np
import pytest
from hazard_table import Gate

ISOLATED = ("cli", "export", "fuzz", "pipeline/test_reproducible", "privacy", "selftest")
"""Tests of whole processes or with results kept from before: proved one by one instead."""

PLAIN = (int, float, str, tuple, frozenset)
"""Values of a module that a removal may change."""


class Removed:
    """A module of the package with a gate removed: changed on disk and, while loaded, in memory."""

    def __init__(self, gate: Gate) -> None:
        self.file = gate.removal.file
        self.source = self.file.read_text("utf-8")
        self.changed = gate.removal.applied(self.source)
        parts = self.file.with_suffix("").relative_to("HexaFixModule").parts
        self.name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)

    def __enter__(self) -> None:
        self._put(self.changed)

    def __exit__(self, *_: object) -> None:
        self._put(self.source)

    def _put(self, source: str) -> None:
        self.file.write_text(source, "utf-8")
        loaded = sys.modules.get(self.name)
        if loaded is None:
            return
        fresh = types.ModuleType(self.name)
        fresh.__dict__.update(__file__=str(self.file), __package__=loaded.__package__)
        # dataclasses look their module up by name
        sys.modules[self.name] = fresh
        try:
            exec(compile(source, str(self.file), "exec"), fresh.__dict__)
        finally:
            sys.modules[self.name] = loaded
        _swap(loaded.__dict__, fresh.__dict__, self.name)


def _swap(old: dict[str, Any], new: dict[str, Any], module: str) -> None:
    """Give the loaded functions the new code, so that whoever imported them has it too."""
    for name, value in new.items():
        known = old.get(name)
        if isinstance(value, type) and isinstance(known, type) and value.__module__ == module:
            _swap(dict(vars(known)), dict(vars(value)), module)
            continue
        now, then = _function(value), _function(known)
        if now is not None and then is not None:
            if now.__module__ == module and now.__code__.co_freevars == then.__code__.co_freevars:
                then.__code__ = now.__code__
        elif not name.startswith("__") and isinstance(value, (*PLAIN, np.ndarray)):
            old[name] = value


def _function(value: Any) -> types.FunctionType | None:
    """The plain function within a property, a method or a cache."""
    if isinstance(value, property):
        value = value.fget
    elif isinstance(value, functools.cached_property):
        value = value.func
    value = getattr(value, "__func__", value)
    value = getattr(value, "__wrapped__", value)
    return value if isinstance(value, types.FunctionType) else None


class Parents:
    """Stands for the test to come: what its parents have set up stays, even if it is the same."""

    def __init__(self, item: pytest.Item | None) -> None:
        self.item = item

    def listchain(self) -> list[pytest.Item | pytest.Collector]:
        """The nodes that stay."""
        return self.item.listchain()[:-1] if self.item is not None else []


class Session:
    """Pytest's loop over the gates."""

    def __init__(self, gates: list[Gate]) -> None:
        self.gates = gates
        self.failed: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Keep what failed; a fixture that fails proves nothing."""
        if report.failed:
            text = str(report.longrepr).strip().splitlines()[-1:] or [""]
            self.failed.append(f"{report.when} {report.nodeid}: {text[0][:200]}")

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """All tests as they are, then those of each gate without it."""
        runs = [[item for item in session.items if _belongs(item, gate)] for gate in self.gates]
        firsts = [Parents(items[0]) for items in runs] + [Parents(None)]
        whole = self._run(session.items, firsts[0])
        if whole:
            self._say(baseline=whole)
            return True
        for gate, items, following in zip(self.gates, runs, firsts[1:], strict=True):
            with Removed(gate):
                failed = self._run(items, following, first_only=True)
            self._say(gate=gate.name, failed=failed)
        return True

    def _run(
        self, items: list[pytest.Item], following: Parents, *, first_only: bool = False
    ) -> list[str]:
        self.failed = []
        for item, upcoming in zip(items, [*map(Parents, items[1:]), following], strict=True):
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=upcoming)
            if self.failed and first_only:
                item.session._setupstate.teardown_exact(following)
                break
        return list(self.failed)

    @staticmethod
    def _say(**words: Any) -> None:
        with Path("removals.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(words) + "\n")


def _belongs(item: pytest.Item, gate: Gate) -> bool:
    test = item.nodeid.removeprefix("Testing/").split("[")[0]
    return test in gate.tests


def quick_tests(gate: Gate) -> tuple[str, ...]:
    """The tests of a gate that one session can repeat."""
    return tuple(test for test in gate.tests if not test.startswith(ISOLATED))


def main(names: list[str]) -> int:
    """Run the session; pytest's exit code."""
    wanted = [g for row in hazard_table.load()[0] for g in row.gates if g.name in names]
    gates = [g for g in wanted if quick_tests(g)]
    tests = sorted({f"Testing/{test}" for gate in gates for test in quick_tests(gate)})
    importlib.invalidate_caches()
    return int(pytest.main(["-q", "--tb=line", "-p", "no:cacheprovider", *tests], [Session(gates)]))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
