"""HexaFix measured beside what a user would otherwise write, in one run: the benchmark page."""

from __future__ import annotations

import os
import platform
import tempfile
from collections.abc import Collection, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

import hexafix
from hexafix.benchmark import (
    comparison_balls,
    comparison_kinematics,
    comparison_pose,
    comparison_reading,
)
from hexafix.benchmark.comparison_race import Raced, Tool, race
from hexafix.benchmark.run import require_known
from hexafix.libraries import version_of
from hexafix.progress import Progress, silent

SCHEMA_VERSION = 1

Document = dict[str, Any]

GROUPS: dict[str, tuple[ModuleType, str]] = {
    "balls": (comparison_balls, "Finding and fitting marker balls"),
    "pose": (comparison_pose, "Ring pose from ball centres"),
    "kinematics": (comparison_kinematics, "Mechanism pose from strut lengths"),
    "reading": (comparison_reading, "Reading a DICOM series"),
}
"""What is compared, in the order of the page."""

LIMITS = (
    "All images are simulated: aluminium balls, resin rods, Gaussian blur and noise. Nothing here"
    " was measured on a patient.",
    "The machine is shared: seconds change with its load, so ratios of runs next to each other are"
    " what counts; their range is given.",
    "The rivals were written for this comparison as a user would from each library's examples,"
    " with the threshold, the ball's size and its half height told to them. Somebody who tunes one"
    " can make it better.",
    "Memory is the peak of resident memory beyond what was resident, with the data loaded, before"
    " the first run; in the small groups it is next to nothing and not listed.",
)


def compare(
    names: Sequence[str] = (),
    *,
    quick: bool = False,
    seed: int = 0,
    only: Collection[str] | None = None,
    progress: Progress = silent,
) -> Document:
    """Measure the named groups, or all of them.

    Parameters
    ----------
    names : sequence of str
        Of `GROUPS`; empty for all.
    quick : bool
        Small samples and volumes: shows that everything runs, proves little.
    seed : int
        Same seed, same data.
    only : collection of str, optional
        Names of tools; their HexaFix counterparts are added. None: all.
    progress : Progress

    Returns
    -------
    dict
        The JSON document of the page.

    Raises
    ------
    InputError
        If a name is unknown.
    """
    require_known(names, GROUPS, what="comparison")
    load = _load()
    groups = [
        _group(name, quick=quick, seed=seed, only=only, progress=progress)
        for name in names or GROUPS
    ]
    return {
        "schema_version": SCHEMA_VERSION,
        "hexafix": hexafix.__version__,
        "simulated": True,
        "quick": quick,
        "seed": seed,
        "command": _command(names, quick=quick, seed=seed),
        "machine": {
            "system": platform.system(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
            "load_before": load,
            "load_after": _load(),
        },
        "libraries": _libraries(groups),
        "groups": groups,
        "controls": _controls(groups),
        "limits": list(LIMITS),
    }


def _command(names: Sequence[str], *, quick: bool, seed: int) -> str:
    """What to type for the same page."""
    words = ["hexafix benchmark", *names, "--page DIR"]
    words += ["--quick"] if quick else []
    words += [f"--seed {seed}"] if seed else []
    return " ".join(words)


def _load() -> float | None:
    """Processes that waited for a core in the last minute, where the system tells."""
    return round(os.getloadavg()[0], 1) if hasattr(os, "getloadavg") else None


def _libraries(groups: Sequence[Document]) -> dict[str, str]:
    named = {"python": platform.python_version(), "numpy": np.__version__}
    named["scipy"] = version_of("scipy")
    for group in groups:
        for tool in group["tools"]:
            named.update(tool["libraries"])
    return named


def _chosen(tools: Sequence[Tool], only: Collection[str] | None) -> list[Tool]:
    """Tools asked for, and the HexaFix ones they are compared with."""
    if only is None:
        return list(tools)
    wanted = {tool.name for tool in tools if tool.name in only}
    wanted |= {tool.against for tool in tools if tool.name in wanted}
    return [tool for tool in tools if tool.name in wanted]


def _group(
    name: str, *, quick: bool, seed: int, only: Collection[str] | None, progress: Progress
) -> Document:
    module, title = GROUPS[name]
    chosen = _chosen(module.TOOLS, only)
    tools = [tool for tool in chosen if tool.missing is None]
    with tempfile.TemporaryDirectory() as place:
        progress(f"{name}: make data", 0.0)
        data = module.write_data(Path(place), quick=quick, seed=seed)
        raced = race(
            module.__name__, tools, Path(place), rounds=2 if quick else 4, progress=progress
        )
        accuracy = module.judge(raced, Path(place))
    if name == "balls":
        progress("balls: placements", 0.0)
        more = _more_balls([tool.name for tool in tools], data, quick=quick, seed=seed)
        accuracy = {tool: more[tool] + accuracy[tool] for tool in accuracy}
    return {
        "name": name,
        "title": title,
        "data": data,
        "tools": [_row(tool, raced[tool.name], accuracy[tool.name]) for tool in tools],
        "not_measured": [
            {"name": tool.name, "words": tool.words, "missing": tool.missing}
            for tool in chosen
            if tool.missing is not None
        ],
    }


def _more_balls(
    names: Sequence[str], data: Document, *, quick: bool, seed: int
) -> dict[str, list[Document]]:
    """Centre errors over placements and balls missed in other phantoms; counts go into `data`."""
    data["placements"], data["phantoms"] = (4, 0) if quick else (40, 2)
    rows = comparison_balls.centre_errors(names, placements=data["placements"], seed=seed)
    other = comparison_balls.searched(names, phantoms=data["phantoms"], seed=seed)
    return {name: rows[name] + other[name] for name in names}


def _row(tool: Tool, raced: Raced, accuracy: list[Document]) -> Document:
    return {
        "name": tool.name,
        "words": tool.words,
        "against": tool.against,
        "control": tool.control,
        "libraries": tool.versions,
        "seconds": raced.seconds,
        "cpu_seconds": raced.cpu_seconds,
        "ratio": float(np.median(raced.ratios)),
        "ratio_low": float(raced.ratios.min()),
        "ratio_high": float(raced.ratios.max()),
        "cpu_ratio": float(np.median(raced.cpu_ratios)),
        "pairs": len(raced.ratios),
        "peak_mb": raced.peak_mb,
        "accuracy": accuracy,
    }


def _controls(groups: Sequence[Document]) -> list[Document]:
    """Whether a tool made worse on purpose comes out worse: in accuracy, memory and time."""
    found = []
    for group in groups:
        rows = {row["name"]: row for row in group["tools"]}
        for row in group["tools"]:
            if row["control"]:
                found += _control(row, rows[row["against"]], group["data"])
    return found


def _control(row: Document, ours: Document, data: Document) -> list[Document]:
    """The careless HexaFix against HexaFix.

    It rounds to the voxel, holds a copy four times the volume, and works twice.
    """
    checks = []
    for bad, good in zip(row["accuracy"], ours["accuracy"], strict=True):
        if bad["case"] in comparison_balls.QUALITIES and good["rms_3d_mm"] is not None:
            checks.append(
                (f"3D RMS, {bad['case']}", bad["rms_3d_mm"], 2.0 * good["rms_3d_mm"], "mm")
            )
    if row["peak_mb"] is not None:
        least = ours["peak_mb"] + 3.0 * data["voxels_mb"]
        checks.append(("memory", row["peak_mb"], least, "MB"))
    checks.append(("processor time", row["cpu_ratio"], 1.3, "×"))
    return [
        {
            "name": f"{row['name']}: {what}",
            "value": value,
            "at_least": least,
            "unit": unit,
            "told_apart": value is not None and value >= least,
        }
        for what, value, least, unit in checks
    ]
