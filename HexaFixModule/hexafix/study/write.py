"""A study's files: figures, page, tables and document in one folder."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from hexafix.errors import InputError
from hexafix.progress import Progress, silent
from hexafix.study.angles import AnglesStudy
from hexafix.study.experiment import ExperimentStudy
from hexafix.study.experiment_document import experiment_document
from hexafix.study.experiment_figure import experiment_figure
from hexafix.study.experiment_tables import experiment_page
from hexafix.study.figures import figure_5, figure_6, figure_7
from hexafix.study.number import NumberStudy
from hexafix.study.plotting import save
from hexafix.study.tables import angles_csv, angles_page, number_csv, number_page

FORMATS = ("svg", "pdf", "png")


def write_number(
    study: NumberStudy, folder: Path, *, progress: Progress = silent
) -> tuple[Path, ...]:
    """Write Fig. 5, page, CSV and JSON of the study of numbers; return their paths."""
    texts = {
        "number.md": number_page(study),
        "number.csv": number_csv(study),
        "number.json": _json(study.as_json()),
    }
    return _written(folder, texts, {"figure-5": lambda: figure_5(study)}, progress)


def write_angles(
    study: AnglesStudy, folder: Path, *, progress: Progress = silent
) -> tuple[Path, ...]:
    """Write Fig. 6 and 7, page, CSV and JSON of the study of angles; return their paths."""
    texts = {
        "angles.md": angles_page(study),
        "angles.csv": angles_csv(study),
        "angles.json": _json(study.as_json()),
    }
    figures = {"figure-6": lambda: figure_6(study), "figure-7": lambda: figure_7(study)}
    return _written(folder, texts, figures, progress)


def write_experiment(
    study: ExperimentStudy, folder: Path, *, progress: Progress = silent
) -> tuple[Path, ...]:
    """Write figure, page and JSON of the simulated experiment; return their paths."""
    texts = {
        "experiment.md": experiment_page(study),
        "experiment.json": _json(experiment_document(study)),
    }
    return _written(folder, texts, {"experiment": lambda: experiment_figure(study)}, progress)


def _json(document: object) -> str:
    return json.dumps(document, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _written(
    folder: Path,
    texts: dict[str, str],
    figures: dict[str, Callable[[], object]],
    progress: Progress,
) -> tuple[Path, ...]:
    """Files of one study; those of the same names are replaced, others stay."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        paths = []
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
            paths.append(folder / name)
        for done, (name, draw) in enumerate(figures.items()):
            progress("draw figures", done / len(figures))
            figure = draw()
            for suffix in FORMATS:
                save(figure, folder / f"{name}.{suffix}")
                paths.append(folder / f"{name}.{suffix}")
    except OSError as error:
        raise InputError.of(
            "not-writable",
            f"the study's files cannot be written: {error.strerror}",
            where=str(folder),
            next_step="choose another folder",
        ) from error
    return tuple(paths)
