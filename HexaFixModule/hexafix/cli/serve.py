"""The ``serve`` command: the workstation in the browser."""

from __future__ import annotations

import os
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hexafix.errors import InputError, MissingLibrary


def serve(
    case: Annotated[
        Path | None, Parameter(help="The case file, or a scene (.mrb); none: an empty case.")
    ] = None,
    *,
    host: Annotated[
        str, Parameter(help="Address to listen on; any but this machine's own needs --token.")
    ] = "127.0.0.1",
    port: Annotated[int, Parameter(help="Port to listen on; 0: any free one.")] = 0,
    token: Annotated[
        str | None,
        Parameter(help="Secret that the browser must bring; auto, and without --host: a new one."),
    ] = None,
    certificate: Annotated[
        Path | None, Parameter(help="PEM file; with --key, the connection is encrypted.")
    ] = None,
    key: Annotated[Path | None, Parameter(help="PEM file of the certificate's key.")] = None,
    no_browser: Annotated[bool, Parameter(negative="", help="Only print the address.")] = False,
    measure: Annotated[
        bool,
        Parameter(negative="", help="Serve nothing; print how long start and scrolling take here."),
    ] = False,
) -> int:
    """Open the workstation in the browser; it serves this machine only and ends by Ctrl-C."""
    from hexafix.web.server import access, is_loopback

    allowed = access(host=host, port=port, token=token, certificate=certificate, key=key)
    if case is not None and not case.is_file():
        raise InputError.of(
            "case-missing",
            "there is no such case file",
            where=str(case),
            next_step="name a case.json, or leave it out and load a CT in the workstation",
        )
    if find_spec("trame_slicer") is None:
        raise MissingLibrary.of(
            "library-missing",
            "the workstation needs trame-slicer",
            next_step="install hexafix[workstation]",
        )
    if measure:
        return _measure(case)
    from hexafix.web.run import serve as run

    if not is_loopback(host) and allowed.tls is None:
        print(
            "hexafix: others can reach this address and nothing on the way is encrypted: add "
            "--certificate and --key, or leave --host out and use an SSH tunnel",
            file=sys.stderr,
        )

    def ready(url: str) -> None:
        print(url, flush=True)
        if not no_browser and has_screen():
            import threading
            import webbrowser

            threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()

    run(case, allowed, ready=ready)
    return 0


def has_screen() -> bool:
    """Whether a browser would open in a window: one in the terminal would hold the server up."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _measure(case: Path | None) -> int:
    """Median and 95 % of what `hexafix.web.measure` timed, as JSON; 0 if both goals are met."""
    import statistics

    from hexafix.cli.console import print_json
    from hexafix.web.measure import GOALS
    from hexafix.web.measure import measure as times_of

    if case is None:
        raise InputError.of(
            "case-missing",
            "there is nothing to measure without a case",
            where="--measure",
            next_step="name a case.json whose CT has the size you want to know about",
        )
    found = times_of(case)
    if found["image"] is None:
        raise InputError.of(
            "nothing-measured",
            "the CT of the case was not read",
            where="--measure",
            next_step="leave --measure out: the workstation says why",
        )
    times = found["axial_scroll_ms"]
    document = {
        **found,
        "first_picture_s": round(found["first_picture_s"], 2),
        "views_s": round(found["views_s"], 2),
        "axial_scroll_ms": round(statistics.median(times), 1),
        "axial_scroll_p95_ms": round(statistics.quantiles(times, n=20)[-1], 1),
        "goals": GOALS,
    }
    print_json(document)
    return 0 if all(document[name] <= goal for name, goal in GOALS.items()) else 1
