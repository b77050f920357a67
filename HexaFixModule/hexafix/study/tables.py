"""The studies as tables: plain text for a terminal, Markdown for pages, CSV for other programs."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

from hexafix.study.angles import AnglesStudy
from hexafix.study.document import QUANTITIES, VOLUMES
from hexafix.study.number import NumberStudy
from hexafix.study.verdicts import Verdict

Cells = list[list[str]]

METHOD_WORDS = {"groups": "groups", "least-squares": "least squares"}
ANSWER_WORDS = {"exact": "linear, exact", "sampled": "linear, sampled", "full": "full simulation"}


def number_cells(study: NumberStudy) -> Cells:
    """Expected errors of each number of markers, method and answer; the head first."""
    cells = [["N", "method", "answer", "x mm", "y mm", "z mm", "α °", "β °", "γ °",
              "volume mm", "volume °"]]  # fmt: skip
    for row in study.as_json()["rows"]:
        for answer, words in ANSWER_WORDS.items():
            values = [f"{row[answer][name]:.4f}" for name in QUANTITIES + VOLUMES]
            cells.append([str(row["markers"]), METHOD_WORDS[row["method"]], words, *values])
    return cells


def rule_cells(study: AnglesStudy) -> Cells:
    """The worst volume errors of each rule; the head first."""
    cells = [["rule", "layouts", "method", "exact mm", "exact °", "worst at", "sampled mm",
              "sampled °", "full mm", "full °"]]  # fmt: skip
    for row in study.by_rule:
        at = sorted({"/".join(f"{a:g}" for a in row[f"worst_{u}_at_deg"]) for u in ("mm", "deg")})
        figures = {
            answer: [f"{row[f'worst_{answer}_{unit}']:.3f}" for unit in ("mm", "deg")]
            for answer in ("exact", "sampled", "full")
        }
        method = METHOD_WORDS[row["method"]]
        cells.append(
            [row["words"], str(row["layouts"]), method, *figures["exact"], ", ".join(at),
             *figures["sampled"], *figures["full"]]
        )  # fmt: skip
    return cells


def verdict_cells(verdicts: Sequence[Verdict]) -> Cells:
    """Every printed figure beside ours; the head first."""
    cells = [["claim", "source", "unit", "printed", "exact", "sampled", "full", "least squares",
              "verdict", "why"]]  # fmt: skip
    for verdict in verdicts:
        ours = (verdict.exact, verdict.sampled, verdict.full, verdict.least_squares)
        figures = [f"{verdict.printed:g}", *("-" if v is None else f"{v:.3f}" for v in ours)]
        cells.append(
            [verdict.claim, verdict.source, verdict.unit, *figures, verdict.status, verdict.words]
        )
    return cells


def plain(cells: Cells) -> str:
    """Cells as aligned columns, the head underlined."""
    widths = [max(len(row[k]) for row in cells) for k in range(len(cells[0]))]
    lines = [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in cells
    ]
    return "\n".join([lines[0], "  ".join("-" * width for width in widths), *lines[1:]])


def markdown(cells: Cells) -> str:
    """Cells as a Markdown table."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in cells]
    return "\n".join([lines[0], "|" + "---|" * len(cells[0]), *lines[1:]]) + "\n"


def comma_separated(rows: Sequence[Sequence[Any]]) -> str:
    """Rows as CSV; floats with all their digits."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    return text.getvalue()


def number_csv(study: NumberStudy) -> str:
    """One row a number of markers, method and answer, all digits."""
    names = [*QUANTITIES, *VOLUMES]
    rows: list[list[Any]] = [["markers", "method", "answer", *names]]
    for row in study.as_json()["rows"]:
        for answer in (*ANSWER_WORDS, "sampled_standard_error"):
            figures = row[answer]
            rows.append([row["markers"], row["method"], answer, *(figures[n] for n in names)])
    return comma_separated(rows)


def angles_csv(study: AnglesStudy) -> str:
    """One row a layout as sorted in Fig. 7; empty where recognition refuses the layout (H16)."""
    layouts = study.found.layouts
    gaps = np.round(np.degrees(layouts.included_angles_rad), 6)
    columns = study.columns
    rows: list[list[Any]] = [["included_1_deg", "included_2_deg", "included_3_deg", *columns]]
    for k in range(len(layouts)):
        values = [float(column[k]) for column in columns.values()]
        rows.append([*gaps[k].tolist(), *("" if np.isnan(v) else v for v in values)])
    return comma_separated(rows)


def _settings_words(study: NumberStudy | AnglesStudy) -> str:
    settings = study.settings
    image = ", ".join(f"{s:g}" for s in settings.errors.image_sigma_mm)
    place = ", ".join(f"{s:.4g}" for s in settings.errors.installation_sigma_mm)
    return (
        f"σ image {image} mm, σ installation {place} mm (x, y, z); {settings.samples} samples in"
        f" the linear models, {settings.full_samples} in the full simulation, seed {settings.seed}"
    )


def number_heading(study: NumberStudy) -> list[str]:
    """Title and settings of the study of numbers."""
    return [
        "Expected |error| of a ring's pose with N even markers (Section 4.3.1, Fig. 5)",
        "t = 100 mm, h = 20 mm, " + _settings_words(study),
    ]


def angles_heading(study: AnglesStudy) -> list[str]:
    """Title and settings of the study of angles."""
    count = len(study.found.layouts)
    return [
        "Volume errors of a ring's pose with three markers (Section 4.3.2, Fig. 6-7)",
        f"{count} ordered layouts at {study.step_deg}°, t = 100 mm, h = 20 mm, "
        + _settings_words(study),
    ]


def jacobian_words(study: NumberStudy) -> str:
    """How far J is from finite differences of the recognition."""
    gaps = ", ".join(f"{name} {gap:.1e}" for name, gap in study.jacobian_gap.items())
    return f"J against finite differences of the recognition, largest difference per mm: {gaps}"


def number_text(study: NumberStudy) -> str:
    """The study of numbers for a terminal."""
    parts = [*number_heading(study), "", plain(number_cells(study)), "", jacobian_words(study)]
    return "\n".join([*parts, "", *verdict_lines(study.verdicts)])


def angles_text(study: AnglesStudy) -> str:
    """The study of angles for a terminal."""
    parts = [*angles_heading(study), "", plain(rule_cells(study))]
    return "\n".join([*parts, "", *verdict_lines(study.verdicts)])


def verdict_lines(verdicts: Sequence[Verdict]) -> list[str]:
    """One paragraph a verdict: narrow enough for a terminal."""
    lines = ["Verdicts: printed figure, ours (exact / sampled / full / least squares full)"]
    for verdict in verdicts:
        ours = (verdict.exact, verdict.sampled, verdict.full, verdict.least_squares)
        figures = " / ".join("-" if v is None else f"{v:.3f}" for v in ours)
        lines.append(f"  {verdict.claim} ({verdict.source})")
        unit = "°" if verdict.unit == "°" else f" {verdict.unit}"
        lines.append(
            f"    printed {verdict.printed:g}{unit}, ours {figures}:"
            f" {verdict.status}; {verdict.words}"
        )
    return lines


def number_page(study: NumberStudy) -> str:
    """The study of numbers as a Markdown page beside its figure."""
    title, settings = number_heading(study)
    return "\n".join(
        [
            f"# {title}",
            "",
            f"Made by `hexafix study number`. {settings}. All figures are simulated.",
            "",
            "![Expected errors against the number of markers](figure-5.svg)",
            "",
            "Fig. 5. Solid lines: the paper's linear model of its group method, exact; points: the"
            " same, sampled, with two standard errors; dashed lines: least squares, exact; stars:"
            " printed. x and y coincide, and so do α and β; z and γ are the same in both methods.",
            "",
            markdown(number_cells(study)),
            f"{jacobian_words(study)}.",
            "",
            "## Verdict on the printed figures",
            "",
            markdown(verdict_cells(study.verdicts)),
        ]
    )


def angles_page(study: AnglesStudy) -> str:
    """The study of angles as a Markdown page beside its figures."""
    title, settings = angles_heading(study)
    return "\n".join(
        [
            f"# {title}",
            "",
            f"Made by `hexafix study angles`. {settings}. All figures are simulated.",
            "",
            "![Volume errors over the included angles](figure-6.svg)",
            "",
            "Fig. 6. The paper's linear model of its group method, exact. Δφ₁ and Δφ₂ follow the"
            " first marker around the ring; the third angle makes 360°.",
            "",
            "![Volume errors of the sorted layouts](figure-7.svg)",
            "",
            "Fig. 7. The same model, sampled: one point a layout, with the worst layout of each"
            " rule beside the limit printed for it.",
            "",
            "Worst layout of each rule; recognition refuses layouts flatter than 10 mm, which have"
            " no full simulation:",
            "",
            markdown(rule_cells(study)),
            "## Verdict on the printed figures",
            "",
            markdown(verdict_cells(study.verdicts)),
        ]
    )


def speed_text(found: dict[str, Any]) -> str:
    """What `speed.sweep_speed` measured, for a terminal."""
    return (
        f"{found['layouts']} layouts x {found['samples']} samples in {found['sweep_s']:.2f} s;"
        f" a plain loop takes {found['loop_s']:.1f} s, {found['ratio']:.0f} times as long;"
        f" four times the samples take {found['memory_ratio']:.3f} times the memory"
    )
