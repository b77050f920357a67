"""Start the workstation, say where it is, and end it cleanly."""

from __future__ import annotations

import asyncio
import ctypes
import os
import signal
import socket
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.errors import InputError
from hexafix.web.ahead import hurry
from hexafix.web.server import Access, Guard, add_downloads

if TYPE_CHECKING:
    from hexafix.web.starting import StartingServer

SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""What ends the workstation."""

CLOSING_S = 3.0
"""How long clients get to say goodbye."""


def prepare_environment() -> None:
    """Keep foreign settings out: trame and wslink listen to the environment and to `sys.argv`."""
    for name in [n for n in os.environ if n.startswith(("TRAME_", "WSLINK_"))]:
        del os.environ[name]
    os.environ["TRAME_ARGS"] = ""
    draw_without_screen()


def draw_without_screen() -> None:
    """Have VTK draw in memory if Mesa can; a choice made in the environment stays."""
    if not sys.platform.startswith("linux") or "VTK_DEFAULT_OPENGL_WINDOW" in os.environ:
        return
    for name in ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so"):
        with suppress(OSError):
            ctypes.CDLL(name)
            os.environ["VTK_DEFAULT_OPENGL_WINDOW"] = "vtkOSOpenGLRenderWindow"
            return


def serve(case: Path | None, access: Access, *, ready: Callable[[str], Any]) -> None:
    """Serve the workstation until it is interrupted.

    Parameters
    ----------
    case : Path or None
        Case file to open.
    access : Access
        Where to listen and who may ask.
    ready : callable
        Called once with the address to open: at once, while the workstation is still starting.
    """
    prepare_environment()
    require_free(access)
    with suppress(KeyboardInterrupt):
        asyncio.run(_serve(case, access, ready, has_started=hurry()))
    print("hexafix: the workstation has ended", file=sys.stderr)


def require_free(access: Access) -> None:
    """Refuse an address that cannot be had, before anything is loaded for it."""
    try:
        family = socket.getaddrinfo(access.host, access.port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as trial:
            if os.name == "posix":
                trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            trial.bind((access.host, access.port))
    except OSError as error:
        raise address_not_free(access, error) from error


def address_not_free(access: Access, error: OSError) -> InputError:
    """The address may be taken, or not this machine's."""
    return InputError.of(
        "address-not-free",
        f"the server cannot listen there: {error.strerror or 'the address is not ours'}",
        value=f"{access.host}:{access.port}",
        where="--port",
        next_step="leave --host and --port out: any free port is taken",
    )


async def _serve(
    case: Path | None,
    access: Access,
    ready: Callable[[str], Any],
    *,
    has_started: Callable[[], Any],
) -> None:
    from hexafix.web.app import start_workstation

    folder, text = trame_page()
    with starting(access, folder, text) as waiting:
        with interruptible():
            if waiting is not None:
                access = replace(access, port=waiting.port)
                ready(access.url(access.port))
            workstation = start_workstation(case, first=waiting.first if waiting else None)
        stop = asyncio.Event()
        with suppress(NotImplementedError):
            for name in SIGNALS:
                asyncio.get_running_loop().add_signal_handler(name, stop.set)
        server = workstation.server

        def bind(bound: Any) -> None:
            guard(bound, access, workstation, text)
            if waiting is not None:
                waiting.close()

        def begin(**_: Any) -> None:
            if waiting is None:
                ready(access.url(server.port))
            has_started()

        server.controller.on_server_bind.add(bind)
        server.controller.on_server_ready.add(begin)
        running = asyncio.ensure_future(start(server, access))
        stopped = asyncio.ensure_future(stop.wait())
        try:
            await asyncio.wait({running, stopped}, return_when=asyncio.FIRST_COMPLETED)
            if running.done():
                running.result()
        except OSError as error:
            raise address_not_free(access, error) from error
        finally:
            await _end(workstation, running, stopped)


@contextmanager
def interruptible() -> Iterator[None]:
    """Let a signal end what keeps the event loop from running; the loop would only note it."""

    def end(*_: Any) -> None:
        raise KeyboardInterrupt

    before = {name: signal.signal(name, end) for name in SIGNALS}
    try:
        yield
    finally:
        for name, handler in before.items():
            signal.signal(name, handler)


def trame_page() -> tuple[Path, str]:
    """Trame's static folder, and its page as we serve it."""
    from trame_client.module import vue3

    from hexafix.web.page import index_text

    folder = Path(vue3.www)
    return folder, index_text(folder)


@contextmanager
def starting(access: Access, folder: Path, text: str) -> Iterator[StartingServer | None]:
    """Serve the waiting page meanwhile; None where trame's page is not one that can wait."""
    from hexafix.web.page import waits
    from hexafix.web.starting import StartingServer

    if not waits(text):
        yield None
        return
    try:
        server = StartingServer(access, folder, text)
    except OSError as error:
        raise address_not_free(access, error) from error
    try:
        yield server
    finally:
        server.close()


def start(server: Any, access: Access) -> Any:
    """Trame's own start, bound to our host and to nothing of the environment."""
    return server.start(
        port=access.port,
        host=access.host,
        backend="aiohttp",
        exec_mode="coroutine",
        thread=True,
        open_browser=False,
        show_connection_info=False,
        disable_logging=True,
        follow_symlinks=False,
        timeout=0,
    )


def guard(bound: Any, access: Access, workstation: Any, text: str) -> None:
    """Guard, page and downloads before trame's own routes, and encryption if it is asked for."""
    from hexafix.web.page import add_page, policy
    from hexafix.web.starting import add_ready

    app = bound.app
    if access.tls is not None:
        bound.config["ssl"] = access.tls
    Guard(access, policy(text)).install(app)
    add_page(app, text)
    add_ready(app)
    add_downloads(app, workstation.panel.downloads)


async def _end(workstation: Any, running: Any, stopped: Any) -> None:
    workstation.close()
    with suppress(Exception):
        await asyncio.wait_for(workstation.server.stop(), CLOSING_S)
    for task in (running, stopped):
        task.cancel()
