"""A child process for libraries that may die of a file: bounded memory, bounded time (H52)."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Timer
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from hexafix.errors import ImageRefused

_PACKAGE_PARENT = Path(__file__).resolve().parents[2]
_MAX_LINE = 1 << 20
# What Linux allows to everybody.
_PIPE_BYTES = 1 << 20
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
        Wall clock that the child may take for each result, and for coming to its end, before it
        is killed. What the caller does between results does not count.

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
    with process:
        try:
            _widen(process)
            with _killed_after(seconds, process):
                _send(process, json.dumps(request).encode())
            while True:
                with _killed_after(seconds, process):
                    result = _receive(process, memory_bytes)
                if result is None:
                    return
                yield result
        finally:
            process.kill()


def _widen(process: subprocess.Popen[bytes]) -> None:
    """Fewer, larger reads: each waits for the interpreter lock, which other threads may hold."""
    with suppress(ImportError, AttributeError, OSError):  # other systems, or a user's limit
        import fcntl

        fcntl.fcntl(process.stdout, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)  # type: ignore[arg-type]


@contextmanager
def _killed_after(seconds: float, process: subprocess.Popen[bytes]) -> Iterator[None]:
    timer = Timer(seconds, process.kill)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _send(process: subprocess.Popen[bytes], request: bytes) -> None:
    assert process.stdin is not None
    try:
        process.stdin.write(request)
        process.stdin.close()
    except OSError as error:
        raise _died() from error


def _receive(
    process: subprocess.Popen[bytes], memory_bytes: int
) -> tuple[dict[str, Any], NDArray] | None:
    """The next result; None when the child has ended as it should."""
    assert process.stdout is not None
    line = process.stdout.readline(_MAX_LINE)
    if not line:
        if process.wait() != 0:
            raise _died()
        return None
    try:
        about = json.loads(line)
        error = about.get("error")
        shape = [0] if error else [int(side) for side in about["shape"]]
        dtype = np.dtype(about.get("dtype", "u1"))
        size = math.prod(shape) * dtype.itemsize if min(shape, default=0) >= 0 else -1
    except (ValueError, TypeError, KeyError, AttributeError):
        raise _died() from None
    if error:
        raise ImageRefused.of(
            "corrupt-pixel-data",
            "the pixels of the image cannot be decoded",
            value=str(error),
            next_step="export the image again, uncompressed if possible",
            hazard="H09",
        )
    if not 0 <= size <= memory_bytes or dtype.hasobject:
        raise _died()
    array = np.empty(shape, dtype)
    if not _read_fully(process.stdout, array):
        raise _died()
    return about, array


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
