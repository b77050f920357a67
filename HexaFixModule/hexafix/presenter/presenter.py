"""The presenter: what all doors show and do."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from hexafix.errors import InputError
from hexafix.presenter import casefile, scenes
from hexafix.presenter.balls import BallEdits
from hexafix.presenter.compute import loaded
from hexafix.presenter.core import NEW_CASE, action
from hexafix.presenter.editing import Document
from hexafix.presenter.history import History, Version, document_bytes
from hexafix.presenter.inputs import stamp_of
from hexafix.presenter.state import Step
from hexafix.presenter.work import Work
from hexafix.presenter.worker import Job, cancelled


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
    read_scene : callable, optional
        Reads a scene's file (`hexafix.mrml` has it); without it no scene is opened.
    """

    @action
    def open_case(self, path: str | Path) -> None:
        """Open a case file, complete or a draft, the ``case.json`` of a folder, or a scene."""
        if scenes.is_scene(Path(path)):
            self._open_scene(Path(path).resolve())
            return
        file, raw, version = casefile.read_case_file(Path(path))
        self._stop()
        self._take(version, file, raw)

    @action
    def open_scene(self, path: str | Path) -> None:
        """Open a scene (``.mrb``): the case as it was saved, its CT, and what was computed of both.

        The file is read on the working thread. If any part of it is refused, or the open case is
        edited meanwhile, that case stays as it is.
        """
        self._open_scene(Path(path).resolve())

    def _open_scene(self, file: Path) -> None:
        read_scene, before = self.read_scene, self.version
        if read_scene is None:
            raise scenes.no_scenes()

        def work(job: Job) -> None:
            stamp = stamp_of(file)
            content = read_scene(file, progress=job.progress)
            opened = scenes.opened(content, file, self.engine)
            self.post(lambda: self._take_scene(job, opened, before=before, stamp=stamp))

        self._begin(work, Step.LOAD)

    def _take_scene(
        self, job: Job, opened: scenes.OpenedScene, *, before: Version, stamp: str
    ) -> None:
        """On the door's thread: go on with a scene, unless anything changed since it was read."""
        version, file = opened.version, opened.file
        if job is not self.job or job.stopping:
            self.tell(*cancelled().faults, kind="info")
            return
        if self.version is not before or stamp_of(file) != stamp:
            self.tell(scenes.CHANGED_MEANWHILE, kind="error")
            return
        self._take(version)
        if not opened.typed_once:
            self.readings_opened = version.content.get("strut_readings_mm")
        if opened.volume is not None and self.inputs.stamp == stamp:
            self._store(self.inputs, loaded(self.inputs, opened.volume, opened.image))
        self.current, self._split_fraction = opened.step, opened.split_fraction
        self._pending = opened.computed_to

    def case_for_scene(self) -> tuple[dict[str, Any], str | None]:
        """The case as a scene holds it, and its hash where a reopened scene goes on with it."""
        with self.lock:
            return scenes.case_for_scene(self.version, typed_once=self.typed_once)

    def scene_written(self, path: str | Path, volume: Any) -> None:
        """A scene with this CT was written: it is not read again where it is the case's own file.

        Parameters
        ----------
        path : path
        volume : Volume
            `value(Step.LOAD)` when the scene was taken; another CT stays to be read.
        """
        with self.lock:
            read, inputs = self.result(Step.LOAD), self.inputs
            if self.closed or read is None or read.value is not volume or volume is None:
                return
            if inputs.image_path != Path(path).resolve():
                return
            self.look_again()
            self._store(self.inputs, loaded(self.inputs, volume, read.document))
            self.refresh()

    @action
    def new_case(self) -> None:
        """Begin a case."""
        self._stop()
        self._take(Version(document_bytes(NEW_CASE)))

    def _stop(self) -> None:
        if self.job is not None:
            self.job.cancel()

    def _take(self, version: Version, file: Path | None = None, saved: bytes | None = None) -> None:
        """Begin work on a version, of a file that holds the bytes `saved` or of none."""
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
        scenes.require_no_scene(target)
        version = replace(casefile.moved(self.version, target.parent), origin=None)
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
