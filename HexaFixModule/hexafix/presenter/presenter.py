"""The presenter: what all doors show and do."""

from __future__ import annotations

from pathlib import Path

from hexafix.errors import InputError
from hexafix.presenter import casefile
from hexafix.presenter.balls import BallEdits
from hexafix.presenter.core import NEW_CASE, action
from hexafix.presenter.editing import Document
from hexafix.presenter.history import History, Version, document_bytes
from hexafix.presenter.state import Step
from hexafix.presenter.work import Work


class Presenter(BallEdits, Work):
    """One case at a workstation, whatever the toolkit.

    Every action returns whether it was done and raises nothing; what was wrong stands in the
    banners of `snapshot`, of which `changed` tells each new one.

    Parameters
    ----------
    engine : Engine, optional
        The pipeline's functions; the pipeline itself if not given.
    post : callable, optional
        Runs a callable on the door's own thread; at once, on the working thread, if not given.
    threaded : bool
        Whether work leaves the calling thread.
    """

    @action
    def open_case(self, path: str | Path) -> None:
        """Open a case file, complete or a draft, or the ``case.json`` of a folder."""
        file, raw, version = casefile.read_case_file(Path(path))
        self._take(version, file, raw)

    @action
    def new_case(self) -> None:
        """Begin a case."""
        self._take(Version(document_bytes(NEW_CASE)))

    def _take(self, version: Version, file: Path | None = None, saved: bytes | None = None) -> None:
        """Begin work on a version, of a file that holds the bytes `saved` or of none."""
        if self.job is not None:
            self.job.cancel()
        self.history = History(version)
        self.case_path, self.saved = file, saved
        self.results.clear_shown()
        self.current = Step.LOAD
        self.side_answer, self.readings_repeated = None, None
        given = version.content.get("strut_readings_mm")
        self.readings_opened = given if saved == version.raw else None
        self.series, self.exported = None, None
        self.look_again()

    @action
    def save_case(self, path: str | Path | None = None) -> None:
        """Save the case, complete or a draft; its relative paths then lead from the new place.

        Parameters
        ----------
        path : path, optional
            A file, or a folder that gets a ``case.json``; where the case was opened or saved last
            if not given.
        """
        target = self.case_path if path is None else Path(path).resolve()
        if target is None:
            raise InputError.of(
                "no-case-file",
                "the case has no file yet",
                next_step="choose where the case is saved",
            )
        target = target / "case.json" if target.is_dir() else target
        version = casefile.moved(self.version, target.parent)
        own = target == self.case_path
        raw = casefile.file_bytes(version, typed_once=self.typed_once)
        casefile.write_case_file(target, raw, expected=self.saved if own else None)
        self.history.replace(version)
        self.case_path, self.saved = target, raw
        self.new_version()

    @action
    def load_image(self, path: str | Path, series_instance_uid: str | None = None) -> None:
        """Write an image into the case and read it; chosen again, it is read again."""
        given = casefile.path_in(self.version.folder, Path(path).resolve())
        image = {"path": given, "series_instance_uid": series_instance_uid}

        def change(document: Document) -> Document:
            return {**document, "image": image}

        self.changed_document("choose the image", change)
        self.look_again()
        self.images.pop(self.inputs.fingerprint(Step.LOAD) or "", None)
        self.start(Step.LOAD)
