"""The whole chain measured on a DICOM folder as a user would bring it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from hexafix.benchmark.balls import varied_spec
from hexafix.benchmark.reading import simpleitk_series
from hexafix.imaging import read_volume
from hexafix.phantom import PhantomSpec, make_phantom, write_phantom


def plan_time(*, seed: int = 1, rounds: int = 3, quick: bool = False) -> dict[str, Any]:
    """Time of ``hexafix plan`` beyond reading, and of reading beside SimpleITK's series reader.

    Parameters
    ----------
    seed : int
    rounds : int
        Every figure is the best of so many, in turn.
    quick : bool
        A small volume, for a first look.

    Returns
    -------
    dict
        ``phantom_s``, ``plan_s``, ``import_s`` (starting Python and importing the chain),
        ``read_s``, ``beyond_reading_s``, ``simpleitk_read_s``, ``reading_ratio``.
    """
    import numpy as np

    spec = PhantomSpec(seed=seed)
    if quick:
        spec = varied_spec(np.random.default_rng(seed), seed)
    start = time.perf_counter()
    phantom = make_phantom(spec)
    built = time.perf_counter() - start
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_phantom(phantom, folder / "case")
        size = phantom.spec.size_ijk
        del phantom
        ours, theirs, plans = [], [], []
        for turn in range(rounds):
            ours.append(_timed(lambda: read_volume(folder / "case" / "ct")))
            theirs.append(_timed(lambda: simpleitk_series(folder / "case" / "ct")))
            command = [sys.executable, "-m", "hexafix", "plan", str(folder / "case")]
            command += ["--out", str(folder / f"out-{turn}"), "--quiet"]
            plans.append(_timed(lambda: _run(command)))  # noqa: B023 - called at once
        imports = min(_timed(lambda: _run([sys.executable, "-c", "import hexafix.pipeline"]))
                      for _ in range(rounds))  # fmt: skip
    return {
        "size_ijk": list(size),
        "phantom_s": built,
        "plan_s": min(plans),
        "import_s": imports,
        "read_s": min(ours),
        "beyond_reading_s": min(plans) - min(ours),
        "simpleitk_read_s": min(theirs),
        "reading_ratio": min(ours) / min(theirs),
    }


def help_time(rounds: int = 7) -> dict[str, float]:
    """Time of ``hexafix --help``, whole process, best of `rounds`, with Python's own start."""
    helps = [_timed(lambda: _run([sys.executable, "-m", "hexafix", "--help"]))
             for _ in range(rounds)]  # fmt: skip
    bare = [_timed(lambda: _run([sys.executable, "-c", "pass"])) for _ in range(rounds)]
    return {"help_s": min(helps), "python_s": min(bare)}


def _timed(work: Any) -> float:
    start = time.perf_counter()
    work()
    return time.perf_counter() - start


def _run(command: list[str]) -> None:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    subprocess.run(command, check=True, env=environment, stdout=subprocess.DEVNULL)
