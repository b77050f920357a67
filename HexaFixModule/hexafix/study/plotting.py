"""How figures look and are saved: matplotlib, loaded only when a figure is drawn."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hexafix.errors import MissingLibrary

BLUE, VERMILLION, GREEN, PINK, ORANGE = "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00"
"""Colours that remain apart for colour-blind readers (Okabe and Ito)."""

INK, GREY, PALE = "#1c2733", "#6b7480", "#c4cad1"

STYLE: dict[Any, Any] = {
    "font.family": "DejaVu Sans",
    "font.size": 8.5,
    "axes.titlesize": 9.5,
    "axes.labelsize": 9,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": "#e3e7eb",
    "grid.linewidth": 0.6,
    "xtick.color": INK,
    "ytick.color": INK,
    "text.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8,
    "hatch.linewidth": 0.5,
    "svg.hashsalt": "hexafix",
    "svg.fonttype": "path",
    "pdf.fonttype": 42,
    "pdf.compression": 6,
    "savefig.dpi": 200,
    "figure.dpi": 100,
}

METADATA: dict[str, dict[str, Any]] = {
    "svg": {"Date": None, "Creator": "HexaFix"},
    "pdf": {"CreationDate": None, "Creator": "HexaFix"},
    "png": {"Software": "HexaFix"},
}
"""No dates, so that the same study gives the same bytes."""


def require_matplotlib() -> None:
    """Refuse early where no figure can be drawn.

    Raises
    ------
    MissingLibrary
        If matplotlib is not installed.
    """
    try:
        import matplotlib  # noqa: F401
    except ImportError as error:
        raise MissingLibrary.of(
            "missing-library",
            "figures need matplotlib",
            where="--out",
            next_step="pip install 'hexafix[study]'",
        ) from error


@contextmanager
def drawing() -> Iterator[None]:
    """The house style for a while, whatever the user's own settings are."""
    require_matplotlib()
    import matplotlib

    with matplotlib.rc_context():
        matplotlib.rcParams.update({**matplotlib.rcParamsDefault, "backend": "agg"})
        matplotlib.rcParams.update(STYLE)
        yield


def new_figure(width_in: float, height_in: float) -> Any:
    """An empty figure that belongs to no window."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def settle(figure: Any) -> Any:
    """Place everything once and hold it: the engine would move it a little at every drawing."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    return figure


def save(figure: Any, path: Path) -> None:
    """Write a figure; the suffix is its format, ``svg``, ``pdf`` or ``png``."""
    with drawing():
        figure.savefig(path, metadata=METADATA[path.suffix[1:]])
