"""Tables 1 and 2 of the paper re-enacted on simulated CT: Section 5.2.

Ten poses go through a rendered CT. A larger run without CTs, its image errors drawn from what the
rendered ones show, says how far ten poses scatter.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from hexafix.benchmark.balls import isosurface_finder
from hexafix.progress import Progress, silent
from hexafix.study.experiment_chain import (
    ALL,
    ALONE,
    BUDGET_WAYS,
    OURS,
    PAPER,
    ROADS,
    WAYS,
    Outcome,
    Road,
    Way,
    enact,
)
from hexafix.study.experiment_scan import FITS, ImageError, Seen, measured, scan
from hexafix.study.experiment_statistics import Summary
from hexafix.study.experiment_trial import ExperimentSettings, Trial, draw_trial
from hexafix.study.runner import in_order

Enacted = dict[str, Outcome]
"""A pose with every error, ``all``, and with each of `ALONE`."""


@dataclass(frozen=True, eq=False)
class Run:
    """Many poses enacted.

    Attributes
    ----------
    poses : tuple of dict of str to Outcome
    """

    poses: tuple[Enacted, ...]

    def before(self) -> Summary:
        """The bones before reduction."""
        return Summary.of([pose["all"].before for pose in self.poses])

    def recognised(self, road: Road, source: str = "all") -> Summary:
        """Recognised minus true pose of the mechanism."""
        return Summary.of([pose[source].recognised[road] for pose in self.poses])

    def measured(self, way: Way, source: str = "all") -> Summary:
        """Recognised minus the struts' pose, Eq. (31)."""
        return Summary.of([pose[source].measured[way] for pose in self.poses])

    def compensated(self, way: Way, source: str = "all") -> Summary:
        """Error of the mechanism's pose that the plan starts from."""
        return Summary.of([pose[source].compensated[way] for pose in self.poses])

    def after(self, way: Way, source: str = "all") -> Summary:
        """The bones after reduction."""
        return Summary.of([pose[source].after[way] for pose in self.poses])


@dataclass(frozen=True, eq=False)
class ExperimentStudy:
    """What was found.

    Attributes
    ----------
    settings : ExperimentSettings
    image : dict of str to ImageError
        Of each fit, over the balls of all rendered CTs.
    rendered : Run
        Poses with a CT.
    drawn : Run
        The larger run without.
    """

    settings: ExperimentSettings
    image: dict[str, ImageError]
    rendered: Run
    drawn: Run

    @property
    def runs(self) -> dict[str, Run]:
        """Both runs by name."""
        return {"rendered": self.rendered, "drawn": self.drawn}


def study_experiment(
    settings: ExperimentSettings | None = None, *, progress: Progress = silent
) -> ExperimentStudy:
    """Enact the model experiment on simulated CT and on drawn image errors.

    Parameters
    ----------
    settings : ExperimentSettings, optional
    progress : Progress

    Raises
    ------
    MissingLibrary
        If the paper's recipe for the balls cannot be run.
    Refused
        If a pose's balls cannot be found, numbered or recognised.

    Notes
    -----
    Source: Section 5.2. Departs: the CT is simulated, the end faces of the bones do not touch,
    and the error is known against the truth, not only against the struts.
    """
    settings = settings or ExperimentSettings()
    isosurface_finder()
    tasks = ((settings, number) for number in range(1, settings.poses + 1))
    done = list(_watched(_with_ct, tasks, settings, settings.poses, "simulated CTs", progress))
    image = measured([seen for seen, _ in done])
    tasks = ((settings, number, image) for number in range(1, settings.drawn + 1))
    drawn = _watched(_without_ct, tasks, settings, settings.drawn, "drawn poses", progress)
    return ExperimentStudy(settings, image, Run(tuple(pose for _, pose in done)), Run(tuple(drawn)))


def _watched(
    function: Any, tasks: Any, settings: ExperimentSettings, count: int, step: str,
    progress: Progress,
) -> Iterator[Any]:  # fmt: skip
    """Results in order, told as they come."""
    progress(step, 0.0)
    for number, result in enumerate(in_order(function, tasks, workers=settings.jobs), start=1):
        progress(step, number / count)
        yield result


def _with_ct(settings: ExperimentSettings, number: int) -> tuple[dict[str, Seen], Enacted]:
    trial = draw_trial(settings, number, rendered=True)
    seen = scan(trial)
    return seen, _enacted(trial, seen)


def _without_ct(settings: ExperimentSettings, number: int, image: dict[str, ImageError]) -> Enacted:
    trial = draw_trial(settings, number, rendered=False)
    return _enacted(trial, {fit: image[fit].draw(trial) for fit in FITS})


def _enacted(trial: Trial, seen: dict[str, Seen]) -> Enacted:
    outcomes = {"all": enact(trial, seen, ALL, roads=ROADS, ways=WAYS)}
    for name, sources in ALONE.items():
        outcomes[name] = enact(trial, seen, sources, roads=(PAPER, OURS), ways=BUDGET_WAYS)
    return outcomes
