"""The page: the comparison's document as Markdown, JSON and pictures."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from hexafix.benchmark.comparison import Document
from hexafix.benchmark.comparison_balls import QUALITIES
from hexafix.comparison.figure import draw
from hexafix.errors import InputError
from hexafix.study.plotting import save
from hexafix.study.tables import markdown

STEM = "benchmark"
FORMATS = ("svg", "png")

EQUAL_SHARE = 0.05
"""Errors that differ by less than this share count as equal."""
NO_ERROR = {"_mm": 1e-9, "_deg": 1e-9}
"""Errors below these are none."""

COLUMNS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "balls": (
        *((case, "rms_3d_mm", f"3D RMS, {case}, mm") for case in QUALITIES),
        *((case, "bias_along_rod_mm", f"bias along the rod, {case}, mm") for case in QUALITIES),
        ("varied", "rms_3d_mm", "3D RMS, other phantoms, mm"),
        ("raced", "rms_3d_mm", "3D RMS, raced phantom, mm"),
    ),
    "pose": tuple(
        (case, key, f"RMS, {case}, {unit}")
        for case in ("equal", "streak", "thick")
        for key, unit in (("rms_mm", "mm"), ("rms_deg", "°"))
    ),
    "kinematics": (
        ("all poses", "largest_mm", "largest error, mm"),
        ("all poses", "wrong", "poses wrong by more than 0.001 mm"),
    ),
    "reading": (
        ("series", "voxels_equal", "every voxel right"),
        ("series", "place_error_mm", "place error, mm"),
    ),
}
"""What the accuracy table of a group shows: case, key of its figures, heading."""

JUDGED = {"rms_3d_mm", "missed", "invented", "rms_mm", "rms_deg", "largest_mm", "wrong",
          "place_error_mm"}  # fmt: skip
"""Errors that are compared in words: the smaller the better."""


def write_page(document: Document, folder: Path) -> tuple[Path, ...]:
    """Write ``benchmark.md``, ``.json``, ``.svg`` and ``.png``; return their paths.

    Raises
    ------
    InputError
        If the folder cannot be written.
    MissingLibrary
        If matplotlib is not installed.
    """
    figure = draw(document)
    texts = {f"{STEM}.json": document_text(document), f"{STEM}.md": page(document)}
    paths = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
            paths.append(folder / name)
        for suffix in FORMATS:
            save(figure, folder / f"{STEM}.{suffix}")
            paths.append(folder / f"{STEM}.{suffix}")
    except OSError as error:
        raise InputError.of(
            "not-writable",
            f"the benchmark page cannot be written: {error.strerror}",
            where="--page",
            next_step="choose another folder",
        ) from error
    return tuple(paths)


def document_text(document: Document) -> str:
    """The document as JSON."""
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def page(document: Document) -> str:
    """The document as a Markdown page; every figure on it comes from the document."""
    machine = document["machine"]
    libraries = ", ".join(f"{name} {number}" for name, number in document["libraries"].items())
    size = "A first look on small samples, which proves little. " if document["quick"] else ""
    parts = [
        "# HexaFix beside what one would otherwise write",
        "",
        f"Made by `{document['command']}`; do not edit. {size}Everything on it is simulated and was"
        " measured in one run, every tool in its own process, on the same data and machine:"
        f" {machine['system']} {machine['processor']}, {machine['cores']} cores shared with other"
        f" work, {_number(machine['load_before'])} processes wanting a core before and"
        f" {_number(machine['load_after'])} after the run."
        f" HexaFix {document['hexafix']}, {libraries}.",
        "",
        f"![Error, time and memory of every tool]({STEM}.svg)",
        "",
        "Times are over those of the HexaFix tool that does the same work and ran just before:"
        " median of the pairs and their range. HexaFix's own rows show it against itself: what"
        " chance and warm caches do. Processor time counts all threads and suffers less from other"
        " programs.",
        "",
    ]
    for group in document["groups"]:
        parts += _group(group)
    parts += ["## Can this comparison tell tools apart?", "", *_controls(document["controls"])]
    parts += ["## Limits", "", *(f"- {limit}" for limit in document["limits"]), ""]
    return "\n".join(parts)


def _group(group: Document) -> list[str]:
    parts = [f"## {group['title']}", "", SETTINGS[group["name"]](group["data"]), ""]
    parts += [markdown(_speed_cells(group)), markdown(_accuracy_cells(group))]
    if group["not_measured"]:
        missing = ", ".join(f"{row['words']} ({row['missing']})" for row in group["not_measured"])
        parts += [f"Not measured, library not installed: {missing}.", ""]
    lines = [line for row in group["tools"] for line in _verdict(row, group)]
    return [*parts, "Where another tool is better than HexaFix, or equal:", "",
            *(lines or ["- nowhere in this run"]), ""]  # fmt: skip


def _speed_cells(group: Document) -> list[list[str]]:
    """Time and memory of each tool; the head first."""
    count, unit = _items(group)
    balls = group["name"] == "balls"
    head = ["tool", unit, "time over HexaFix", "processor time over HexaFix"]
    head += ["memory, MB"] if _shows_memory(group) else []
    head += ["missed, invented"] if balls else []
    cells = [head]
    for row in group["tools"]:
        line = [
            row["words"],
            f"{row['seconds'] / count:.3g}",
            f"{row['ratio']:.2f} × ({row['ratio_low']:.2f} to {row['ratio_high']:.2f})",
            f"{row['cpu_ratio']:.2f} ×",
        ]
        line += [_number(row["peak_mb"])] if _shows_memory(group) else []
        line += [_missed(row)] if balls else []
        cells.append(line)
    return cells


def _items(group: Document) -> tuple[float, str]:
    """How many things one run did, in the unit of the heading."""
    if group["name"] == "pose":
        rings = group["data"]["rings_of_each_scene"] * len(group["data"]["image_sigma_mm"])
        return rings / 1e3, "ms a ring"
    if group["name"] == "kinematics":
        return group["data"]["poses"] / 1e3, "ms a pose"
    return 1.0, "seconds"


def _shows_memory(group: Document) -> bool:
    return group["name"] in ("balls", "reading")


def _missed(row: Document) -> str:
    """Balls missed and invented over all cases."""
    balls, missed, invented = (
        sum(case[key] for case in row["accuracy"]) for key in ("balls", "missed", "invented")
    )
    return f"{missed}, {invented} of {balls}"


def _accuracy_cells(group: Document) -> list[list[str]]:
    present = {case["case"] for row in group["tools"] for case in row["accuracy"]}
    columns = [column for column in COLUMNS[group["name"]] if column[0] in present]
    cells = [["tool", *(heading for _, _, heading in columns)]]
    for row in group["tools"]:
        cases = {case["case"]: case for case in row["accuracy"]}
        cells.append([row["words"], *(_error(cases[case][key]) for case, key, _ in columns)])
    return cells


def _number(value: Any) -> str:
    """A figure for people: three digits, yes and no, a dash for none."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, int):
        return str(value)
    if 0.0 < abs(value) < 1e-4:
        return f"{value:.1e}"
    return f"{value:.3g}" if abs(value) < 100 else f"{value:.0f}"


def _error(value: Any) -> str:
    """An error in mm or degrees to four decimals; what is smaller by its power of ten."""
    if isinstance(value, float) and (abs(value) >= 1e-6 or value == 0.0):
        return f"{value:.4f}" if value else "0"
    return _number(value)


def _verdict(row: Document, group: Document) -> list[str]:
    """One line for a tool that is somewhere better than its HexaFix counterpart, or equal."""
    if row["control"] or row["words"].startswith("HexaFix"):
        return []
    ours = next(one for one in group["tools"] if one["name"] == row["against"])
    better, equal = _accuracy_verdicts(row, ours)
    if row["ratio_high"] < 1.0:
        better.append(f"time ({row['ratio']:.2f} ×)")
    elif row["ratio_low"] <= 1.0:
        equal.append("time (the pairs do not settle it)")
    if _shows_memory(group) and None not in (row["peak_mb"], ours["peak_mb"]):
        (better if row["peak_mb"] < ours["peak_mb"] else []).append(
            f"memory ({row['peak_mb']:.0f} against {ours['peak_mb']:.0f} MB)"
        )
    words = [f"better in {'; '.join(better)}"] if better else []
    words += [f"equal in {'; '.join(equal)}"] if equal else []
    return [f"- {row['words']}: {'. '.join(words)}"] if words else []


def _accuracy_verdicts(row: Document, ours: Document) -> tuple[list[str], list[str]]:
    """Errors that are smaller than HexaFix's, and those that are equal."""
    better: dict[str, list[str]] = {}
    equal: dict[str, list[str]] = {}
    for theirs, mine in zip(row["accuracy"], ours["accuracy"], strict=True):
        for key in sorted(JUDGED & set(theirs)):
            if None in (theirs[key], mine[key]):
                continue
            floor = next((v for end, v in NO_ERROR.items() if key.endswith(end)), 0.0)
            none = max(theirs[key], mine[key]) <= floor
            if none or abs(theirs[key] - mine[key]) <= EQUAL_SHARE * mine[key]:
                equal.setdefault(ERROR_WORDS[key], []).append(theirs["case"])
            elif theirs[key] < mine[key]:
                better.setdefault(ERROR_WORDS[key], []).append(theirs["case"])
    return _listed(better), _listed(equal)


def _listed(cases: dict[str, list[str]]) -> list[str]:
    return [f"{words} ({', '.join(names)})" for words, names in cases.items()]


ERROR_WORDS = {
    "rms_3d_mm": "3D RMS",
    "missed": "balls missed",
    "invented": "balls invented",
    "rms_mm": "RMS in mm",
    "rms_deg": "RMS in degrees",
    "largest_mm": "largest error",
    "wrong": "poses wrong",
    "place_error_mm": "place error",
}


def _controls(controls: Sequence[Document]) -> list[str]:
    """What came of the tool made worse on purpose."""
    if not controls:
        return ["No control ran.", ""]
    cells = [["a HexaFix made careless on purpose", "measured", "must reach", "told apart"]]
    for row in controls:
        unit = f" {row['unit']}"
        cells.append([row["name"], _number(row["value"]) + unit, _number(row["at_least"]) + unit,
                      _number(row["told_apart"])])  # fmt: skip
    return [
        "It rounds its centres to the voxel, holds a copy of the volume in double precision, and"
        " does the work twice; each must come out.",
        "",
        markdown(cells),
    ]


def _size(data: Document) -> str:
    return "×".join(map(str, data["size_ijk"]))


def _ball_settings(data: Document) -> str:
    qualities = "; ".join(f"*{name}*: {words}" for name, words in QUALITIES.items())
    return (
        f"Time and memory: one phantom of {_size(data)} voxels ({data['voxels_mb']:.0f} MB, held in"
        f" memory in each tool's own form) with {data['balls']} balls, rings, struts, decoys and a"
        f" limb. Errors: {data['placements']} seeded placements below the voxel's size for each"
        f" image quality ({qualities}), and {data['phantoms']} other phantoms of varied voxels,"
        " materials and streaks. Bias is along the connection rod, positive towards it: it is the"
        " same for every ball, so it never averages out. A centre farther than a quarter diameter"
        " from every true ball is invented."
    )


def _pose_settings(data: Document) -> str:
    return (
        f"{data['rings_of_each_scene']} seeded rings of {data['balls']} balls for each scene:"
        " *equal* (all balls equally exact), *streak* (one ball uncertain), *thick* (the image's z"
        f" uncertain); installation errors of σ {data['installation_sigma_mm']:.3f} mm along each"
        " axis in all. HexaFix is told the covariances that it otherwise estimates; the weighted"
        " rival gets one weight a ball from them. HexaFix also checks for mirrored and degenerate"
        " rings and states the pose's covariance, the others do not."
    )


def _kinematics_settings(data: Document) -> str:
    return (
        f"{data['poses']} seeded poses; cold starts at the neutral pose, warm ones at most"
        f" {data['warm_mm']:g} mm and {data['warm_deg']:g}° an axis from the solution. The rival"
        " solves the same equations in a rotation vector by Levenberg-Marquardt with finite"
        " differences."
    )


def _reading_settings(data: Document) -> str:
    return (
        f"An uncompressed CT series of {_size(data)} voxels ({data['voxels_mb']:.0f} MB of HU) in"
        " the system's cache. Memory includes the volume that was read. HexaFix also checks every"
        " header, slice and spacing, and hashes the voxels; the others do not."
    )


SETTINGS: dict[str, Callable[[Document], str]] = {
    "balls": _ball_settings,
    "pose": _pose_settings,
    "kinematics": _kinematics_settings,
    "reading": _reading_settings,
}
