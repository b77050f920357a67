"""What each step reads of the case: its faults, its hash, and a case that holds nothing else."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from hexafix.case import Case, CaseParts, case_from_document, draft_faults, parts_of
from hexafix.errors import Fault
from hexafix.presenter.history import Version
from hexafix.presenter.state import Step

ORDER = tuple(Step)

OWNERS: tuple[tuple[str, Step, Step], ...] = (
    ("image", Step.LOAD, Step.LOAD),
    ("markers.ball_diameter_mm", Step.MARKERS, Step.MARKERS),
    ("marker_edits", Step.MARKERS, Step.MARKERS),
    ("markers.proximal", Step.NUMBERING, Step.NUMBERING),
    ("markers.distal", Step.NUMBERING, Step.NUMBERING),
    ("markers", Step.MARKERS, Step.MARKERS),
    ("numbering", Step.NUMBERING, Step.POSES),
    ("limb", Step.LOAD, Step.NUMBERING),
    ("fixator", Step.LOAD, Step.NUMBERING),
    ("strut_readings_mm", Step.READINGS, Step.READINGS),
    ("correction", Step.CORRECTION, Step.CORRECTION),
    ("schedule", Step.SCHEDULE, Step.SCHEDULE),
    ("case_id", Step.LOAD, Step.SCHEDULE),
)
"""Where a fault lies, the step that shows it, and the first step that cannot run with it."""

OPTIONAL = ("strut_readings_mm", "correction", "schedule", "numbering")
"""Parts that earlier steps do without while they are missing or wrong."""


def owner(where: str | None) -> tuple[Step, Step]:
    """The step that shows a fault at this place, and the first step that it stops."""
    for prefix, shows, stops in OWNERS:
        if where is not None and (
            where == prefix or where.startswith((f"{prefix}.", f"{prefix}["))
        ):
            return shows, stops
    return Step.LOAD, Step.SCHEDULE


@dataclass(frozen=True)
class Inputs:
    """One version of the case as the steps read it; made on one thread, used on any.

    Attributes
    ----------
    version : Version
    """

    version: Version

    @property
    def folder(self) -> Path:
        """What relative paths are relative to."""
        return self.version.folder or Path(Path.cwd().anchor)

    @cached_property
    def faults(self) -> tuple[Fault, ...]:
        """Everything that is missing or wrong in the case."""
        return draft_faults(self.version.raw, folder=self.folder)

    @cached_property
    def parts(self) -> CaseParts:
        """What is right of the case, part by part."""
        return parts_of(self.version.raw, folder=self.folder)

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
    def series_instance_uid(self) -> str | None:
        """The user's choice among several series."""
        return self.version.content["image"].get("series_instance_uid")

    @property
    def ball_diameter_mm(self) -> float:
        """The balls' diameter."""
        return self.version.content["markers"]["ball_diameter_mm"]

    @property
    def assigned(self) -> dict[int, Any] | None:
        """The ball centres that the user assigned, LPS mm; None for automatic numbering."""
        given = self.version.content.get("numbering")
        return None if given is None else {int(number): at for number, at in given.items()}

    @property
    def marker_edits(self) -> Mapping[str, Any]:
        """The user's added and removed balls."""
        given = self.version.content.get("marker_edits") or {}
        return {key: given.get(key) or [] for key in ("added_lps_mm", "removed_lps_mm")}

    def read_by(self, step: Step) -> dict[str, Any]:
        """Exactly what a step reads of the case, besides the image's content."""
        if step == Step.LOAD:
            return {"path": str(self.image_path), "series": self.series_instance_uid}
        if step == Step.MARKERS:
            return {"diameter": self.ball_diameter_mm, "edits": self.marker_edits}
        if step in (Step.SCHEDULE, Step.EXPORT):
            return {
                "raw": hashlib.sha256(self.version.raw).hexdigest(),
                "fixator": self._fixator_file,
                "relaxed": self.version.relaxed,
            }
        return {
            "case": self._case_document(step),
            "assigned": self.version.content.get("numbering"),
            "fixator": self._fixator_file,
            "relaxed": self.version.relaxed and step != Step.NUMBERING,
        }

    def fingerprint(self, step: Step) -> str | None:
        """Hash of what a step reads of the case; None while something it needs is missing."""
        if self.faults_before(step):
            return None
        text = json.dumps([step.value, self.read_by(step)], sort_keys=True, allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def key(self, step: Step, image: str | None) -> str | None:
        """Hash of everything a step's result depends on; None while that is not known.

        Parameters
        ----------
        step : Step
        image : str or None
            Identity of the image's content, once it was read.
        """
        fingerprint = self.fingerprint(step)
        if fingerprint is None or image is None:
            return None
        return hashlib.sha256(f"{fingerprint} {image}".encode()).hexdigest()

    def case_for(self, step: Step) -> Case:
        """A case that holds what a step reads, and nothing else."""
        if step in (Step.SCHEDULE, Step.EXPORT):
            return case_from_document(self.version.raw, folder=self.folder, needs_image=False)
        raw = json.dumps(self._case_document(step)).encode()
        return case_from_document(raw, folder=self.folder, needs_image=False, plannable=False)

    def _case_document(self, step: Step) -> dict[str, Any]:
        given = self.version.content
        wrong = {owner(fault.where)[0] for fault in self.faults}
        document = {
            "schema_version": given["schema_version"],
            "case_id": "case",
            "limb": given["limb"],
            "image": {"path": "image", "series_instance_uid": None},
            "fixator": given["fixator"],
            "markers": given["markers"],
            "numbering": given.get("numbering"),
        }
        if given.get("marker_edits") is not None:
            document["marker_edits"] = given["marker_edits"]
        automatic = document["numbering"] is None
        if step == Step.NUMBERING:
            document["numbering"] = None  # judged beside the case: it may be half done
        late = step in (Step.READINGS, Step.CORRECTION)
        if Step.READINGS not in wrong and (late or automatic):
            document["strut_readings_mm"] = given.get("strut_readings_mm")
        if late and Step.SCHEDULE not in wrong:
            document["schedule"] = given.get("schedule")
        if step == Step.CORRECTION:
            document["correction"] = given.get("correction")
        return document

    @property
    def _fixator_file(self) -> str | None:
        """Hash of the fixator's file, where the case names one beside it."""
        given = self.version.content.get("fixator")
        if not isinstance(given, str):
            return None
        try:
            return hashlib.sha256((self.folder / given).read_bytes()).hexdigest()
        except (OSError, ValueError):
            return None
