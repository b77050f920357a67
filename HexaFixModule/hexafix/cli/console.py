"""What the command line shows: progress and faults on stderr, results on stdout."""

from __future__ import annotations

import json
import logging
import os
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cyclopts import (
    CoercionError,
    CycloptsError,
    MissingArgumentError,
    UnknownCommandError,
    UnusedCliTokensError,
)

from hexafix.errors import HexaFixError, InputError, Refused
from hexafix.progress import Progress, silent


@contextmanager
def progress_bar(*, quiet: bool) -> Iterator[Progress]:
    """Progress on stderr: a bar on a terminal, one line a step elsewhere."""
    if quiet:
        yield silent
    elif sys.stderr.isatty():
        from rich.console import Console
        from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
        from rich.progress import Progress as Bars

        columns = (TextColumn("{task.description:<28}"), BarColumn(), TimeElapsedColumn())
        with Bars(*columns, console=Console(stderr=True)) as bars:
            tasks: dict[str, Any] = {}

            def draw(step: str, fraction: float) -> None:
                if step not in tasks:
                    tasks[step] = bars.add_task(step, total=1.0)
                bars.update(tasks[step], completed=fraction)

            yield draw
    else:
        seen: set[str] = set()

        def line(step: str, fraction: float) -> None:
            if step not in seen:
                seen.add(step)
                print(f"hexafix: {step} ...", file=sys.stderr, flush=True)

        yield line


def print_json(document: Any) -> None:
    """One JSON document on stdout and nothing else."""
    json.dump(document, sys.stdout, indent=2, allow_nan=False, ensure_ascii=False)
    sys.stdout.write("\n")


@contextmanager
def quiet_libraries() -> Iterator[None]:
    """Let no library warn or log past us: such texts quote header values and paths (H51)."""
    logging.getLogger().addHandler(logging.NullHandler())
    with warnings.catch_warnings():
        if not (os.environ.get("HEXAFIX_DEBUG") or sys.warnoptions):
            warnings.simplefilter("ignore")
        yield


def command_line_error(error: CycloptsError) -> InputError:
    """A wrong command line, told without quoting it: what was typed may be a private path."""
    command = " ".join(["hexafix", *(error.command_chain or ())])
    step = f"see {command} --help"
    match error:
        case MissingArgumentError():
            what = str(error).rstrip(".")
        case UnknownCommandError():
            what, step = "there is no such command", "see hexafix --help"
        case CoercionError(argument=argument) if argument is not None:
            what = f"{argument.name} does not take this value"
        case UnusedCliTokensError():
            what = f"{command} takes fewer arguments; a path with spaces needs quotes"
        case _:
            what = f"{command} does not take these options"
    return InputError.of("command-line", what, next_step=step)


def report_error(error: HexaFixError, *, as_json: bool) -> int:
    """Show every fault; return the exit code."""
    head = "refused, nothing was written" if isinstance(error, Refused) else "not done"
    for fault in error.faults:
        mark = f"[{fault.hazard}] " if fault.hazard else ""
        print(f"hexafix: {head}: {mark}{fault.message}", file=sys.stderr)
    if as_json:
        key = "refused" if isinstance(error, Refused) else "errors"
        print_json({key: [fault.as_json() for fault in error.faults]})
    return error.exit_code
