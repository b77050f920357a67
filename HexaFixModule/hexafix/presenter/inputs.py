"""What each step reads of the case: its faults, its hash, and a case that holds nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from hexafix.case import (
    Case,
    CaseParts,
    case_from_document,
    draft_faults,
    parts_of,
)
from hexafix.errors import Fault
from hexafix.presenter.history import Version
from hexafix.presenter.shape import shaped
from hexafix.presenter.state import Step

ORDER = tuple(Step)

OWNERS: tuple[tuple[str, Step, Step, str], ...] = (
    ("image", Step.LOAD, Step.LOAD, "choose the CT"),
    (
        "markers.ball_diameter_mm",
        Step.MARKERS,
        Step.MARKERS,
        "give the diameter of the marker balls",
    ),
    ("marker_edits", Step.MARKERS, Step.MARKERS, ""),
    ("markers.proximal", Step.NUMBERING, Step.NUMBERING, "give the layout of the proximal ring"),
    ("markers.distal", Step.NUMBERING, Step.NUMBERING, "give the layout of the distal ring"),
    ("markers", Step.MARKERS, Step.MARKERS, "give diameter and layout of the marker balls"),
    ("numbering", Step.NUMBERING, Step.POSES, "give every number a ball"),
    ("limb", Step.LOAD, Step.POSES, "give side and bone of the limb"),
    ("fixator", Step.LOAD, Step.POSES, "choose the fixator"),
    ("strut_readings_mm", Step.READINGS, Step.READINGS, "read all six struts"),
    ("correction", Step.CORRECTION, Step.CORRECTION, "give the correction"),
    ("schedule", Step.SCHEDULE, Step.SCHEDULE, "give the schedule's start date and rules"),
    ("case_id", Step.LOAD, Step.SCHEDULE, "name the case"),
)
"""A place in the case, the step that shows its faults, the first step that they stop, and what to
do while it is missing."""

NO_IMAGE = "image"
"""Stands for the image in a step's own case: its content is hashed beside the case."""


def owner(where: str | None) -> tuple[Step, Step, str]:
    """The step that shows a fault at this place, the first one it stops, and what is to do."""
    for prefix, shows, stops, words in OWNERS:
        if where is not None and (
            where == prefix or where.startswith((f"{prefix}.", f"{prefix}["))
        ):
            return shows, stops, words
    return Step.LOAD, Step.SCHEDULE, ""


def is_missing(fault: Fault) -> bool:
    """Whether a fault only says that something was not entered yet."""
    if fault.code in ("needed-for-a-plan", "number-missing", "missing"):
        return True
    return fault.code == "case-value" and fault.value in (None, "None")


@dataclass(frozen=True)
class Inputs:
    """One version of the case as the steps read it; made on one thread, used on any.

    Attributes
    ----------
    version : Version
    stamp : str
        Size and time of the image's files when they were looked at last.
    fixator_file : str
        Hash of the fixator's own file, where the case names one, when it was looked at last.
    readings_asked : bool
        Whether the layouts leave an automatic numbering a choice, so that the readings settle it;
        else neither numbering nor poses depend on them.
    """

    version: Version
    stamp: str = ""
    fixator_file: str = ""
    readings_asked: bool = False

    @property
    def folder(self) -> Path:
        """What relative paths are relative to."""
        return self.version.folder or Path(Path.cwd().anchor)

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """Everything that is missing or wrong in the case, once for each place that is missing."""
        found: dict[Any, Fault] = {}
        for fault in draft_faults(self.version.raw, folder=self.folder):
            words = owner(fault.where)[2]
            if is_missing(fault) and words and fault.code != "number-missing":
                where = next(prefix for prefix, *_, text in OWNERS if text == words)
                fault = replace(fault, code="missing", what="not given yet", value=None)
                fault = replace(fault, where=where, next_step=words, limit=None)
            found[fault.code, fault.where, fault.what, fault.value] = fault
        return tuple(found.values())

    def changed(self, **changes: Any) -> Inputs:
        """The same version seen with other files or questions; its faults are found only once."""
        made = replace(self, **changes)
        made.__dict__["faults"] = self.faults
        return made

    @cached_property
    def document(self) -> Mapping[str, Any]:
        """A copy of the case document for doors to look at: every part of its kind."""
        return shaped(self.version.copy())

    @cached_property
    def parts(self) -> CaseParts:
        """What is right of what `Step.NUMBERING` reads: perhaps not all is there yet."""
        raw = json.dumps(self._case_document(Step.NUMBERING)).encode()
        return parts_of(raw, folder=self.folder)

    @property
    def readings_could_settle(self) -> bool:
        """Whether there are readings for an automatic numbering to ask."""
        given = self.version.content
        return not given.get("numbering") and given.get("strut_readings_mm") is not None

    def faults_shown_at(self, step: Step) -> tuple[Fault, ...]:
        """The faults that belong to a step."""
        return tuple(fault for fault in self.faults if owner(fault.where)[0] == step)

    def faults_before(self, step: Step) -> tuple[Fault, ...]:
        """The faults that stop a step."""
        at = ORDER.index(step)
        return tuple(f for f in self.faults if ORDER.index(owner(f.where)[1]) <= at)

    @property
    def image_path(self) -> Path:
        """The image, absolute."""
        return (self.folder / self.version.content["image"]["path"]).resolve()

    @property
    def fixator_path(self) -> Path | None:
        """The fixator's own file, where the case may name one."""
        given = self.version.content.get("fixator")
        return self.folder / given if isinstance(given, str) else None

    @property
    def series_instance_uid(self) -> str | None:
        """The user's choice among several series."""
        return self.version.content["image"].get("series_instance_uid")

    @property
    def ball_diameter_mm(self) -> float:
        """The balls' diameter."""
        return self.version.content["markers"]["ball_diameter_mm"]

    @property
    def marker_edits(self) -> dict[str, list[Any]]:
        """The user's added and removed balls, points in LPS mm."""
        given = self.version.content.get("marker_edits") or {}
        return {key: given.get(key) or [] for key in ("added_lps_mm", "removed_lps_mm")}

    def read_by(self, step: Step) -> dict[str, Any]:
        """Exactly what a step reads of the case, besides the image's content."""
        if step == Step.LOAD:
            uid = self.series_instance_uid
            return {"path": str(self.image_path), "series": uid, "stamp": self.stamp}
        if step == Step.MARKERS:
            return {"diameter": self.ball_diameter_mm, "edits": self.marker_edits}
        if step in (Step.SCHEDULE, Step.EXPORT):
            return {
                "raw": hashlib.sha256(self.version.raw).hexdigest(),
                "case": self.version.sha256,
                "fixator": self.fixator_file,
                "relaxed": self.version.relaxed,
            }
        return {
            "case": self._case_document(step),
            "fixator": self.fixator_file,
            "relaxed": self.version.relaxed and step != Step.NUMBERING,
        }

    def fingerprint(self, step: Step) -> str | None:
        """Hash of what a step reads of the case; None while something it needs is missing."""
        return self._fingerprints[step]

    @cached_property
    def _fingerprints(self) -> dict[Step, str | None]:
        return {
            step: None if self.faults_before(step) else _hash([step.value, self.read_by(step)])
            for step in ORDER
        }

    def key(self, step: Step, image: str | None) -> str | None:
        """Hash of everything a step's result depends on; None while that is not known.

        Parameters
        ----------
        step : Step
        image : str or None
            Identity of the image's content, once it was read.
        """
        fingerprint = self.fingerprint(step)
        return None if fingerprint is None or image is None else _hash([fingerprint, image])

    def search_key(self, image: str) -> str:
        """Hash of what the search for balls depends on, before the user's edits of them."""
        edits = {"added_lps_mm": [], "removed_lps_mm": []}
        read = {"diameter": self.ball_diameter_mm, "edits": edits}
        return _hash([_hash([Step.MARKERS.value, read]), image])

    @property
    def layout_key(self) -> str:
        """Hash of what the layout check depends on."""
        markers = self.version.content.get("markers")
        return _hash([markers])

    def case_for(self, step: Step) -> Case:
        """A case that holds what a step reads, and nothing else."""
        if step in (Step.SCHEDULE, Step.EXPORT):
            case = case_from_document(self.version.raw, folder=self.folder, needs_image=False)
            return replace(case, case_sha256=self.version.sha256)
        raw = json.dumps(self._case_document(step)).encode()
        return case_from_document(raw, folder=self.folder, needs_image=False, plannable=False)

    def _case_document(self, step: Step) -> dict[str, Any]:
        """The parts of the case that a step reads; parts it can do without only where right."""
        given = self.version.content
        wrong = {owner(fault.where)[0] for fault in self.faults}
        kept = ["markers", "marker_edits", "numbering", "fixator"]
        if step != Step.NUMBERING:
            kept.append("limb")
        late = step in (Step.READINGS, Step.CORRECTION)
        if Step.READINGS not in wrong and (late or self.readings_asked):
            kept.append("strut_readings_mm")
        if step == Step.CORRECTION:
            kept.append("correction")
            if Step.SCHEDULE not in wrong:
                kept.append("schedule")
        image = {"path": NO_IMAGE, "series_instance_uid": None}
        made = {"schema_version": 2, "case_id": "case", "image": image}
        return {**made, **{key: given[key] for key in kept if key in given}}


def _hash(value: Any) -> str:
    text = json.dumps(value, sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def stamp_of(path: Path) -> str:
    """Names, sizes and times of an image's files: another stamp asks for another look."""
    try:
        files = sorted(path.iterdir()) if path.is_dir() else [path]
        return _hash([[f.name, f.stat().st_size, f.stat().st_mtime_ns] for f in files])
    except OSError:
        return ""


def file_hash(path: Path) -> str:
    """Hash of a file's content; empty where there is none."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except (OSError, ValueError):
        return ""
