"""The child process of `hexafix.imaging.isolation`: decodes what a parent does not dare to."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

Result = tuple[dict[str, Any], NDArray]


def decode(arguments: list[Any]) -> Iterator[Result]:
    """Frames of DICOM files, each given as path, frame index and transfer syntax."""
    from hexafix.imaging.decoding import decode_frame

    for path, frame, transfer_syntax in arguments:
        yield {}, decode_frame(Path(path), frame, transfer_syntax)


def itk(arguments: list[Any]) -> Iterator[Result]:
    """Image files, each given as path and name of ITK's reader, one after the other."""
    from hexafix.imaging.itk_reader import load_with_itk

    for path, reader in zip(arguments[::2], arguments[1::2], strict=True):
        yield load_with_itk(Path(path), reader)


def main() -> None:
    """Serve one request from standard input; results go to standard output."""
    # Libraries print where they like: our channel moves away from their standard output.
    channel = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    request = json.load(sys.stdin)
    _limit_memory(request["memory_bytes"])
    task = {"decode": decode, "itk": itk}[request["task"]]
    try:
        for about, array in task(request["arguments"]):
            _send(channel, about, array)
    except Exception as error:
        # Only the kind of error: its text may hold the path or the header.
        channel.write(json.dumps({"error": type(error).__name__}).encode() + b"\n")
    channel.flush()


def _send(channel: IO[bytes], about: dict[str, Any], array: NDArray) -> None:
    array = np.ascontiguousarray(array)
    head = about | {"shape": array.shape, "dtype": array.dtype.str}
    channel.write(json.dumps(head).encode() + b"\n")
    channel.write(array.reshape(-1).view(np.uint8).data)
    channel.flush()


def _limit_memory(memory_bytes: int) -> None:
    try:
        import resource
    except ImportError:  # not on Windows
        return
    try:
        resource.setrlimit(resource.RLIMIT_AS, (memory_bytes, memory_bytes))
        # A crash of a decoder is a message, not a file as large as the child.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    except (OSError, ValueError, OverflowError):
        # A system that has a lower limit already, or none to set.
        return


if __name__ == "__main__":
    main()
