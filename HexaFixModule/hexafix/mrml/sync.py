"""The scene follows the presenter, and what is dragged in the scene becomes an edit of the case.

Shared by the browser workstation and the panel in desktop Slicer.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.errors import Refused
from hexafix.markers import BallSet
from hexafix.mrml import markups
from hexafix.mrml import transforms as places
from hexafix.mrml.bundle import TakenBundle
from hexafix.mrml.logic import SceneLogic
from hexafix.mrml.nodes import find
from hexafix.pipeline import bone_fragments
from hexafix.presenter import Step, StepState
from hexafix.report.scene import BoneSample

if TYPE_CHECKING:
    from hexafix.presenter import Presenter, Snapshot

DRAGGED = ("proximal", "distal", "unnumbered")
"""Lists whose points the user may drag."""

IN_THE_SCENE = (
    *(Step.LOAD, Step.MARKERS, Step.NUMBERING, Step.POSES, Step.CORRECTION, Step.SCHEDULE),
)
"""Steps whose results are shown in the scene."""

SAME_MOTION = 1e-9
"""Two motions are the same below this, in mm and in entries of the rotation."""

UNMOVED = tuple(tuple(float(i == j) for j in range(4)) for i in range(4))
"""The motion of a fragment that nobody moved, 4×4."""


class SceneSync:
    """Keeps a scene and a presenter together.

    Parameters
    ----------
    logic : SceneLogic
    presenter : Presenter

    Notes
    -----
    All methods are called on the thread of the door.
    """

    def __init__(self, logic: SceneLogic, presenter: Presenter) -> None:
        self.logic = logic
        self.presenter = presenter
        self._shown: dict[str, tuple[Any, ...]] = {}
        self._samples: dict[str, BoneSample] = {}
        self._rows: Any = None
        self._row: int | None = None
        self._updating = False
        self._dragging_target = False
        self._wished = ""
        self._observers: list[tuple[Any, int]] = []
        self._observed: set[str] = set()

    # ------------------------------------------------------------- to the scene

    def update(self, snapshot: Snapshot) -> None:
        """Bring the scene to the presenter's values, only what changed; grey what is stale."""
        if self._updating:
            return
        self._updating = True
        try:
            changed = [
                self._volume(),
                self._balls(snapshot),
                self._frame(),
                self._bone(snapshot),
                self._target(),
                self._plan(),
                self._case(snapshot),
            ]
            self._stale()
            if any(changed):
                self.logic.arrange(snapshot.case_id or "case")
        finally:
            self._updating = False
        self._observe()

    def show_playback_row(self, index: int | None) -> None:
        """Show a row of the plan's schedule; None: where the CT shows frame and bone."""
        self._row = index
        playback = None if index is None else self._playback()
        self.logic.show_playback_row(playback, index if playback is not None else None)

    def save_bundle(self, path: Path) -> None:
        """Save the scene at once, as `take_bundle` takes it, all or nothing."""
        self.take_bundle().write(path)

    def take_bundle(self) -> TakenBundle:
        """The scene as it is now, with frame and bone where the CT shows them, to be written.

        Raises
        ------
        Refused
            While the scene shows what is not of the case that is saved with it (H40): a file
            tells nobody what was grey.
        InputError
            If there is no room for its files.
        """
        older = self._out_of_date()
        if older:
            raise Refused.of(
                "scene-out-of-date",
                f"the scene was not saved: {older}",
                hazard="H40",
                next_step="plan all steps, or undo the edit, then save again",
            )
        shown = self._row
        self.show_playback_row(None)
        try:
            return self.logic.take_bundle()
        finally:
            self.show_playback_row(shown)

    def _out_of_date(self) -> str:
        """What of the scene is not of the present case, in words; empty if all is."""
        presenter = self.presenter
        if presenter.snapshot.busy:
            return "work is under way"
        older = [
            presenter.snapshot.view(step).title
            for step in IN_THE_SCENE
            if presenter.value(step) is not None and not presenter.is_fresh(step)
        ]
        return "out of date: " + ", ".join(older) if older else ""

    def _playback(self) -> Any:
        """The playback of the shown plan, computed once."""
        if self._new("playback", (self.presenter.value(Step.SCHEDULE),)):
            self._rows = self.presenter.playback()
        return self._rows

    def _new(self, what: str, values: tuple[Any, ...]) -> bool:
        """Whether any of `values` is another object than when asked last; remembers them."""
        before = self._shown.get(what)
        if before is not None and all(map(_same, before, values)):
            return False
        self._shown[what] = values
        return before is not None or any(value is not None for value in values)

    def _volume(self) -> bool:
        volume = self.presenter.value(Step.LOAD)
        if not self._new("volume", (volume,)):
            return False
        if volume is None:
            self.logic.clear("volume")
        else:
            self.logic.add_volume(volume)
        return True

    def _balls(self, snapshot: Snapshot) -> bool:
        balls = self.presenter.value(Step.MARKERS)
        if not self.presenter.is_fresh(Step.MARKERS) and balls is not None:
            return False  # the older ones stay as they are, grey
        # Numbers of other balls would name the wrong ones.
        fresh = self.presenter.is_fresh(Step.NUMBERING)
        judged = self.presenter.value(Step.NUMBERING) if fresh else None
        numbers = _numbers(snapshot.document)
        if not self._new("balls", (balls, judged, numbers)):
            return False
        self._show_balls(balls, judged, numbers)
        return True

    def _show_balls(
        self, balls: BallSet | None, judged: Mapping[str, Any] | None, numbers: Any
    ) -> None:
        if balls is None:
            self.logic.clear("balls")
        else:
            self.logic.show_balls(balls, judged, numbers)

    def _frame(self) -> bool:
        recognised = self.presenter.value(Step.POSES)
        if recognised is not None and not self.presenter.is_fresh(Step.POSES):
            return False
        if not self._new("frame", (recognised,)):
            return False
        if recognised is None:
            for group in ("frame", "bone", "target"):
                self.logic.clear(group)
        else:
            self._row = None
            self.logic.show_recognised(self.presenter.inputs.case_for(Step.POSES), recognised)
        return True

    def _bone(self, snapshot: Snapshot) -> bool:
        recognised = self.presenter.value(Step.POSES)
        if recognised is None or not self.presenter.is_fresh(Step.POSES):
            return False
        share, moving = self.presenter.split_fraction, self._moving(snapshot.document)
        if not self._new("bone", (recognised, share, moving)):
            return False
        if self._new("samples", (recognised, share)):
            self._samples = bone_fragments(recognised, split_fraction=share)
        self.logic.show_fragments(self._samples, moving)
        return True

    def _target(self) -> bool:
        preview = self.presenter.value(Step.CORRECTION)
        if self._dragging_target or not self.presenter.is_fresh(Step.CORRECTION):
            return False
        frame = self.presenter.value(Step.POSES)
        if not self._new("target", (preview, frame)):
            return False
        if preview is None or preview.get("asked_lps") is None:
            return False
        # What was asked for, not what the frame makes of it: a bone dragged twice must not creep.
        self.logic.show_target(preview["asked_lps"], preview["moving"])
        return True

    def _plan(self) -> bool:
        plan = self.presenter.value(Step.SCHEDULE)
        if not self._new("plan", (plan,)):
            return False
        if plan is None:
            self.logic.clear("plan")
        else:
            self.logic.show_schedule(plan)
        return True

    def _case(self, snapshot: Snapshot) -> bool:
        document, sha256 = self.presenter.case_for_scene()
        shell = {
            "step": str(snapshot.current.value),
            "splitFraction": float(self.presenter.split_fraction),
            "acceptRelaxedLayout": bool(snapshot.confirmed.get("relaxed_layout", False)),
            "computedTo": _computed_to(snapshot),
        }
        volume = self._shown.get("volume")
        if not self._new("case", (document, sha256 or "", shell, volume and volume[0])):
            return False
        self.logic.save_case_into(document, case_sha256=sha256, **shell)
        return True

    def _stale(self) -> None:
        for group, step in (
            ("balls", Step.MARKERS),
            ("frame", Step.POSES),
            ("bone", Step.POSES),
            ("target", Step.CORRECTION),
        ):
            value = self.presenter.value(step)
            stale = value is not None and not self.presenter.is_fresh(step)
            if self._new(f"stale {group}", (stale, self._shown.get(group))):
                self.logic.set_stale(group, stale)

    # ------------------------------------------------------------- and back

    def drag_fragment(self, on: bool, *, moving: str = "") -> None:
        """Show or hide the handles that drag the target of the moving fragment.

        Parameters
        ----------
        on : bool
        moving : str
            The fragment chosen on screen; it counts while the case holds no correction.
        """
        if on:
            self._wished = moving
            self.update(self.presenter.snapshot)
        self.logic.drag_fragment(on)

    def commit_fragment(self) -> bool:
        """Make the dragged target of the moving fragment the case's correction.

        To be called when the user lets go of the handles.

        Returns
        -------
        bool
            Whether the case was edited.
        """
        self._dragging_target = False
        matrix = self.logic.fragment_motion_lps()
        preview = self.presenter.value(Step.CORRECTION)
        known = None if preview is None else preview.get("asked_lps")
        if _near(matrix, UNMOVED if known is None else known):
            return False
        moving = self._moving(self.presenter.snapshot.document)
        correction = {"kind": "fragment-motion", "moving": moving, "matrix_lps": matrix}
        return bool(self.presenter.set_correction(correction))

    def _moving(self, document: Mapping[str, Any]) -> str:
        """Which fragment the case moves, or the user means to, where it holds no correction."""
        if self._wished and not document.get("correction"):
            return self._wished
        return _moving(document)

    def close(self) -> None:
        """Stop listening to the scene."""
        for node, tag in self._observers:
            node.RemoveObserver(tag)
        self._observers.clear()
        self._observed.clear()

    def _observe(self) -> None:
        """Listen to lists and target that were made since."""
        scene = self.logic.scene
        for name in DRAGGED:
            node = find(scene, markups.list_role(name))
            if node is not None and node.GetID() not in self._observed:
                self._listen(node, node.PointEndInteractionEvent, self._point_dragged)
                self._listen(node, node.PointRemovedEvent, self._point_removed)
        target = find(scene, places.TARGET)
        if target is not None and target.GetID() not in self._observed:
            self._listen(target, target.TransformModifiedEvent, self._target_moved)

    def _listen(self, node: Any, event: int, call: Any) -> None:
        self._observed.add(node.GetID())
        self._observers.append((node, node.AddObserver(event, call)))

    def _point_dragged(self, node: Any, _event: Any) -> None:
        if self._updating:
            return
        for index, place in markups.moved_balls(node).items():
            self.presenter.move_marker(index, place)
        self._put_back()

    def _point_removed(self, node: Any, _event: Any) -> None:
        if self._updating:
            return
        for index in reversed(markups.removed_balls(node)):
            self.presenter.remove_marker(index)
        self._put_back()

    def _put_back(self) -> None:
        """Points stand where the balls were found, until the search finds them elsewhere."""
        shown = self._shown.get("balls")
        if shown is not None and shown[0] is not None:
            self._updating = True
            try:
                self._show_balls(*shown)
            finally:
                self._updating = False

    def _target_moved(self, _node: Any, _event: Any) -> None:
        if not self._updating:
            self._dragging_target = True


def _same(one: Any, other: Any) -> bool:
    """Whether two plain values are equal; other objects must be the same one."""
    if one is other:
        return True
    plain = (str, int, float, bool, dict)
    return isinstance(one, plain) and isinstance(other, plain) and one == other


def _computed_to(snapshot: Snapshot) -> str:
    """The last of the steps that are done one after the other; empty: none."""
    last = ""
    for view in snapshot.steps:
        if view.state != StepState.DONE:
            break
        last = str(view.step.value)
    return last


def _near(one: Any, other: Any) -> bool:
    return all(
        abs(a - b) <= SAME_MOTION
        for r, s in zip(one, other, strict=True)
        for a, b in zip(r, s, strict=True)
    )


def _numbers(document: Mapping[str, Any]) -> dict[str, tuple[int, ...]]:
    """The marker numbers of both rings, as far as the draft gives them."""
    rows = document.get("markers") or {}
    return {
        ring: tuple(
            row["number"] for row in rows.get(ring) or () if isinstance(row.get("number"), int)
        )
        for ring in ("proximal", "distal")
    }


def _moving(document: Mapping[str, Any]) -> str:
    """Which fragment the case moves; the kinds that do not say it move a known one (contract)."""
    correction = document.get("correction") or {}
    default = "distal" if correction.get("kind") == "deformity" else "proximal"
    moving = correction.get("moving", default)
    return moving if moving in ("proximal", "distal") else default
