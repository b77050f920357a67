"""The page while the workstation starts: it says so, and shows the CT as soon as that is read.

VTK, Slicer and the workstation's page take seconds. Meanwhile a small server on a thread of its own
has the port, so that the browser opens and loads what it can; then the workstation's server takes
the port over, and the page that has waited begins.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from contextlib import suppress
from io import BytesIO
from pathlib import Path
from threading import Lock, Thread
from typing import TYPE_CHECKING, Any

from hexafix.web.page import add_page, policy
from hexafix.web.server import Access, Guard

if TYPE_CHECKING:
    from aiohttp import web

CLOSING_S = 0.2
"""How long requests get to end at the hand-over."""

LOOK_S = 0.05
"""How often a waiting page's request looks for the CT."""

HAND_OVER_MS = 200
"""When the page asks again after the hand-over."""

STATE_NAME = "/starting.json"

READY: Mapping[str, Any] = {"ready": True}
"""What the workstation's own server answers."""


class StartingServer:
    """Serves the waiting page until `close`.

    Parameters
    ----------
    access : Access
        Where to listen and who may ask: the workstation's own rules hold here too.
    folder : Path
        Trame's static folder.
    text : str
        The page.

    Attributes
    ----------
    port : int
        The port that it has.

    Raises
    ------
    OSError
        If it cannot listen there.
    """

    def __init__(self, access: Access, folder: Path, text: str) -> None:
        self.first = FirstPicture()
        self._access, self._folder, self._text = access, folder, text
        self._bound: Future[int] = Future()
        self._thread = Thread(target=self._run, name="hexafix-starting", daemon=True)
        self._thread.start()
        self.port = self._bound.result()

    def close(self) -> None:
        """Give the port free; a second time does nothing."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _run(self) -> None:
        try:
            asyncio.run(self._serve())
        except Exception as error:
            if self._bound.done():
                raise
            self._bound.set_exception(error)

    async def _serve(self) -> None:
        from aiohttp import web

        self._loop, self._end = asyncio.get_running_loop(), asyncio.Event()
        app = web.Application()
        Guard(self._access, policy(self._text)).install(app)
        add_page(app, self._text)
        app.router.add_get(STATE_NAME, self._state)
        app.router.add_get("/starting.png", self._picture)
        app.router.add_static("/", self._folder)
        runner = web.AppRunner(app, access_log=None, shutdown_timeout=CLOSING_S)
        await runner.setup()
        access = self._access
        site = web.TCPSite(runner, access.host, access.port, ssl_context=access.tls)
        try:
            await site.start()
            self._bound.set_result(runner.addresses[0][1])
            await self._end.wait()
        finally:
            await runner.cleanup()

    async def _state(self, request: web.Request) -> web.Response:
        """Answer once there is something new: the picture, or the end."""
        from aiohttp import web

        seen = "seen" in request.query
        state = self.first.state()
        while (seen or not state["picture"]) and not self._end.is_set():
            with suppress(TimeoutError):
                await asyncio.wait_for(self._end.wait(), LOOK_S)
            state = self.first.state()
        if self._end.is_set():
            # The picture could not be fetched any more.
            state = {**state, "picture": "", "wait_ms": HAND_OVER_MS}
        return web.json_response(state)

    async def _picture(self, _: web.Request) -> web.Response:
        from aiohttp import web

        return web.Response(body=self.first.png or b"", content_type="image/png")


class FirstPicture:
    """An axial slice of the CT, made once the CT is there.

    Attributes
    ----------
    png : bytes or None
    place : str
        Where the slice is.
    volume : callable
        The CT, None while it is not read; set by who knows it.
    """

    def __init__(self) -> None:
        self.png: bytes | None = None
        self.place = ""
        self.volume: Callable[[], Any] = lambda: None
        self._lock = Lock()

    def state(self) -> Mapping[str, Any]:
        """What the page shows now."""
        with self._lock:
            if self.png is None and (volume := self.volume()) is not None:
                try:
                    self._make(volume)
                except Exception:
                    # The start goes on without a picture; what is wrong shows in the views.
                    self.volume = lambda: None
        seen = self.png is not None
        text = "The views are being made ready." if seen else "The workstation is starting."
        return {"text": text, "picture": self.place, "wait_ms": 0}

    def _make(self, volume: Any) -> None:
        from PIL import Image

        from hexafix.pipeline.axial_picture import axial_picture

        slice_, file = axial_picture(volume), BytesIO()
        Image.fromarray(slice_.grey).save(file, "PNG")
        self.place = f"Axial slice through the middle of the CT, S {slice_.s_mm:.1f} mm"
        self.png = file.getvalue()


def add_ready(app: web.Application) -> None:
    """Let the workstation's own server tell the waiting page to begin."""
    from aiohttp import web

    async def ready(_: web.Request) -> web.Response:
        return web.json_response(READY)

    app.router.add_get(STATE_NAME, ready)
