"""The simulated experiment as a figure: volume errors above, error budget below."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hexafix.study.experiment import ExperimentStudy
from hexafix.study.experiment_chain import (
    ALONE,
    FOUR,
    HAND_MM,
    MOTOR_MM,
    OURS,
    PAPER,
    Way,
)
from hexafix.study.experiment_goals import (
    FUSED_DEG,
    FUSED_MM,
    RECOGNITION_DEG,
    RECOGNITION_MM,
    budgets,
)
from hexafix.study.experiment_statistics import TABLE_1
from hexafix.study.plotting import (
    BLUE,
    GREEN,
    GREY,
    INK,
    ORANGE,
    PINK,
    VERMILLION,
    drawing,
    new_figure,
    settle,
)

Array = NDArray[np.float64]

SOURCE_COLOURS = dict(zip(ALONE, (PINK, ORANGE, BLUE, GREEN), strict=True))

BUDGETED = (
    ("paper's chain,\nmotor", Way(PAPER, "additive", MOTOR_MM)),
    ("HexaFix,\nmotor", Way(OURS, "calibrated", MOTOR_MM)),
    ("paper's chain,\nby hand", Way(PAPER, "additive", HAND_MM)),
    ("HexaFix,\nby hand", Way(OURS, "calibrated", HAND_MM)),
)
"""Bars of the budget."""


def experiment_figure(study: ExperimentStudy) -> Any:
    """Volume errors of recognition and plan above, error budget of the reduced bones below."""
    with drawing():
        figure = new_figure(7.2, 6.4)
        axes = figure.subplots(2, 2, height_ratios=(1.15, 1.0))
        for k, (unit, word) in enumerate((("mm", "position"), ("°", "orientation"))):
            _errors_panel(axes[0, k], study, k)
            axes[0, k].set_title(f"({'ab'[k]}) mechanism's pose, {word}", loc="left",
                                 fontweight="bold")  # fmt: skip
            _budget_panel(axes[1, k], study, k)
            axes[1, k].set_title(f"({'cd'[k]}) bones reduced, {word}", loc="left",
                                 fontweight="bold")  # fmt: skip
            for axis in axes[:, k]:
                axis.set_ylabel(f"volume error ({unit})")
        figure.legend(*_legend(), loc="outside lower center", ncols=4, columnspacing=1.6)
        figure.suptitle("Simulated experiment", fontsize=10, color=GREY)
        return settle(figure)


def _groups(study: ExperimentStudy) -> list[tuple[str, Array, Array, str]]:
    """Name, vectors of the poses with CT, of the drawn poses, and colour of each column."""
    found = []
    for name, pick, colour in (
        ("paper's\nchain", lambda o: o.recognised[PAPER], VERMILLION),
        ("HexaFix", lambda o: o.recognised[OURS], BLUE),
        ("HexaFix\nN = 4", lambda o: o.recognised[FOUR], BLUE),
        ("fused,\nmotor", lambda o: o.compensated[Way(OURS, "calibrated", MOTOR_MM)], GREEN),
        ("fused,\nby hand", lambda o: o.compensated[Way(OURS, "calibrated", HAND_MM)], GREEN),
    ):
        both = [
            np.array([pick(pose["all"]) for pose in run.poses])
            for run in (study.rendered, study.drawn)
        ]
        found.append((name, both[0], both[1], colour))
    return found


def _errors_panel(axis: Any, study: ExperimentStudy, k: int) -> None:
    scale = (1.0, 180.0 / np.pi)[k]
    rows = slice(3 * k, 3 * k + 3)
    groups = _groups(study)
    beside = np.random.default_rng(0).uniform(-0.22, 0.22, len(study.rendered.poses))
    for place, (_, few, many, colour) in enumerate(groups, start=1):
        volume = np.linalg.norm(few[:, rows], axis=1) * scale
        axis.plot(place + beside, volume, marker="o", markersize=3.2, linestyle="none",
                  color=colour, alpha=0.75, markeredgewidth=0)  # fmt: skip
        mean = float(np.linalg.norm(many[:, rows], axis=1).mean()) * scale
        axis.plot([place - 0.33, place + 0.33], [mean, mean], color=INK, linewidth=1.6)
    if TABLE_1.volume is not None:
        mean, spread = TABLE_1.volume[2 * k : 2 * k + 2]
        axis.errorbar([0], [mean], [spread], color=GREY, marker="*", markersize=10,
                      markerfacecolor="white", markeredgecolor=INK, capsize=2.5,
                      elinewidth=0.9)  # fmt: skip
    for limit, start, end in (
        ((RECOGNITION_MM, RECOGNITION_DEG)[k], 0.5, 3.5),
        ((FUSED_MM, FUSED_DEG)[k], 3.5, 5.5),
    ):
        axis.plot([start, end], [limit, limit], color=INK, linewidth=1.0, linestyle=(0, (1, 1.5)))
    axis.set_xticks(range(6), ["printed,\nphysical", *(name for name, *_ in groups)], fontsize=7)
    axis.set_xlim(-0.6, 5.6)
    axis.set_ylim(bottom=0.0)
    axis.grid(axis="y")


def _budget_panel(axis: Any, study: ExperimentStudy, k: int) -> None:
    found = {budget.way: budget for budget in budgets(study.drawn) if budget.name == "after"}
    width = 0.19
    for place, (_, way) in enumerate(BUDGETED):
        budget = found[way]
        for s, source in enumerate(ALONE):
            at = place + (s - 1.5) * width
            axis.bar(at, budget.alone[source][k], 0.92 * width, color=SOURCE_COLOURS[source])
        total = float(budget.together[k])
        axis.plot([place - 2 * width, place + 2 * width], [total, total], color=INK, linewidth=1.6)
    axis.set_xticks(range(len(BUDGETED)), [name for name, _ in BUDGETED], fontsize=7)
    axis.set_ylim(bottom=0.0)
    axis.grid(axis="y")


def _legend() -> tuple[list[Any], list[str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [Patch(color=colour) for colour in SOURCE_COLOURS.values()]
    handles += [
        Line2D([], [], marker="o", markersize=3.6, linestyle="none", color=GREY),
        Line2D([], [], color=INK, linewidth=1.6),
        Line2D([], [], color="white", marker="*", markersize=9, markeredgecolor=INK),
        Line2D([], [], color=INK, linewidth=1.0, linestyle=(0, (1, 1.5))),
    ]
    words = [f"{source} alone" for source in SOURCE_COLOURS]
    words += ["one pose with CT", "mean, drawn poses", "printed ± SD", "goal"]
    return handles, words
