"""Tools raced against each other: each in its own process, in turns, on the same data."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import HexaFixError
from hexafix.libraries import version_of
from hexafix.progress import Progress, silent


@dataclass(frozen=True)
class Tool:
    """One way to do a group's task.

    Attributes
    ----------
    name : str
        Stable kebab-case name.
    words : str
    against : str
        Name of the HexaFix tool that does the same work; its own name if it is one.
    run : callable
        The work that is timed: what `prepare` gave to a result.
    digest : callable
        The result as one array of numbers, kept for the judgement of accuracy; not timed.
    prepare : callable
        A folder of data to what the tool's user would hold in memory; not timed.
    libraries : tuple of (str, str)
        Module to import and name of the distribution, of every library beyond HexaFix's own.
    control : bool
        Whether the tool is no rival but there to show that the comparison can tell tools apart.
    """

    name: str
    words: str
    against: str
    run: Callable[[Any], Any]
    digest: Callable[[Any], NDArray[np.float64]]
    prepare: Callable[[Path], Any]
    libraries: tuple[tuple[str, str], ...] = ()
    control: bool = False

    @property
    def missing(self) -> str | None:
        """The first library that is not installed, or None."""
        return next((dist for name, dist in self.libraries if find_spec(name) is None), None)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of the tool's libraries."""
        return {dist: version_of(dist) for _, dist in self.libraries}


@dataclass(frozen=True, eq=False)
class Raced:
    """What one tool took.

    Attributes
    ----------
    seconds, cpu_seconds : float
        Median of the wall clock and of the processor time of all threads.
    ratios, cpu_ratios : ndarray, shape (rounds,)
        Of each pair: this tool over the HexaFix tool that ran just before it.
    peak_mb : float or None
        Greatest resident memory of the first run beyond what was resident before it; None where
        the system does not tell.
    result : ndarray
        What `Tool.digest` kept of the last run.
    """

    seconds: float
    cpu_seconds: float
    ratios: NDArray[np.float64]
    cpu_ratios: NDArray[np.float64]
    peak_mb: float | None
    result: NDArray[np.float64]


class _Child:
    """A process that holds one tool and its data, and runs when asked."""

    def __init__(self, module: str, tool: str, folder: Path) -> None:
        command = [sys.executable, "-m", "hexafix.benchmark.comparison_race"]
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
        self.tool = tool
        self.process = subprocess.Popen(
            [*command, module, tool, str(folder)],
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def answer(self) -> dict[str, Any]:
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        if not line:
            raise HexaFixError.of(
                "benchmark-child",
                "a tool's process of the comparison ended early",
                value=self.tool,
                next_step="read what it wrote to standard error",
            )
        return json.loads(line)

    def run(self) -> dict[str, Any]:
        assert self.process.stdin is not None
        self.process.stdin.write("run\n")
        self.process.stdin.flush()
        return self.answer()

    def close(self) -> None:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        self.process.stdin.close()
        self.process.wait()
        self.process.stdout.close()


def race(
    module: str,
    tools: Sequence[Tool],
    folder: Path,
    *,
    rounds: int,
    progress: Progress = silent,
) -> dict[str, Raced]:
    """Run every tool in its own process, in turns, each right after its HexaFix counterpart.

    Parameters
    ----------
    module : str
        Module whose ``TOOLS`` the children take their tool from.
    tools : sequence of Tool
        Installed ones; the counterparts among them.
    folder : Path
        The group's data.
    rounds : int
        Pairs of each tool, after one run that counts for memory only.
    progress : Progress
    """
    children: dict[str, _Child] = {}
    try:
        for tool in tools:
            children[tool.name] = _Child(module, tool.name, folder)
        for child in children.values():
            child.answer()
        first = {name: child.run() for name, child in children.items()}
        pairs: dict[str, list[tuple[dict[str, Any], dict[str, Any]]]] = {t.name: [] for t in tools}
        for turn in range(rounds):
            for number, tool in enumerate(tools):
                progress("race tools", (turn + number / len(tools)) / rounds)
                ours = children[tool.against].run()
                pairs[tool.name].append((children[tool.name].run(), ours))
    finally:
        for child in children.values():
            child.close()
    return {
        tool.name: _raced(pairs[tool.name], first[tool.name], folder / f"{tool.name}.npy")
        for tool in tools
    }


def _raced(
    pairs: list[tuple[dict[str, Any], dict[str, Any]]], first: dict[str, Any], kept: Path
) -> Raced:
    def ratios(key: str) -> NDArray[np.float64]:
        return np.array([tool[key] / max(ours[key], 1e-9) for tool, ours in pairs])

    return Raced(
        seconds=float(np.median([tool["seconds"] for tool, _ in pairs])),
        cpu_seconds=float(np.median([tool["cpu_seconds"] for tool, _ in pairs])),
        ratios=ratios("seconds"),
        cpu_ratios=ratios("cpu_seconds"),
        peak_mb=first["peak_mb"],
        result=np.load(kept),
    )


def _resident_mb(key: str) -> float | None:
    """``VmHWM`` (peak) or ``VmRSS`` (now) of this process, MB; None where Linux is not there."""
    status = Path("/proc/self/status")
    if not status.exists():
        return None
    line = next(x for x in status.read_text().splitlines() if x.startswith(key))
    return int(line.split()[1]) / 1024


def _forget_peak() -> None:
    """Let VmHWM begin anew at what is resident now; where that is not allowed, it stays."""
    try:
        Path("/proc/self/clear_refs").write_text("5")
    except OSError:
        return


def _child(module: str, name: str, folder: Path) -> None:
    """Serve one tool: a line in, a measured run, a line out."""
    tool = next(tool for tool in import_module(module).TOOLS if tool.name == name)
    state = tool.prepare(folder)
    gc.collect()
    print(json.dumps({"ready": name}), flush=True)
    peak = None
    for turn, _ in enumerate(sys.stdin):
        if turn == 0:
            _forget_peak()
        before = _resident_mb("VmRSS")
        wall, cpu = time.perf_counter(), time.process_time()
        result = tool.run(state)
        seconds, cpu_seconds = time.perf_counter() - wall, time.process_time() - cpu
        if turn == 0 and before is not None:
            peak = max((_resident_mb("VmHWM") or before) - before, 0.0)
        np.save(folder / f"{name}.npy", tool.digest(result))
        del result
        gc.collect()
        found = {"seconds": seconds, "cpu_seconds": cpu_seconds, "peak_mb": peak}
        print(json.dumps(found), flush=True)


if __name__ == "__main__":
    _child(sys.argv[1], sys.argv[2], Path(sys.argv[3]))
