"""The commands of ``hexafix``."""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from cyclopts import App, CycloptsError, Parameter

from hexafix import __version__
from hexafix.cli.advise import advise
from hexafix.cli.console import (
    command_line_error,
    print_json,
    progress_bar,
    quiet_libraries,
    report_error,
)
from hexafix.cli.desktop import desktop
from hexafix.cli.execution_model import XML, Channel, execution_model_xml
from hexafix.cli.serve import serve
from hexafix.cli.study import study
from hexafix.errors import HexaFixError

NOTICE = "Research software, not a medical device."


def version_text() -> str:
    """HexaFix and the libraries whose fault could matter, one a line."""
    from hexafix.libraries import versions

    lines = (f"{name} {version}" for name, version in versions().items())
    return "\n".join([f"hexafix {__version__}", *lines])


app = App(
    name="hexafix",
    help=f"From a CT of a hexapod external fixator to a verified strut schedule. {NOTICE}",
    version=version_text,
    help_format="plaintext",
)
app.command(study)
app.command(advise)
app.command(serve)
app.command(desktop)

Json = Annotated[bool, Parameter(name="--json", negative="", help="Print one JSON document.")]
Quiet = Annotated[bool, Parameter(name=["--quiet", "-q"], negative="", help="No progress.")]


def main(argv: Sequence[str] | None = None) -> None:
    """Run a command and exit with 0 done, 2 wrong input, 3 refused, 1 a defect of HexaFix."""
    tokens = list(sys.argv[1:] if argv is None else argv)
    # All matrices here are small: one thread is faster and makes results repeatable (H57).
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    try:
        with quiet_libraries():
            # Slicer asks for the XML without the arguments that planning needs.
            result = _describe("plan") if tokens == ["plan", XML] else _run(tokens)
        code = result if isinstance(result, int) else 0
    except HexaFixError as error:
        code = report_error(error, as_json="--json" in tokens)
    except CycloptsError as error:
        code = report_error(command_line_error(error), as_json="--json" in tokens)
    except KeyboardInterrupt:
        print("hexafix: stopped; nothing was written", file=sys.stderr)
        code = 130
    except BrokenPipeError:
        code = 0
    except Exception as error:
        code = _defect(error)
    sys.exit(code)


def _run(tokens: list[str]) -> object:
    return app(tokens, result_action="return_value", exit_on_error=False, print_error=False)


def _describe(command: str) -> int:
    print(execution_model_xml(app, command), end="")
    return 0


def _defect(error: Exception) -> int:
    """Tell a defect without its values: they could hold patient data.

    The traceback that HEXAFIX_DEBUG asks for may hold paths and header values: the user's choice.
    """
    import traceback

    if os.environ.get("HEXAFIX_DEBUG"):
        traceback.print_exception(error)
    frame = traceback.extract_tb(error.__traceback__)[-1]
    place = f"{Path(frame.filename).name}:{frame.lineno}"
    print(
        f"hexafix: a defect of HexaFix: {type(error).__name__} at {place}. Nothing was written. "
        "Set HEXAFIX_DEBUG=1 for the traceback; it may hold patient data.",
        file=sys.stderr,
    )
    return 1


@app.command
def demo(
    *,
    out: Annotated[Path, Parameter(help="Folder for the synthetic CT and the export.")] = Path(
        "hexafix-demo"
    ),
    seed: Annotated[int, Parameter(help="Same seed, same phantom.")] = 1,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Build a synthetic CT of a fixator on a limb and plan it as if you had brought it."""
    from hexafix.cli.demo import run_demo

    with progress_bar(quiet=quiet) as progress:
        summary, text = run_demo(out, seed=seed, progress=progress)
    print_json(summary) if json else print(text)
    return 0


@app.command
def phantom(
    out: Annotated[Path, Parameter(help="Folder to make.")],
    *,
    seed: Annotated[int, Parameter(help="Same seed, same phantom.")] = 1,
    image_format: Annotated[
        Literal["dicom", "nrrd"], Parameter(name="--format", help="How the CT is stored.")
    ] = "dicom",
    size: Annotated[tuple[int, int, int] | None, Parameter(help="Voxels along i, j and k.")] = None,
    spacing_mm: Annotated[
        tuple[float, float, float] | None, Parameter(help="Voxel pitch along i, j and k.")
    ] = None,
    noise_hu: Annotated[float | None, Parameter(help="Standard deviation of the noise.")] = None,
    streaks_hu: Annotated[float | None, Parameter(help="Amplitude of metal streaks.")] = None,
    side: Annotated[Literal["left", "right"] | None, Parameter(help="Side of the limb.")] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Make only the synthetic CT, with truth.json and a ready case.json."""
    from hexafix.cli.demo import run_phantom

    with progress_bar(quiet=quiet) as progress:
        truth = run_phantom(
            out,
            seed=seed,
            image_format=image_format,
            options={
                "size_ijk": size,
                "spacing_mm": spacing_mm,
                "noise_hu": noise_hu,
                "streaks_hu": streaks_hu,
                "side": side,
            },
            progress=progress,
        )
    print_json(truth) if json else print(f"phantom, truth.json and case.json are in {out}")
    return 0


@app.command
def series(
    folder: Annotated[Path, Parameter(help="A DICOM folder or file.")],
    *,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """List the series of a DICOM folder with their SeriesInstanceUIDs, to choose one."""
    from hexafix.cli.show import series_text
    from hexafix.imaging.series_list import series_document

    with progress_bar(quiet=quiet) as progress:
        document = series_document(folder, progress=progress)
    print_json(document) if json else print(series_text(document))
    return 0


@app.command
def markers(
    image: Annotated[Path, Parameter(help="DICOM folder, NRRD, NIfTI or MetaImage file.")],
    *,
    diameter_mm: Annotated[float, Parameter(help="Diameter of the marker balls.")],
    series: Annotated[
        str | None, Parameter(help="SeriesInstanceUID, if there are several.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Find the marker balls of a CT; nothing else is needed."""
    from hexafix.cli.show import balls_document, balls_text
    from hexafix.pipeline import find_markers

    with progress_bar(quiet=quiet) as progress:
        balls = find_markers(
            image, ball_diameter_mm=diameter_mm, series_instance_uid=series, progress=progress
        )
    print_json(balls_document(balls)) if json else print(balls_text(balls))
    return 0


@app.command
def recognise(
    case: Annotated[Path, Parameter(help="The case file.")],
    *,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Recognise the poses of both rings and of the mechanism."""
    from hexafix.case import load_case
    from hexafix.cli.scene_image import scene_volume
    from hexafix.cli.show import recognition_text
    from hexafix.pipeline import recognise_case

    loaded = load_case(case, plannable=False)
    with progress_bar(quiet=quiet) as progress:
        volume = scene_volume(loaded, progress=progress)
        document = recognise_case(loaded, volume=volume, progress=progress)
    print_json(document) if json else print(recognition_text(document))
    return 0


@app.command(name="check-layout")
def check_layout(
    case_or_layout: Annotated[Path, Parameter(help="A case file or a layout file.")],
    *,
    json: Json = False,
) -> int:
    """Check a marker layout before the CT: angles, uniqueness, predicted error, a better one."""
    from hexafix.case import load_layouts, load_rings
    from hexafix.cli.show import layout_text
    from hexafix.pipeline import check_case_layout

    layouts = load_layouts(case_or_layout)
    document = check_case_layout(*layouts, rings=load_rings(case_or_layout))
    print_json(document) if json else print(layout_text(document))
    return 0


@app.command
def plan(
    case: Annotated[Path, Parameter(help="The case file."), Channel("file", "input", ".json")],
    *,
    out: Annotated[Path, Parameter(help="Folder for the export."), Channel("directory", "output")],
    accept_relaxed_layout: Annotated[
        bool,
        Parameter(negative="", help="Accept a layout that keeps only the relaxed angle rule."),
    ] = False,
    identified_pdf: Annotated[
        bool,
        Parameter(
            negative="",
            help="Print the patient's name, id, birth date and the CT's date, as its headers have "
            "them, on the prescription; no other file names the patient.",
        ),
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
    xml: Annotated[
        bool, Parameter(name=XML, negative="", help="Describe this command to Slicer; alone.")
    ] = False,
) -> int:
    """Run the whole chain and write the export: plan, schedule, PDF, markers, manifest."""
    if xml:
        return _describe("plan")
    from hexafix.export import check_target
    from hexafix.report.picture import SceneRenderer

    check_target(out)
    # the picture's process loads its libraries while this one loads the chain
    with SceneRenderer() as renderer, progress_bar(quiet=quiet) as progress:
        from hexafix.case import load_case
        from hexafix.cli.scene_image import scene_volume
        from hexafix.cli.show import plan_text
        from hexafix.export import FILES, MANIFEST
        from hexafix.pipeline import plan_and_export

        loaded = load_case(case)
        document = plan_and_export(
            loaded,
            out,
            volume=scene_volume(loaded, progress=progress),
            accept_relaxed_layout=accept_relaxed_layout,
            identified_pdf=identified_pdf,
            renderer=renderer,
            progress=progress,
        )
    if identified_pdf:
        print(
            "hexafix: prescription.pdf names the patient: handle it as patient data",
            file=sys.stderr,
        )
    print_json(document) if json else print(plan_text(document, (*FILES, MANIFEST)))
    return 0


@app.command
def verify(
    folder: Annotated[Path, Parameter(help="An export of hexafix plan.")],
    *,
    json: Json = False,
) -> int:
    """Read an export back and recompute it by an independent road."""
    from hexafix.cli.show import verdict_text
    from hexafix.verify import verify_export

    verdict = verify_export(folder)
    print_json(verdict) if json else print(verdict_text(verdict))
    return 0 if verdict["verified"] else 3


@app.command
def selftest(*, json: Json = False) -> int:
    """Check the installed libraries against known answers, as plan does before it starts."""
    from hexafix.cli.show import self_test_text
    from hexafix.selftest import run_self_test, self_test_document

    document = self_test_document(run_self_test(foreign=True))
    print_json(document) if json else print(self_test_text(document))
    return 0 if document["passed"] else 3


@app.command
def benchmark(
    *names: Annotated[str, Parameter(help="Which measurements; none means all.")],
    quick: Annotated[bool, Parameter(negative="", help="Small samples, for a first look.")] = False,
    page: Annotated[
        Path | None, Parameter(help="Compare with other tools, page and picture into this folder.")
    ] = None,
    seed: Annotated[int, Parameter(help="Of the page: same seed, same data.")] = 0,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Measure HexaFix against its goals, or with --page against what one would otherwise write."""
    from hexafix.benchmark.run import print_rows, run

    if page is not None:
        from hexafix.cli.benchmark_page import make_page

        return make_page(names, page, quick=quick, seed=seed, json=json, quiet=quiet)
    rows = run(names, quick=quick)
    print_json(rows) if json else print_rows(rows)
    return 0 if all(row["met"] for row in rows) else 1


@app.command
def scenarios(
    *,
    only: Annotated[str, Parameter(help="Ids with commas, such as S07,S12; none means all.")] = "",
    jobs: Annotated[int, Parameter(help="Processes at once.")] = 1,
    out: Annotated[
        Path | None, Parameter(help="Folder for scenarios.md and scenarios.json.")
    ] = None,
    json: Json = False,
    quiet: Quiet = False,
) -> int:
    """Plan and judge the numbered clinical scenarios, all of them simulated."""
    from hexafix.cli.scenarios import run_catalogue

    with progress_bar(quiet=quiet) as progress:
        document, text = run_catalogue(only, jobs=jobs, out=out, progress=progress)
    print_json(document) if json else print(text)
    return 0 if document["all_as_expected"] else 1
