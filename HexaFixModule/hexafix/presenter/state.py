"""What a door shows: frozen values, every text ready to be read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Any, Literal

from hexafix.errors import Fault


class Step(StrEnum):
    """The steps of the workflow, in order."""

    LOAD = "load"
    MARKERS = "markers"
    NUMBERING = "numbering"
    POSES = "poses"
    READINGS = "readings"
    CORRECTION = "correction"
    SCHEDULE = "schedule"
    EXPORT = "export"


class StepState(StrEnum):
    """How a step stands; see `hexafix.presenter`."""

    WAITING = "waiting"
    READY = "ready"
    RUNNING = "running"
    DONE = "done"
    STALE = "stale"
    REFUSED = "refused"


TITLES = MappingProxyType(
    {
        Step.LOAD: "Load the CT",
        Step.MARKERS: "Find the marker balls",
        Step.NUMBERING: "Number the balls",
        Step.POSES: "Ring poses and layout",
        Step.READINGS: "Strut readings",
        Step.CORRECTION: "Correction",
        Step.SCHEDULE: "Schedule",
        Step.EXPORT: "Prescription",
    }
)
"""What the steps are called on screen."""

Kind = Literal["refused", "error", "warning", "info"]


@dataclass(frozen=True, slots=True)
class Banner:
    """One message with its next step.

    Attributes
    ----------
    id : str
        The same message keeps its id from snapshot to snapshot.
    kind : {"refused", "error", "warning", "info"}
    code : str
        Code of the fault, kebab-case.
    title, message : str
    next_step : str
        What the user can do; empty where nothing is to be done.
    hazard : str
        Row of the hazard table, or empty.
    step : Step or None
        The step it belongs to.
    """

    id: str
    kind: Kind
    code: str
    title: str
    message: str
    next_step: str = ""
    hazard: str = ""
    step: Step | None = None


@dataclass(frozen=True, slots=True)
class Table:
    """A table as it is shown.

    Attributes
    ----------
    columns : tuple of str
        Heads with units.
    rows : tuple of tuple of str
    alerts : tuple of str
        One for each row: why it needs attention, or empty.
    stale : bool
        Whether it shows a result of older inputs: to be greyed.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...] = ()
    alerts: tuple[str, ...] = ()
    stale: bool = False


@dataclass(frozen=True, slots=True)
class StepView:
    """One step as it is shown."""

    step: Step
    title: str
    state: StepState
    summary: str
    faults: tuple[Fault, ...] = ()


@dataclass(frozen=True, slots=True)
class Snapshot:
    """Everything a door shows at one moment.

    Attributes
    ----------
    case_id : str
    case_path : str or None
        The case file, once opened or saved.
    edited : bool
        Whether something is not saved.
    can_undo, can_redo : bool
    undo_label, redo_label : str
        What would be undone or redone.
    steps : tuple of StepView
        All eight, in order.
    current : Step
        The step the user looks at.
    busy : bool
        Whether work is under way.
    progress : (str, float) or None
        What is being done, and how far in [0, 1].
    banners : tuple of Banner
        The gravest first.
    document : mapping
        The case document; changing it changes nothing.
    tables : mapping of str to Table
    can_export : bool
    export_blocked_by : str
        Why there can be no export now; empty if there can.
    export_folder : str or None
        Where the shown prescription was exported to.
    confirmed : mapping of str to bool
        ``side``, ``readings``, ``ring_front``, ``relaxed_layout``: what the user has confirmed;
        ``readings_needed``, ``ring_front_needed``: whether that is asked for in this case.
    """

    case_id: str = ""
    case_path: str | None = None
    edited: bool = False
    can_undo: bool = False
    undo_label: str = ""
    can_redo: bool = False
    redo_label: str = ""
    steps: tuple[StepView, ...] = ()
    current: Step = Step.LOAD
    busy: bool = False
    progress: tuple[str, float] | None = None
    banners: tuple[Banner, ...] = ()
    document: Mapping[str, Any] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    can_export: bool = False
    export_blocked_by: str = ""
    export_folder: str | None = None
    confirmed: Mapping[str, bool] = field(default_factory=dict)

    def view(self, step: Step) -> StepView:
        """The view of one step."""
        return next(view for view in self.steps if view.step == step)
