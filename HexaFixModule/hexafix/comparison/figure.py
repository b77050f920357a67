"""The comparison's picture: error, time and memory of the finders, time of the other groups."""

from __future__ import annotations

from typing import Any

from hexafix.benchmark.comparison import Document
from hexafix.benchmark.comparison_balls import QUALITIES
from hexafix.study.plotting import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    VERMILLION,
    drawing,
    new_figure,
    settle,
)

MARKS = ("o", "s", "^")
SHADES = (BLUE, VERMILLION, GREEN)
"""Form and colour of each image quality: either tells it."""

OURS, OTHERS, CONTROL = BLUE, ORANGE, GREY


def draw(document: Document) -> Any:
    """Draw the document; groups that were not measured are left out.

    Returns
    -------
    matplotlib Figure

    Raises
    ------
    MissingLibrary
        If matplotlib is not installed.
    """
    groups = {group["name"]: group for group in document["groups"]}
    balls = groups.pop("balls", None)
    with drawing():
        heights = ([len(balls["tools"]) + 2.5] if balls else []) + ([8.0] if groups else [])
        figure = new_figure(9.6, 0.34 * sum(heights) + 0.4)
        rows = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
        if balls:
            _finders(rows[0], balls)
        if groups:
            axes = rows[-1].subplots(1, len(groups), squeeze=False)[0]
            for axis, group in zip(axes, groups.values(), strict=True):
                _times(axis, group["tools"])
                axis.set_title(f"{group['title']}:\ntime over HexaFix's", loc="left")
                _name_tools(axis, group["tools"])
        return settle(figure)


def _finders(figure: Any, group: Document) -> None:
    """Three panels that share their tools."""
    errors, times, memory = figure.subplots(1, 3, sharey=True)
    tools = group["tools"]
    for number, (quality, mark) in enumerate(zip(QUALITIES, MARKS, strict=True)):
        points = [
            (case["rms_3d_mm"], place)
            for place, row in enumerate(tools)
            for case in row["accuracy"]
            if case["case"] == quality and case["rms_3d_mm"] is not None
        ]
        errors.plot(
            [x for x, _ in points],
            [y for _, y in points],
            mark,
            color=SHADES[number],
            markersize=5,
            label=quality,
        )
    errors.set_xscale("log")
    _plain_numbers(errors)
    errors.set_title("3D RMS error of a ball's centre, mm", loc="left")
    errors.grid(axis="x", which="major")
    errors.legend(loc="lower left", ncols=1, title="image")
    _times(times, tools)
    times.set_title("Time over HexaFix's", loc="left")
    told = [
        (row["peak_mb"], place) for place, row in enumerate(tools) if row["peak_mb"] is not None
    ]
    for value, place in told:
        memory.barh(place, value, height=0.55, color=_colour(tools[place]))
        memory.annotate(
            f"{value:.0f}", (value, place), (3, 0), textcoords="offset points", va="center"
        )
    memory.margins(x=0.15)
    memory.set_title("Memory beyond the volume, MB", loc="left")
    _name_tools(errors, tools)
    for axis in (times, memory):
        axis.tick_params(axis="y", length=0)


def _times(axis: Any, tools: list[Document]) -> None:
    """Median and range of the paired ratios, each with its number."""
    axis.axvline(1.0, color=INK, linewidth=0.8, linestyle=(0, (4, 3)))
    for place, row in enumerate(tools):
        shade = _colour(row)
        axis.plot([row["ratio_low"], row["ratio_high"]], [place, place], color=shade, linewidth=2.5,
                  solid_capstyle="butt", alpha=0.6)  # fmt: skip
        axis.plot(row["ratio"], place, "D", color=shade, markersize=4.5)
        axis.annotate(
            f"{row['ratio']:.2g}×",
            (row["ratio"], place),
            (0, 6),
            textcoords="offset points",
            ha="center",
            fontsize=7,
            bbox={"boxstyle": "square,pad=0.05", "facecolor": "white", "edgecolor": "none"},
        )
    axis.set_xscale("log")
    axis.margins(x=0.12)
    _plain_numbers(axis)
    axis.grid(axis="x", which="major")


def _plain_numbers(axis: Any) -> None:
    """Ticks as 0.1, 1, 10 and not as powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 3.0), numticks=8))
    axis.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.xaxis.set_minor_formatter(NullFormatter())


def _name_tools(axis: Any, tools: list[Document]) -> None:
    """The tools' names down the side, the first on top."""
    axis.set_yticks(range(len(tools)), [_label(row) for row in tools])
    axis.set_ylim(len(tools) - 0.4, -0.7)
    axis.tick_params(axis="y", length=0)


def _label(row: Document) -> str:
    return f"control: {row['name']}" if row["control"] else row["name"]


def _colour(row: Document) -> str:
    """Ours, a rival's or the control's; the names beside say the same."""
    if row["control"]:
        return CONTROL
    return OURS if row["name"].startswith("hexafix") else OTHERS
