"""How quick the workstation is here: ``hexafix serve CASE --measure``."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path
from threading import Thread
from typing import Any

from hexafix.web.ahead import hurry
from hexafix.web.run import prepare_environment
from hexafix.web.starting import FirstPicture

VIEW_PX = (512, 512)
"""Size of the measured view."""

SLICES = 60
"""Slices scrolled through."""

ASKED_S = 0.1
"""How often the page asks for the first picture while the workstation starts."""

GOALS = {"first_picture_s": 5.0, "axial_scroll_ms": 30.0}
"""What HexaFix promises for 512×512×400."""


def measure(case: Path) -> dict[str, Any]:
    """Time a start without browser: the first picture, the views, and then slice by slice.

    Parameters
    ----------
    case : Path
        Case file; its CT is read.

    Returns
    -------
    dict
        ``image``: size; ``first_picture_s``: from here to the slice that the waiting page shows,
        as a PNG; ``views_s``: to a rendered and encoded slice of the axial view (a process needs
        about 0.3 s before both); ``axial_scroll_ms``: of each slice, what resampling, rendering
        and encoding took; ``view_px``: size of the view.
    """
    prepare_environment()
    return asyncio.run(_measure(case, time.perf_counter()))


async def _measure(case: Path, started: float) -> dict[str, Any]:
    from hexafix.presenter import Step
    from hexafix.web.app import start_workstation

    first, has_started = FirstPicture(), hurry()
    seen: list[float] = []
    page = Thread(target=_ask, args=(first, seen), daemon=True)
    page.start()
    workstation = start_workstation(case, first=first)
    presenter = workstation.presenter
    try:
        while presenter.value(Step.LOAD) is None and presenter.snapshot.busy:
            await asyncio.sleep(0.005)
        view: Any = workstation.app.view_manager.get_view("Red")
        view.update_size(*VIEW_PX)
        view.fit_view_to_content()
        picture = Picture(view, workstation.state)
        picture.take()
        views = time.perf_counter() - started
        has_started()
        times = [picture.scroll_ms(k) for k in range(SLICES)]
        volume = presenter.value(Step.LOAD)
        if volume is not None:
            page.join()
        return {
            "image": list(volume.size_ijk) if volume is not None else None,
            "first_picture_s": seen[0] - started if seen else None,
            "views_s": views,
            "axial_scroll_ms": times,
            "view_px": list(VIEW_PX),
        }
    finally:
        workstation.close()


def _ask(first: FirstPicture, seen: list[float]) -> None:
    """Ask for the picture as the page does."""
    while first.png is None:
        first.state()
        time.sleep(ASKED_S)
    seen.append(time.perf_counter())


class Picture:
    """A slice view's picture as it goes to the browser.

    Parameters
    ----------
    view : SliceView
    state : trame_server.state.State
    """

    def __init__(self, view: Any, state: Any) -> None:
        from trame_rca.encoders import RcaImageEncoder
        from trame_slicer.rca_view.rca_view_factory import RcaWindow

        from hexafix.web.views import ENCODING

        self._view = view
        self._window = RcaWindow(view.render_window(), state, "views_measured_cursor")
        self._encoder = RcaImageEncoder(ENCODING["rca_encoder"])
        self._quality = ENCODING["interactive_quality"]

    def take(self) -> bytes:
        """Render and encode."""
        pixels, columns, rows = self._window.img_cols_rows
        return self._encoder.encode(pixels, columns, rows, self._quality)[0]

    def scroll_ms(self, k: int) -> float:
        """Go to the k-th of `SLICES` from the middle on; how long its picture took."""
        low, high = self._view.get_slice_range()
        place = (low + high) / 2 + k * self._view.get_slice_step()
        began = time.perf_counter()
        self._view.set_slice_value(place)
        self.take()
        return 1000 * (time.perf_counter() - began)
