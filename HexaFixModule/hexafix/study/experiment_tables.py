"""The simulated experiment beside the paper's tables: for a terminal and as a page."""

from __future__ import annotations

import numpy as np

from hexafix.study.experiment import ExperimentStudy, Run
from hexafix.study.experiment_chain import (
    ALONE,
    FOUR,
    HAND_MM,
    MOTOR_MM,
    OURS,
    PAPER,
    ROADS,
    WAYS,
    Road,
    Way,
)
from hexafix.study.experiment_document import NOT_SIMULATED, settings_document
from hexafix.study.experiment_floor import floor_document, installation_floor
from hexafix.study.experiment_goals import budgets, goals
from hexafix.study.experiment_statistics import (
    TABLE_1,
    TABLE_2,
    TABLE_2_BEFORE,
    Printed,
    Summary,
)
from hexafix.study.tables import Cells, markdown, plain

HEAD = ["row", "statistic", "x mm", "y mm", "z mm", "α °", "β °", "γ °", "all mm", "all °"]
FIT_WORDS = {"isosurface": "isosurface + sphere", "rays": "gradient rays"}
METHOD_WORDS = {"groups": "groups", "least-squares": "least squares"}
MODE_WORDS = {
    "none": "none",
    "additive": "additive, Eq. (32)",
    "fused": "fused",
    "calibrated": "fused, mechanism's error known",
}


def road_words(road: Road) -> str:
    """A road for people."""
    return f"{FIT_WORDS[road.fit]}, {METHOD_WORDS[road.method]}, N = {road.markers}"


def chain_words(road: Road) -> str:
    """A chain for people, shorter."""
    names = {PAPER: "the paper's chain", OURS: "HexaFix", FOUR: "HexaFix, N = 4"}
    return names[road]


def printed_rows(table: Printed) -> Cells:
    """A printed table's rows; its last columns are the volume errors or the pooled figures."""
    name = f"paper, physical ({table.source})"
    rows = [[name, "range", *_ranges(table.low, table.high), "", ""]]
    pair = table.volume or table.pooled
    if table.mean is not None and table.deviation is not None and pair is not None:
        mean = [f"{v:.3f}" for v in (*table.mean, pair[0], pair[2])]
        spread = [f"{v:.3f}" for v in (*table.deviation, pair[1], pair[3])]
        rows += [[name, "mean", *mean], [name, "SD", *spread]]
    return rows


def summary_rows(name: str, found: Summary, *, volume: bool) -> Cells:
    """Rows as the paper prints them; at the end the volume errors or the pooled figures."""
    both = (
        (found.volume_mean, found.volume_deviation)
        if volume
        else (found.pooled_mean, found.pooled_deviation)
    )
    return [
        [name, "range", *_ranges(found.low, found.high), "", ""],
        [name, "mean", *(f"{v:.3f}" for v in (*found.mean, *both[0]))],
        [name, "SD", *(f"{v:.3f}" for v in (*found.deviation, *both[1]))],
    ]


def _ranges(low: object, high: object) -> list[str]:
    pairs = zip(np.asarray(low), np.asarray(high), strict=True)
    return [f"{a:.2f} to {b:.2f}" for a, b in pairs]


def table_1_cells(run: Run) -> Cells:
    """Table 1 beside ours, N = 3; the head first."""
    cells = [HEAD, *printed_rows(TABLE_1)]
    paper = Way(PAPER, "additive", MOTOR_MM)
    measured = "simulated: the paper's chain against the struts, as the paper measured"
    cells += summary_rows(measured, run.measured(paper), volume=True)
    for road in (PAPER, OURS):
        name = f"simulated: {chain_words(road)} against the truth"
        cells += summary_rows(name, run.recognised(road), volume=True)
    for scale in (MOTOR_MM, HAND_MM):
        way = Way(OURS, "calibrated", scale)
        name = f"simulated: HexaFix, struts read to {scale:g} mm fused in"
        cells += summary_rows(name, run.compensated(way), volume=True)
    return cells


def table_2_cells(run: Run) -> Cells:
    """Table 2 beside ours, N = 3; the head first."""
    cells = [HEAD, *printed_rows(TABLE_2_BEFORE)]
    before = run.before()
    cells.append(["simulated, before", "range", *_ranges(before.low, before.high), "", ""])
    cells += printed_rows(TABLE_2)
    for way in (
        Way(PAPER, "additive", MOTOR_MM),
        Way(OURS, "calibrated", MOTOR_MM),
        Way(PAPER, "additive", HAND_MM),
        Way(OURS, "calibrated", HAND_MM),
    ):
        name = f"simulated, after: {chain_words(way.road)}, struts {way.scale_mm:g} mm"
        cells += summary_rows(name, run.after(way), volume=False)
    return cells


def _volumes(found: Summary) -> list[str]:
    return [
        f"{mean:.3f} ± {spread:.3f}"
        for mean, spread in zip(found.volume_mean, found.volume_deviation, strict=True)
    ]


def _with_error(found: Summary) -> list[str]:
    return [
        f"{mean:.4f} ({error:.4f})"
        for mean, error in zip(found.volume_mean, found.volume_error, strict=True)
    ]


def recognition_cells(study: ExperimentStudy) -> Cells:
    """Volume errors of every road in both runs; the head first."""
    cells = [["balls and rings", f"{study.settings.poses} CTs: mm", "°",
              f"{study.settings.drawn} drawn: mm (s.e.)", "° (s.e.)"]]  # fmt: skip
    for road in ROADS:
        figures = _volumes(study.rendered.recognised(road))
        cells.append([road_words(road), *figures, *_with_error(study.drawn.recognised(road))])
    return cells


def correction_cells(study: ExperimentStudy) -> Cells:
    """Volume errors of every way, planned and executed, in both runs; the head first."""
    cells = [["chain", "compensation", "struts mm", "run", "start mm", "start °", "reduced mm",
              "reduced °"]]  # fmt: skip
    for way in WAYS:
        name = [chain_words(way.road), MODE_WORDS[way.mode], f"{way.scale_mm:g}"]
        for run, words, figures in (
            (study.rendered, f"{study.settings.poses} CTs", _volumes),
            (study.drawn, f"{study.settings.drawn} drawn", _with_error),
        ):
            cells.append([*name, words, *figures(run.compensated(way)), *figures(run.after(way))])
    return cells


QUANTITY_WORDS = {
    "recognised": "recognised pose",
    "compensated": "pose planned from",
    "after": "bones reduced",
}


def budget_cells(run: Run) -> Cells:
    """Mean volume errors with one source at a time, and its share; the head first."""
    cells = [["quantity", "chain", "compensation", "struts mm", "unit",
              *ALONE, "root sum of squares", "all (s.e.)"]]  # fmt: skip
    for budget in budgets(run):
        way = budget.way
        if budget.name == "recognised":
            name = [QUANTITY_WORDS[budget.name], chain_words(way.road), "-", "-"]
        else:
            name = [QUANTITY_WORDS[budget.name], chain_words(way.road), MODE_WORDS[way.mode],
                    f"{way.scale_mm:g}"]  # fmt: skip
        for k, unit in enumerate(("mm", "°")):
            parts = [budget.alone[source][k] for source in ALONE]
            shares = [budget.shares[source][k] for source in ALONE]
            cells.append(
                [*name, unit,
                 *(f"{part:.3f} ({share:.0%})" for part, share in zip(parts, shares, strict=True)),
                 f"{np.sqrt(np.sum(np.square(parts))):.3f}",
                 f"{budget.together[k]:.3f} ({budget.error[k]:.4f})"]
            )  # fmt: skip
    return cells


def goal_cells(study: ExperimentStudy) -> Cells:
    """Goals and what bounds them; the head first."""
    cells = [["goal", "limit", f"{study.settings.poses} CTs",
              f"{study.settings.drawn} drawn (s.e.)", "reached: CTs", "drawn",
              "largest part"]]  # fmt: skip
    for goal in goals(study):
        unit = "°" if goal.unit == "deg" else " mm"
        cells.append(
            [goal.name, f"{goal.limit:g}{unit}", f"{goal.rendered:.4f}",
             f"{goal.drawn:.4f} ({goal.drawn_error:.4f})",
             *("yes" if met else "no" for met in goal.met.values()), goal.bound]
        )  # fmt: skip
    return cells


def floor_cells() -> Cells:
    """The floor that the installation error sets, by the distance of the rings; the head first."""
    cells = [["rings apart mm", "mean volume error mm", "°"]]
    for row in floor_document():
        cells.append([f"{row['ring_distance_mm']:g}", f"{row['volume_mean_mm']:.4f}",
                      f"{row['volume_mean_deg']:.4f}"])  # fmt: skip
    return cells


COARSE = (
    "The largest part is that of the error budget. A coarse scale costs twice: by its own"
    " rounding, and by the installation error that such readings are too weak to reduce."
)

TITLE = "Tables 1 and 2 re-enacted on simulated CT (Section 5.2)"


def experiment_heading(study: ExperimentStudy) -> list[str]:
    """Sentences on what was simulated."""
    s = settings_document(study)
    floor = installation_floor(s["ct_ring_distance_mm"])
    errors = "; ".join(
        f"{FIT_WORDS[fit]} {error.rms_mm:.4f} mm (worst {error.worst_mm:.3f}, mean along the"
        f" rod {error.bias_mm[2]:+.4f} mm)"
        for fit, error in study.image.items()
    )
    return [
        "All our figures are simulated; the paper's are physical experiments.",
        f"{s['poses']} poses through a whole rendered CT each (voxels {s['voxel_mm']:g} mm, as the"
        f" paper prints no voxel size; blur {s['psf_sigma_mm']:g} mm, noise {s['noise_hu']:g} HU,"
        f" streaks {s['streak_hu']:g} HU), every ball searched and numbered; beside them"
        f" {s['drawn']} poses without CT, image errors drawn from those measured on the CTs;"
        f" seed {s['seed']}.",
        f"Installation {s['installation_sigma_mm']:.4f} mm an axis, mechanism"
        f" {s['mechanism_sigma_mm']:g} mm and {s['mechanism_sigma_deg']:g}° an axis (standard"
        f" deviations), struts read and set to {MOTOR_MM:g} mm (motor; the paper prints no step)"
        f" or {HAND_MM:g} mm (by hand).",
        f"Rings {s['reduced_ring_distance_mm']:g} mm apart with the bones reduced, on average"
        f" {s['ct_ring_distance_mm']:.0f} mm in the CT: the paper prints no distance; this one was"
        f" chosen because there the installation error alone gives the {floor[0]:.3f} mm and"
        f" {np.degrees(floor[1]):.3f}° that the goals assume as their floor. Farther apart the"
        " floor is higher, see below.",
        "N = 3: even markers of Section 4.3.1. They cannot number themselves: a fourth ball on"
        " each ring does, and makes N = 4.",
        f"Ball centres, 3D RMS error: {errors}.",
        "Not simulated: " + "; ".join(NOT_SIMULATED) + ".",
    ]


def _sections(study: ExperimentStudy) -> list[tuple[str, str, Cells]]:
    """Title, words and cells of every table."""
    many = f"{study.settings.drawn} drawn poses"
    return [
        ("Table 1: errors of the recognised pose", "Last columns: volume errors, Eq. (28).",
         table_1_cells(study.rendered)),
        ("Table 2: relative pose of the bones", "Last columns: over all components.",
         table_2_cells(study.rendered)),
        ("Recognition by fit and method", "Volume errors against the truth, mean ± SD.",
         recognition_cells(study)),
        ("Correction by compensation", "Volume errors of the mechanism's pose that the plan starts"
         " from and of the bones reduced: mean ± SD, drawn poses with standard error.",
         correction_cells(study)),
        (f"Error budget, {many}", "Mean volume error with one source on at a time (its share of"
         " the squares).", budget_cells(study.drawn)),
        ("Floor of the installation error, N = 3", "By covariance, nothing else erring: the distal"
         " ring's tilt acts over the rings' distance, which the paper does not print.",
         floor_cells()),
        ("Goals", "Few poses scatter: the drawn ones decide. " + COARSE, goal_cells(study)),
    ]  # fmt: skip


def experiment_text(study: ExperimentStudy) -> str:
    """The experiment for a terminal."""
    parts = [TITLE, *experiment_heading(study)]
    for title, words, cells in _sections(study):
        parts += ["", f"{title} (simulated). {words}", "", plain(cells)]
    return "\n".join(parts)


def experiment_page(study: ExperimentStudy) -> str:
    """The experiment as a Markdown page beside its figure."""
    parts = [
        f"# {TITLE}",
        "",
        "Made by `hexafix study experiment`. " + " ".join(experiment_heading(study)),
        "",
        "![Volume errors and error budget of the simulated experiment](experiment.svg)",
        "",
        "Simulated. Above: volume errors, Eq. (28), one point a pose with CT, bars the mean of the"
        " drawn poses, stars printed, dotted lines goals. Below: error budget of the bones reduced,"
        " drawn poses, one source on at a time.",
        "",
    ]
    for title, words, cells in _sections(study):
        parts += [f"## {title}", "", f"Simulated. {words}", "", markdown(cells)]
    return "\n".join(parts)
