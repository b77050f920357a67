"""The state behind the workstation: versions, results, what is asked of the user, the snapshot."""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Concatenate, ParamSpec, TypeVar

from hexafix.errors import Fault
from hexafix.presenter import casefile, notices, view
from hexafix.presenter.compute import compute, faults_of_error, kind_of
from hexafix.presenter.engine import Engine, pipeline_engine
from hexafix.presenter.history import History, Version, document_bytes
from hexafix.presenter.inputs import ORDER, Inputs, file_hash, stamp_of
from hexafix.presenter.results import Result, Results
from hexafix.presenter.scenes import ReadScene, with_scenes
from hexafix.presenter.signal import Signal
from hexafix.presenter.state import Banner, Kind, Snapshot, Step, Table
from hexafix.presenter.worker import Job, Post

NEW_CASE: Mapping[str, Any] = {"schema_version": 2, "ring_front_confirmed": False}
"""What a new case holds: nothing is guessed, and the rings' front is asked for (H22)."""

LIVE = (
    (Step.MARKERS, Step.LOAD),
    (Step.NUMBERING, Step.MARKERS),
    (Step.NUMBERING, Step.MARKERS),
    (Step.READINGS, Step.POSES),
    (Step.CORRECTION, Step.POSES),
)
"""Steps that take milliseconds and follow every edit at once, with the step they need: the balls
after one search for them, the numbering by the layouts alone and then, if need be, by readings."""

P = ParamSpec("P")
Self = TypeVar("Self", bound="Core")


def action(method: Callable[Concatenate[Self, P], Any]) -> Callable[Concatenate[Self, P], bool]:
    """A user's action: what is wrong becomes a banner; returns whether it was done."""

    @functools.wraps(method)
    def wrapped(self: Self, /, *args: P.args, **kwargs: P.kwargs) -> bool:
        with self.lock:
            if self.closed:
                return False
            self.notices.clear()
            try:
                method(self, *args, **kwargs)
                done = True
            except Exception as error:
                self.tell(*faults_of_error(error), kind=kind_of(error))
                done = False
            self.refresh()
            return done

    return wrapped


class Core:
    """What all parts of the presenter share; `lock` guards every attribute."""

    def __init__(
        self,
        *,
        engine: Engine | None = None,
        post: Post | None = None,
        threaded: bool = True,
        read_scene: ReadScene | None = None,
    ) -> None:
        self.lock = threading.RLock()
        self.changed = Signal()
        self.notices: list[Banner] = []
        self.results = Results()
        self.images: dict[str, str] = {}
        """Identity of the image that each fingerprint of `Step.LOAD` gave."""
        self.history = History(Version(document_bytes(NEW_CASE)))
        self.inputs = Inputs(self.history.present)
        self.stamps: dict[Path, str] = {}
        self.case_path: Path | None = None
        self.saved: bytes | None = None
        self.current = Step.LOAD
        self.side_answer: tuple[str, str] | None = None
        """The side given the second time, and the image it was given for."""
        self.readings_opened: Any = None
        """The readings of the file that was opened, unless they were typed once."""
        self.readings_repeated: list[Any] | None = None
        self.series: Mapping[str, Any] | None = None
        self.layout: tuple[str, Mapping[str, Any] | None] = ("", None)
        self.exported: tuple[str, str] | None = None
        self.job: Job | None = None
        self.running: Step | None = None
        self.progress: tuple[str, float] | None = None
        self.closed = False
        self.tables: dict[Any, dict[str, Table]] = {}
        self.read_scene = read_scene
        self._engine = engine if engine is None else self._with_scenes(engine)
        self._threaded = threaded
        self._post = post
        self._split_fraction = 0.5
        self._snapshot = Snapshot()
        self.refresh()

    @property
    def engine(self) -> Engine:
        """The pipeline, or what stands for it."""
        if self._engine is None:
            self._engine = self._with_scenes(pipeline_engine())
        return self._engine

    def _with_scenes(self, engine: Engine) -> Engine:
        return engine if self.read_scene is None else with_scenes(engine, self.read_scene)

    @property
    def snapshot(self) -> Snapshot:
        """What is to be shown now."""
        return self._snapshot

    @property
    def split_fraction(self) -> float:
        """Where the bone is cut for the picture, from the distal (0) to the proximal ring (1)."""
        return self._split_fraction

    @split_fraction.setter
    def split_fraction(self, fraction: float) -> None:
        with self.lock:
            self._split_fraction = min(max(float(fraction), 0.0), 1.0)
            self.refresh()

    def post(self, work: Callable[[], Any]) -> None:
        """Run `work` on the door's thread, under the lock, unless the door was closed."""

        def locked() -> None:
            with self.lock:
                if not self.closed:
                    work()

        if self.closed:
            return
        if self._post is None:
            locked()
        else:
            self._post(locked)

    # ------------------------------------------------------------ what is fresh (H40)

    @property
    def version(self) -> Version:
        """The case as it is now."""
        return self.history.present

    @property
    def image(self) -> str | None:
        """Identity of the present image, once it was read."""
        fingerprint = self.inputs.fingerprint(Step.LOAD)
        return None if fingerprint is None else self.images.get(fingerprint)

    def key(self, step: Step) -> str | None:
        """Hash of what the step's result depends on now; None while that is not known."""
        return self.inputs.key(step, self.image)

    def result(self, step: Step) -> Result | None:
        """The result of exactly the present inputs, done or refused."""
        return self.results.of(step, self.key(step))

    def is_done(self, step: Step) -> bool:
        """Whether the step has a result of the present inputs that nothing refuses."""
        found = self.result(step)
        return found is not None and found.done

    def is_fresh(self, step: Step | str) -> bool:
        """Whether the step's value belongs to the present inputs."""
        with self.lock:
            found = self.result(Step(step))
            return found is not None and found.value is not None

    def value(self, step: Step | str) -> Any:
        """The newest value of a step, fresh or of older inputs; None if there is none."""
        with self.lock:
            found = self.result(Step(step))
            if found is None or found.value is None:
                found = self.results.shown(Step(step))
            return None if found is None else found.value

    @property
    def edited(self) -> bool:
        """Whether something is not saved."""
        if self.saved is None:
            return self.history.can_undo
        return casefile.file_bytes(self.version, typed_once=self.typed_once) != self.saved

    @property
    def typed_once(self) -> bool:
        """Whether the readings were typed here and not yet repeated (H24)."""
        given = self.version.content.get("strut_readings_mm")
        return given is not None and given not in (self.readings_opened, self.readings_repeated)

    @property
    def side(self) -> str | None:
        """The limb's side in the case."""
        limb = self.version.content.get("limb")
        side = limb.get("side") if isinstance(limb, Mapping) else None
        return side if isinstance(side, str) else None

    @property
    def side_image(self) -> str:
        """The image that an answer about the side is given for: another CT is asked for anew."""
        if self.inputs.faults_before(Step.LOAD):
            return ""
        return f"{self.inputs.image_path} {self.inputs.series_instance_uid}"

    # ------------------------------------------------------------ changes

    def tell(self, *faults: Fault, kind: Kind, step: Step | None = None) -> None:
        """Show faults until the next action."""
        self.notices += [notices.banner(fault, kind=kind, step=step) for fault in faults]

    def look_again(self) -> None:
        """Look at the files of image and fixator anew: another program may have changed them."""
        self.stamps.clear()
        self.inputs = self._present_inputs()
        self.update_inputs()

    def new_version(self) -> None:
        """The present version has changed: work on what is past is stopped."""
        before, self.inputs = self.inputs, self._present_inputs()
        self.update_inputs()
        step, job = self.running, self.job
        if job is None or step is None:
            return
        if before.fingerprint(step) != self.inputs.fingerprint(step):
            job.skip()

    def update_inputs(self) -> None:
        """Let `inputs` say whether the readings settle the numbering."""
        inputs = self.inputs
        if inputs.readings_asked or not inputs.readings_could_settle:
            return
        by_layout = self.results.of(Step.NUMBERING, inputs.key(Step.NUMBERING, self.image))
        if by_layout is not None and not by_layout.done:
            self.inputs = inputs.changed(readings_asked=True)

    def _present_inputs(self) -> Inputs:
        """The present version with the files that it names."""
        inputs = Inputs(self.history.present)
        stamp = ""
        if not inputs.faults_before(Step.LOAD):
            stamp = self._looked_at(inputs.image_path, stamp_of)
        fixator = self._looked_at(inputs.fixator_path, file_hash)
        return inputs.changed(stamp=stamp, fixator_file=fixator)

    def _looked_at(self, path: Path | None, look: Callable[[Path], str]) -> str:
        if path is None:
            return ""
        if path not in self.stamps:
            self.stamps[path] = look(path)
        return self.stamps[path]

    def refresh(self) -> None:
        """Bring live steps up to date and hand out a new snapshot."""
        if self.closed:
            return
        self._live()
        for step in ORDER:
            found = self.result(step)
            if found is not None and found.value is not None:
                self.results.show(found)
        try:
            self._snapshot = view.snapshot_of(self)
        except Exception as error:
            self._snapshot = view.without_content(self._snapshot, error, busy=self.job is not None)
        self.changed.emit(self._snapshot)

    def _live(self) -> None:
        self._live_layout()
        for step, before in LIVE:
            self.update_inputs()
            source, key, image = self.result(before), self.key(step), self.image
            if source is None or not source.done or key is None or image is None:
                continue
            if self.results.of(step, key) is not None:
                continue
            found = None
            if step == Step.MARKERS:
                found = self.results.of(step, self.inputs.search_key(image))
                if found is None:
                    continue
                found = found.value
            values = {before: source.value}
            result = compute(step, self.engine, self.inputs, values, image=image, found=found)
            self.results.store(result)
        self.update_inputs()

    def _live_layout(self) -> None:
        """Both rings' layout against its rules; needs no image."""
        key = self.inputs.layout_key
        if key == self.layout[0]:
            return
        parts, document = self.inputs.parts, None
        if parts.proximal is not None and parts.distal is not None:
            try:
                document = self.engine.layout_document(parts.proximal, parts.distal)
            except Exception as error:
                self.tell(*faults_of_error(error), kind=kind_of(error), step=Step.NUMBERING)
        self.layout = (key, document)
