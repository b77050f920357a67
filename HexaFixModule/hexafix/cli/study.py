"""``hexafix study``: the paper's accuracy analysis, re-enacted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from cyclopts import App, Parameter

from hexafix.cli.console import print_json, progress_bar

study = App(name="study", help="The paper's accuracy analysis re-enacted, with our verdict on it.")

Axes = tuple[float, float, float]
Json = Annotated[bool, Parameter(name="--json", negative="", help="Print one JSON document.")]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative="", help="No progress.")]
Out = Annotated[Path | None, Parameter(help="Folder for figures, page, CSV and JSON.")]
Samples = Annotated[int, Parameter(help="Samples of each layout in the linear models.")]
Full = Annotated[int, Parameter(help="Samples of each layout in the full simulation.")]
Seed = Annotated[int, Parameter(help="Same seed, same numbers.")]
Image = Annotated[Axes | None, Parameter(negative="", help="Error of a ball centre along x, y, z.")]
Place = Annotated[Axes | None, Parameter(negative="", help="Installation error along x, y, z.")]
Workers = Annotated[int | None, Parameter(help="Cores to use; none means all.")]
Dask = Annotated[str | None, Parameter(help="Address of a Dask scheduler to spread the work over.")]


@study.command
def number(
    *,
    samples: Samples = 2000,
    full_samples: Full = 2000,
    seed: Seed = 0,
    sigma_image_mm: Image = None,
    sigma_installation_mm: Place = None,
    out: Out = None,
    workers: Workers = None,
    dask: Dask = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """How many markers: Section 4.3.1, Fig. 5, Eq. (26)."""
    from hexafix.study import study_number
    from hexafix.study.tables import number_text
    from hexafix.study.write import write_number

    settings = _settings(
        samples, full_samples, seed, sigma_image_mm, sigma_installation_mm, workers
    )
    return _run(study_number, number_text, write_number, settings, out, dask, json, quiet)


@study.command
def angles(
    *,
    samples: Samples = 2000,
    full_samples: Full = 100,
    seed: Seed = 0,
    sigma_image_mm: Image = None,
    sigma_installation_mm: Place = None,
    out: Out = None,
    workers: Workers = None,
    dask: Dask = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Where three markers sit: Section 4.3.2, Fig. 6 and 7."""
    from hexafix.study import study_angles
    from hexafix.study.tables import angles_text
    from hexafix.study.write import write_angles

    settings = _settings(
        samples, full_samples, seed, sigma_image_mm, sigma_installation_mm, workers
    )
    return _run(study_angles, angles_text, write_angles, settings, out, dask, json, quiet)


@study.command
def experiment(
    *,
    poses: Annotated[int, Parameter(help="Poses with a rendered CT.")] = 10,
    drawn: Annotated[int, Parameter(help="Poses of the larger run without CT.")] = 200,
    seed: Seed = 1,
    voxel_mm: Annotated[float, Parameter(help="Edge of the CT's voxels.")] = 0.8,
    jobs: Annotated[int | None, Parameter(help="Poses at once; none means all cores.")] = None,
    out: Out = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Tables 1 and 2 re-enacted on simulated CT: Section 5.2, with an error budget."""
    from hexafix.study.experiment import study_experiment
    from hexafix.study.experiment_document import experiment_document
    from hexafix.study.experiment_tables import experiment_text
    from hexafix.study.experiment_trial import ExperimentSettings
    from hexafix.study.write import write_experiment

    settings = ExperimentSettings(poses=poses, drawn=drawn, seed=seed, voxel_mm=voxel_mm, jobs=jobs)
    return _run(study_experiment, experiment_text, write_experiment, settings, out, None, json,
                quiet, document=experiment_document)  # fmt: skip


@study.command
def speed(*, workers: Workers = None, json: Json = False) -> int:
    """The sweep of all layouts measured against a plain loop, and its memory."""
    from hexafix.study.speed import sweep_speed
    from hexafix.study.tables import speed_text

    found = sweep_speed(workers=workers)
    print_json(found) if json else print(speed_text(found))
    return 0


def _settings(
    samples: int, full: int, seed: int, image: Axes | None, place: Axes | None, workers: int | None
) -> Any:
    from hexafix.study import ErrorModel, StudySettings

    given = {"image_sigma_mm": image, "installation_sigma_mm": place}
    errors = ErrorModel(**{name: value for name, value in given.items() if value is not None})
    return StudySettings(
        samples=samples, full_samples=full, seed=seed, errors=errors, workers=workers
    )


def _run(
    do: Any, text: Any, write: Any, settings: Any, out: Path | None, dask: str | None,
    json: bool, quiet: bool, *, document: Any = None,
) -> int:  # fmt: skip
    """Do a study, write its files if a folder is given, and print it."""
    from hexafix.study.plotting import require_matplotlib
    from hexafix.study.runner import dask_cluster

    if out is not None:
        require_matplotlib()
    with progress_bar(quiet=quiet) as progress:
        with dask_cluster(dask):
            found = do(settings, progress=progress)
        written = write(found, out, progress=progress) if out is not None else ()
    print_json(document(found) if document else found.as_json()) if json else print(text(found))
    if written and not json:
        print(f"\n{len(written)} files in {out}")
    return 0
