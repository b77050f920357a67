"""A child process for libraries that may die of a file: bounded memory, bounded time (H52)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Generator
from pathlib import Path
from threading import Timer
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import ImageRefused

_PACKAGE_PARENT = Path(__file__).resolve().parents[2]
# Each thread of a library reserves address space, which the child's limit would count.
_ONE_THREAD = {
    "OMP_NUM_THREADS": "1",
    "OPENBLAS_NUM_THREADS": "1",
    "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS": "1",
    "MALLOC_ARENA_MAX": "2",
}


def run_isolated(
    task: str, arguments: list[Any], *, memory_bytes: int, seconds: float
) -> Generator[tuple[dict[str, Any], NDArray]]:
    """Results of a task of `hexafix.imaging.worker`, one after the other.

    Close the iterator when it is left early (`contextlib.closing`): that ends the child.

    Parameters
    ----------
    task : str
        ``decode`` or ``itk``.
    arguments : list
        What JSON can hold.
    memory_bytes : int
        Address space the child may use.
    seconds : float
        Wall clock after which the child is killed.

    Yields
    ------
    about : dict
        What the task says about the array.
    array : ndarray

    Raises
    ------
    ImageRefused
        If the task fails, or the child dies or exceeds a limit.
    """
    request = {"task": task, "arguments": arguments, "memory_bytes": memory_bytes}
    process = subprocess.Popen(
        [sys.executable, "-m", "hexafix.imaging.worker"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        env=_environment(),
    )
    timer = Timer(seconds, process.kill)
    timer.daemon = True
    timer.start()
    try:
        with process:
            try:
                yield from _results(process, json.dumps(request).encode(), memory_bytes)
            finally:
                process.kill()
    finally:
        timer.cancel()


def _results(
    process: subprocess.Popen[bytes], request: bytes, memory_bytes: int
) -> Generator[tuple[dict[str, Any], NDArray]]:
    assert process.stdin is not None
    assert process.stdout is not None
    try:
        process.stdin.write(request)
        process.stdin.close()
    except OSError as error:
        raise _died() from error
    while line := process.stdout.readline():
        about = json.loads(line)
        if "error" in about:
            raise ImageRefused.of(
                "corrupt-pixel-data",
                "the pixels of the image cannot be decoded",
                value=about["error"],
                next_step="export the image again, uncompressed if possible",
                hazard="H09",
            )
        array = np.empty(about["shape"], about["dtype"])
        if array.nbytes > memory_bytes or not _read_fully(process.stdout, array):
            raise _died()
        yield about, array
    if process.wait() != 0:
        raise _died()


def _read_fully(stream: IO[bytes], array: NDArray) -> bool:
    rest = array.reshape(-1).view(np.uint8).data
    while len(rest) and (count := stream.readinto(rest)):  # type: ignore[attr-defined]
        rest = rest[count:]
    return len(rest) == 0


def _died() -> ImageRefused:
    return ImageRefused.of(
        "decoder-died",
        "reading the image ended in a crash or exceeded memory or time",
        next_step="export the image again, uncompressed if possible",
        hazard="H52",
    )


def _environment() -> dict[str, str]:
    paths = [str(_PACKAGE_PARENT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return os.environ | _ONE_THREAD | {"PYTHONPATH": os.pathsep.join(paths)}
