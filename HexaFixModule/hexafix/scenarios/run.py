"""Scenarios made, brought, planned and judged."""

from __future__ import annotations

import json
import multiprocessing
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pydicom

from hexafix.case import load_case
from hexafix.errors import Cancelled, Fault, HexaFixError, InputError
from hexafix.phantom import PhantomSpec, make_phantom, write_phantom
from hexafix.pipeline import plan_and_export, recognise_case
from hexafix.progress import Progress, silent
from hexafix.scenarios.catalogue import CATALOGUE
from hexafix.scenarios.judge import Finding, judge_plan, judge_recognition, judge_refusal, must
from hexafix.scenarios.scenario import Scenario
from hexafix.verify import verify_export

STEP = "clinical scenarios"


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a scenario.

    Attributes
    ----------
    id, theme, title : str
    due : str
        ``planned``, or the codes of the refusal that is due.
    came : str
        The same of what came; ``defect`` and its place for an error that HexaFix did not mean.
    findings : tuple of Finding
    faults : tuple of Fault
        Of a refusal, due or not.
    seconds : float
        Making the phantom and all.
    """

    id: str
    theme: str
    title: str
    due: str
    came: str
    findings: tuple[Finding, ...]
    faults: tuple[Fault, ...]
    seconds: float

    @property
    def as_expected(self) -> bool:
        """Whether it was planned or refused as it must, with every finding within its limit."""
        return self.came == self.due and all(finding.passed for finding in self.findings)


def chosen(ids: Sequence[str] = ()) -> tuple[Scenario, ...]:
    """Scenarios by id, in the catalogue's order; none named means all.

    Raises
    ------
    InputError
        If there is no such scenario.
    """
    unknown = sorted(set(ids) - {scenario.id for scenario in CATALOGUE})
    if unknown:
        raise InputError.of(
            "scenario-unknown",
            "there is no such scenario",
            value=", ".join(unknown),
            limit=f"{CATALOGUE[0].id} to {CATALOGUE[-1].id}",
            where="--only",
            next_step="name scenarios of the catalogue",
        )
    return tuple(scenario for scenario in CATALOGUE if not ids or scenario.id in ids)


def run_scenarios(
    scenarios: Sequence[Scenario], *, jobs: int = 1, progress: Progress = silent
) -> tuple[Outcome, ...]:
    """Run scenarios of the catalogue; the outcomes come in the order given.

    Parameters
    ----------
    scenarios : sequence of Scenario
    jobs : int
        Processes; 1 runs them in this one.
    progress : Progress
        Watches, and may stop the run by raising `Cancelled`.
    """
    total = len(scenarios)
    outcomes: dict[str, Outcome] = {}
    progress(STEP, 0.0)
    if jobs <= 1:
        for scenario in scenarios:
            done = len(outcomes) / total
            outcomes[scenario.id] = run_scenario(
                scenario, progress=lambda step, fraction, done=done: progress(STEP, done)
            )
        progress(STEP, 1.0)
        return tuple(outcomes.values())
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context) as pool:
        waiting = [pool.submit(_run_by_id, scenario.id) for scenario in scenarios]
        try:
            for job in as_completed(waiting):
                outcome = job.result()
                outcomes[outcome.id] = outcome
                progress(STEP, len(outcomes) / total)
        except BaseException:
            pool.shutdown(wait=True, cancel_futures=True)
            raise
    return tuple(outcomes[scenario.id] for scenario in scenarios)


def _run_by_id(scenario_id: str) -> Outcome:
    """In another process, which has its own catalogue."""
    return run_scenario(chosen([scenario_id])[0], workers=1)


def run_scenario(
    scenario: Scenario, *, workers: int | None = None, progress: Progress = silent
) -> Outcome:
    """Make, bring, plan and judge one scenario in a temporary folder.

    Parameters
    ----------
    scenario : Scenario
    workers : int or None
        Threads that render the phantom.
    progress : Progress
    """
    started = time.perf_counter()
    findings: tuple[Finding, ...] = ()
    faults: tuple[Fault, ...] = ()
    due = _words(scenario.refusal.faults) if scenario.refusal else "planned"
    with tempfile.TemporaryDirectory(prefix="hexafix-scenario-") as place:
        try:
            findings, faults = _played(scenario, Path(place), workers, progress)
            came = _words({fault.code: None for fault in faults}) if faults else "planned"
        except Cancelled:
            raise
        except Exception as error:
            came = f"defect: {_place(error)}"
    seconds = time.perf_counter() - started
    title, theme = scenario.title, scenario.theme
    return Outcome(scenario.id, theme, title, due, came, findings, faults, seconds)


def _words(faults: Mapping[str, str | None]) -> str:
    return "refused: " + ", ".join(sorted(faults))


def _place(error: Exception) -> str:
    """Kind and place of an error, without its words: they may hold a path."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    where = f" at {Path(trace.tb_frame.f_code.co_filename).name}:{trace.tb_lineno}" if trace else ""
    return f"{type(error).__name__}{where}"


def _played(
    scenario: Scenario, place: Path, workers: int | None, progress: Progress
) -> tuple[tuple[Finding, ...], tuple[Fault, ...]]:
    """Findings, and the faults of a refusal."""
    case, truth, spec = bring(scenario, place / "brought", workers=workers, progress=progress)
    out = place / "out"
    out.mkdir()
    try:
        document, whole = _asked(scenario, case, out / "prescription", progress)
    except Cancelled:
        raise
    except HexaFixError as error:
        left = sorted(path.name for path in out.iterdir())
        judged: Iterator[Finding] = iter(())
        if scenario.refusal is not None:
            judged = judge_refusal(
                scenario.refusal, error.faults, error.exit_code, left_behind=left
            )
        return tuple(judged), error.faults
    told = [must(f"{key} is {due}", document.get(key) == due) for key, due in scenario.told.items()]
    if scenario.recognise_only:
        return (*told, *judge_recognition(document, truth, spec)), ()
    planned = judge_plan(document, truth, spec, dates=scenario.dates)
    return (whole, *told, *planned), ()


def bring(
    scenario: Scenario, folder: Path, *, workers: int | None = None, progress: Progress = silent
) -> tuple[Path, dict[str, Any], PhantomSpec]:
    """Write a scenario as a user would bring it, without the truth.

    Parameters
    ----------
    scenario : Scenario
    folder : Path
        New or empty.
    workers, progress
        As in `run_scenario`.

    Returns
    -------
    Path, dict, PhantomSpec
        The case file, the phantom's truth, and its spec.
    """
    spec = scenario.spec()
    phantom = make_phantom(spec, workers=workers, progress=progress)
    for change in scenario.volume:
        phantom = replace(phantom, volume=change(phantom.volume))
    path = write_phantom(phantom, folder, image_format=scenario.image_format, progress=progress)
    (folder / "truth.json").unlink()
    truth = json.loads(json.dumps(phantom.truth))
    if scenario.image_format == "dicom":
        one = next((folder / "ct").iterdir())
        truth["series_instance_uid"] = str(pydicom.dcmread(one).SeriesInstanceUID)
    for change in scenario.folder:
        change(folder / "ct")
    case = json.loads(path.read_text("utf-8"))
    for change in scenario.case:
        change(case, truth)
    path.write_text(json.dumps(case, indent=2), "utf-8")
    return path, truth, spec


def _asked(
    scenario: Scenario, case: Path, out: Path, progress: Progress
) -> tuple[dict[str, Any], Finding]:
    """The document that HexaFix gives, read back from the export, and whether that verifies."""
    if scenario.recognise_only:
        loaded = load_case(case, plannable=False)
        return recognise_case(loaded, progress=progress), must("recognised", True)
    plan_and_export(
        load_case(case),
        out,
        accept_relaxed_layout=scenario.accept_relaxed_layout,
        progress=progress,
    )
    verdict = verify_export(out)
    document = json.loads((out / "plan.json").read_text("utf-8"))
    return document, must("the export verifies by another road", verdict["verified"])
