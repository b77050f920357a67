"""The presenter: what all doors show and do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hexafix.presenter import casefile
from hexafix.presenter.core import NEW_CASE, action
from hexafix.presenter.editing import Document, Edits
from hexafix.presenter.history import History, Version, document_bytes
from hexafix.presenter.inputs import Inputs
from hexafix.presenter.state import Step
from hexafix.presenter.work import Work


class Presenter(Edits, Work):
    """One case at a workstation, whatever the toolkit.

    Parameters
    ----------
    engine : Engine, optional
        The pipeline's functions; the pipeline itself if not given.
    post : callable, optional
        Runs a callable on the door's own thread; at once, on the working thread, if not given.
    threaded : bool
        Whether work leaves the calling thread.

    Notes
    -----
    Every action returns whether it was done; what was wrong stands in the snapshot's banners.
    """

    @action
    def open_case(self, path: str | Path) -> None:
        """Open a case file, complete or a draft, or the ``case.json`` of a folder."""
        file, version = casefile.read_case_file(Path(path))
        self._new(version, file)

    @action
    def new_case(self) -> None:
        """Begin a case."""
        self._new(Version(document_bytes(NEW_CASE)), None)

    def _new(self, version: Version, file: Path | None) -> None:
        if self.job is not None:
            self.job.cancel()
        self.history = History(version)
        self.inputs = Inputs(version)
        self.case_path = file
        self.saved = version.raw if file else None
        self.results.clear()
        self.current = Step.LOAD
        self.side_confirmed = None
        self.readings_repeated = None
        given = version.content.get("strut_readings_mm")
        self.readings_given = list(given) if file and isinstance(given, list) else None
        self.series, self.exported = None, None

    @action
    def save_case(self, path: str | Path | None = None) -> None:
        """Save the case, complete or a draft; relative paths are made to lead from there."""
        target = Path(path) if path is not None else self.case_path
        if target is None:
            raise casefile.no_name()
        target = target.resolve()
        if target.is_dir():
            target = target / "case.json"
        version = casefile.moved(self.version, target.parent)
        own = target == self.case_path
        casefile.write_case_file(target, version.raw, expected=self.saved if own else None)
        self.history.replace(version)
        self.case_path, self.saved = target, version.raw

    @action
    def list_series(self, path: str | Path) -> None:
        """List the series of a DICOM folder in the table ``series``."""
        self.series = self.engine.image_series(Path(path))

    @action
    def load_image(self, path: str | Path, series_instance_uid: str | None = None) -> None:
        """Write an image into the case and read it."""
        given = casefile.path_in(self.version.folder, Path(path).resolve())

        def change(document: Document) -> None:
            document["image"] = {"path": given, "series_instance_uid": series_instance_uid}

        self._edit("choose the image", change)
        self.inputs = Inputs(replace(self.version))
        self.inputs = Inputs(self.version)
        fingerprint = self.inputs.fingerprint(Step.LOAD)
        self.images.pop(fingerprint or "", None)
        self._start(Step.LOAD)
