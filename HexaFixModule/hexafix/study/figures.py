"""Figures 5, 6 and 7 of the paper, from our own numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.recognition.rigid import MIN_TRIANGLE_HEIGHT_MM, triangle_heights_mm
from hexafix.study.angles import AnglesStudy
from hexafix.study.estimates import volumes
from hexafix.study.layouts import PAPER_RADIUS_MM
from hexafix.study.number import NumberStudy
from hexafix.study.plotting import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PALE,
    PINK,
    VERMILLION,
    drawing,
    new_figure,
    settle,
)
from hexafix.study.verdicts import EQUATION_26

Array = NDArray[np.float64]

PARTS = (
    ("(a) position", "mm", slice(0, 3), "xyz", 1.0),
    ("(b) orientation", "°", slice(3, 6), "αβγ", 180.0 / np.pi),
)
"""Title, unit, rows of ΔX, names and scale of both halves of a figure."""

COLOURS = (BLUE, VERMILLION, GREEN)
DASHES = (0, (4, 2))


def figure_5(study: NumberStudy) -> Any:
    """Expected errors against the number of markers, one panel for position and orientation.

    Lines are exact, points sampled with two standard errors, stars printed.
    """
    with drawing():
        figure = new_figure(7.2, 3.6)
        axes = figure.subplots(1, 2)
        for axis, (title, unit, rows, names, scale) in zip(axes, PARTS, strict=True):
            _number_panel(axis, study, rows, names, scale)
            axis.set_title(title, loc="left", fontweight="bold")
            axis.set_ylabel(f"expected |error| ({unit})")
            axis.set_xlabel("number of markers N, evenly around the ring")
        figure.legend(*_number_legend(), loc="outside lower center", ncols=6, columnspacing=1.6)
        return settle(figure)


def _number_panel(axis: Any, study: NumberStudy, rows: slice, names: str, scale: float) -> None:
    counts = np.array(list(study.by_count))
    found = list(study.by_count.values())
    exact = np.array([e.exact[0][:, rows] for e in found]) * scale  # (counts, methods, 3)
    sampled = np.array([e.sampled.mean[0, 0, rows] for e in found]) * scale
    error = np.array([e.sampled.standard_error[0, 0, rows] for e in found]) * scale
    printed = [value for _, value, _ in EQUATION_26][rows]
    points = {"linestyle": "none", "markersize": 3.6, "elinewidth": 0.8, "capsize": 1.5}
    star = {"marker": "*", "markersize": 9, "color": "white", "linestyle": "none"}
    for q, (colour, mark) in enumerate(zip(COLOURS, "osD", strict=True)):
        beside = 0.16 * (q - 1)  # x and y coincide: their points stand side by side
        width = (2.8, 1.1, 1.6)[q]  # and their lines one on the other
        axis.plot(counts, exact[:, 0, q], color=colour, linewidth=width)
        axis.plot(counts, exact[:, 1, q], color=colour, linewidth=0.8 * width, linestyle=DASHES)
        axis.errorbar(
            counts + beside, sampled[:, q], 2 * error[:, q], color=colour, marker=mark, **points
        )
        axis.plot([2.58 + beside], [printed[q]], markeredgecolor=INK, zorder=4, **star)
    axis.set_ylim(0.0, 1.12 * max(sampled.max(), *printed))
    axis.set_xticks(counts)
    axis.set_xlim(2.2, counts[-1] + 0.4)
    axis.grid(axis="y")
    for q, name in ((0, f"{names[0]}, {names[1]}"), (2, names[2])):
        at = (counts[-1], exact[-1, 0, q])
        near = {"xytext": (8, 0), "textcoords": "offset points", "va": "center"}
        axis.annotate(name, at, color=GREEN if q == 2 else INK, fontweight="bold", **near)


def _number_legend() -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=colour, marker=mark, markersize=3.6, linestyle="none")
        for colour, mark in zip(COLOURS, "osD", strict=True)
    ]
    handles += [
        Line2D([], [], color=GREY, linewidth=1.4),
        Line2D([], [], color=GREY, linewidth=1.2, linestyle=DASHES),
        Line2D([], [], color="white", marker="*", markersize=9, markeredgecolor=INK),
    ]
    return handles, ["x, α", "y, β", "z, γ", "groups", "least squares", "printed, Eq. (26)"]


def figure_6(study: AnglesStudy) -> Any:
    """Volume errors over the included angles, one panel for position and orientation."""
    levels = ((0.3, 0.4, 0.6, 0.9), (0.2, 0.3, 0.4, 0.6))
    with drawing():
        figure = new_figure(7.2, 3.5)
        axes = figure.subplots(1, 2, sharey=True)
        for axis, lines, (title, unit, _, _, scale) in zip(axes, levels, PARTS, strict=True):
            values = volumes(study.found.exact[:, 0])[int(unit == "°")] * scale
            drawn = _map(axis, study, values, lines)
            axis.set_title(title, loc="left", fontweight="bold")
            axis.set_xlabel("included angle Δφ₁ (°)")
            beside = axis.inset_axes((1.03, 0.0, 0.04, 1.0))
            bar = figure.colorbar(drawn, cax=beside, extend="max")
            bar.set_label(f"expected volume error ({unit})")
            ticks = [lines[0] * k for k in (1, 2, 4, 8)]
            bar.set_ticks(ticks, labels=[f"{t:.1f}" for t in ticks], minor=False)
            bar.minorticks_off()
        axes[0].set_ylabel("included angle Δφ₂ (°)")
        figure.legend(*_map_legend(), loc="outside lower center", ncols=4)
        return settle(figure)


def _map(axis: Any, study: AnglesStudy, values: Array, levels: tuple[float, ...]) -> Any:
    """One panel: colours and contours of the volume error, the rules as outlines."""
    from matplotlib.colors import LogNorm

    step = study.step_deg
    count = 360 // step
    gaps = np.rint(np.degrees(study.found.layouts.included_angles_rad) / step).astype(int)
    grid = np.full((count, count), np.nan)
    grid[gaps[:, 1], gaps[:, 0]] = values
    edges = (np.arange(count + 1) - 0.5) * step
    norm = LogNorm(levels[0] * 0.85, levels[0] * 10)
    drawn = axis.pcolormesh(edges, edges, grid, norm=norm, cmap="cividis", rasterized=True)
    at = np.arange(count) * step
    lines = axis.contour(at, at, np.log(grid), np.log(levels), colors="white", linewidths=0.7,
                         linestyles="solid")  # fmt: skip
    names = {np.log(level): f"{level:g}" for level in levels}
    axis.clabel(lines, fmt=names, fontsize=7)
    fine = np.arange(1, 360, dtype=float)
    first, second = np.meshgrid(fine, fine)
    for margin, style in ((_preferred_margin, "solid"), (_relaxed_margin, "dashed")):
        axis.contour(fine, fine, margin(first, second), [0.0], colors=VERMILLION, linewidths=1.3,
                     linestyles=style)  # fmt: skip
    flat = np.where(first + second < 360, _height_mm(first, second), np.nan)
    axis.contourf(fine, fine, flat, [0.0, MIN_TRIANGLE_HEIGHT_MM], colors="none",
                  hatches=["/////"])  # fmt: skip
    axis.plot([120], [120], marker="*", markersize=9, color="white", markeredgecolor=INK)
    axis.set(xlim=(0, 360), ylim=(0, 360), xticks=range(0, 361, 60), yticks=range(0, 361, 60))
    axis.set_aspect("equal")
    return drawn


def _map_legend() -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles = [
        Line2D([], [], color=VERMILLION, linewidth=1.3),
        Line2D([], [], color=VERMILLION, linewidth=1.3, linestyle="dashed"),
        Patch(facecolor="none", edgecolor=INK, hatch="/////", linewidth=0.5),
        Line2D([], [], color="white", marker="*", markersize=9, markeredgecolor=INK),
    ]
    words = ["45° rule", "relaxed rule", "refused: flatter than 10 mm", "120/120/120, the best"]
    return handles, words


def _sorted_gaps(first_deg: Array, second_deg: Array) -> Array:
    return np.sort(np.stack([first_deg, second_deg, 360.0 - first_deg - second_deg]), axis=0)


def _preferred_margin(first_deg: Array, second_deg: Array) -> Array:
    """Positive where the 45° rule holds."""
    return _sorted_gaps(first_deg, second_deg)[0] - 45.0


def _relaxed_margin(first_deg: Array, second_deg: Array) -> Array:
    """Positive where the relaxed rule holds."""
    smallest, median, largest = _sorted_gaps(first_deg, second_deg)
    return np.minimum(smallest - 15.0, 150.0 - (largest - median))


def _height_mm(first_deg: Array, second_deg: Array) -> Array:
    """Smallest height of the triangle of markers, mm."""
    phi = np.radians(np.stack([np.zeros_like(first_deg), first_deg, first_deg + second_deg], -1))
    corners = PAPER_RADIUS_MM * np.stack([np.cos(phi), np.sin(phi), np.zeros_like(phi)], -1)
    return triangle_heights_mm(corners)


def figure_7(study: AnglesStudy) -> Any:
    """Volume errors of the layouts sorted by minimum, median and maximum included angle."""
    limits = ((0.9, 1.0), (0.6, 0.8))
    with drawing():
        figure = new_figure(7.2, 5.4)
        axes = figure.subplots(2, 1, sharex=True)
        for axis, lines, colour, (title, unit, _, _, scale) in zip(
            axes, limits, (BLUE, PINK), PARTS, strict=True
        ):
            values = volumes(study.found.sampled.mean[:, 0])[int(unit == "°")] * scale
            _scatter(axis, study, values, colour)
            _limit_lines(axis, study, values, lines, unit)
            axis.set_title(title, loc="left", fontweight="bold")
            axis.set_ylabel(f"expected volume error ({unit})")
        axes[1].set_xlabel(
            "minimum included angle (°), at the left of its block; layouts sorted by minimum,"
            " median, maximum"
        )
        return settle(figure)


def _scatter(axis: Any, study: AnglesStudy, values: Array, colour: str) -> None:
    from matplotlib.ticker import FuncFormatter

    place = np.arange(len(values))
    chosen = study.selections
    for shown, face, size, words in (
        (~chosen["relaxed"] & ~chosen["preferred"], PALE, 3.0, "neither rule"),
        (chosen["relaxed"] & ~chosen["preferred"], GREY, 3.0, "relaxed rule"),
        (chosen["preferred"], colour, 4.0, "45° rule"),
    ):
        axis.scatter(place[shown], values[shown], s=size, color=face, linewidths=0, label=words,
                     rasterized=True)  # fmt: skip
    axis.set_yscale("log")
    bounds = axis.get_ylim()
    steps = [m * 10.0**e for e in range(-1, 3) for m in (1, 2, 5)]
    axis.set_yticks([y for y in steps if bounds[0] <= y <= bounds[1]])
    axis.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.minorticks_off()
    axis.grid(axis="y")
    smallest = np.round(np.degrees(study.found.layouts.included_angles_rad.min(axis=1)), 6)
    starts = {angle: int(np.argmax(smallest == angle)) for angle in np.unique(smallest)}
    shown = [a for a in starts if a <= 50 or a in (60, 70, 80, 90, 105)]
    axis.set_xticks([starts[a] for a in shown], [f"{a:g}" for a in shown])
    axis.set_xlim(-15, len(values) + 15)
    legend = axis.legend(loc="upper right", ncols=3, markerscale=2.5, handletextpad=0.2)
    legend.set_rasterized(False)


def _limit_lines(
    axis: Any, study: AnglesStudy, values: Array, limits: tuple[float, float], unit: str
) -> None:
    """The paper's printed limits over the layouts they are about, and the worst of those."""
    space = "" if unit == "°" else " "
    count = len(study.found.layouts)
    for rule, limit, colour, words, place in (
        ("relaxed", limits[1], INK, "printed for the relaxed rule", (0.3, 0.78)),
        ("preferred", limits[0], VERMILLION, "printed for the 45° rule", (0.6, 0.58)),
    ):
        chosen = study.selections[rule]
        first = int(np.argmax(chosen))
        axis.plot([first, count], [limit, limit], color=colour, linewidth=1.1, zorder=1)
        style = {"color": colour, "fontsize": 7.5}
        up = rule == "relaxed"
        axis.annotate(f"{limit:g}{space}{unit} {words}", (count, limit), ha="right",
                      va="bottom" if up else "top", xytext=(0, 2.5 if up else -2.5),
                      textcoords="offset points", **style)  # fmt: skip
        worst = int(np.argmax(np.where(chosen, values, 0.0)))
        gaps = np.degrees(np.sort(study.found.layouts.included_angles_rad[worst]))
        name = "/".join(f"{gap:.0f}" for gap in gaps)
        leader = {"arrowstyle": "-", "color": colour, "linewidth": 0.7}
        axis.annotate(f"{name}: {values[worst]:.2f}{space}{unit}", (worst, values[worst]),
                      xytext=place, textcoords="axes fraction", arrowprops=leader,
                      **style)  # fmt: skip
