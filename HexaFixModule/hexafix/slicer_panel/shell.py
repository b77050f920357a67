"""The module's panel: presenter, shared panel and scene joined in desktop Slicer."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hexafix.errors import HexaFixError
from hexafix.slicer_panel import host, requirements
from hexafix.slicer_panel.ui_thread import UiThread

ASK_TO_INSTALL = (
    "HexaFix needs Python packages that this Slicer does not have yet. Nothing is installed "
    "without your consent."
)


class SlicerPanel:
    """What the module's widget holds.

    Parameters
    ----------
    parent : qMRMLWidget
        The module's widget, which has a layout.
    scene : vtkMRMLScene
    app_logic : vtkSlicerApplicationLogic, optional

    Attributes
    ----------
    presenter : Presenter or None
        None until what HexaFix needs is installed.
    """

    def __init__(self, parent: Any, scene: Any, *, app_logic: Any = None) -> None:
        self._parent, self._scene, self._app_logic = parent, scene, app_logic
        self.presenter: Any = None
        self.panel: Any = None
        self._request: Any = None
        self._observers: list[int] = []
        needed = requirements.missing()
        if needed:
            self._ask(needed)
        else:
            self._open()

    # ------------------------------------------------------------ what is needed

    def _ask(self, needed: tuple[str, ...]) -> None:
        """What is missing and a button, in the place of the panel."""
        qt = host.qt()
        self._request = qt.QWidget()
        column = qt.QVBoxLayout(self._request)
        text = qt.QLabel("\n\n".join([ASK_TO_INSTALL, ", ".join(needed)]))
        text.setWordWrap(True)
        self._install = qt.QPushButton("Install what HexaFix needs…")
        column.addWidget(text)
        column.addWidget(self._install)
        column.addStretch(1)
        self._parent.layout().addWidget(self._request)
        self._install.connect("clicked(bool)", lambda *_: self._guarded(self._install_and_open))

    def _install_and_open(self) -> None:
        requirements.install()
        self._parent.layout().removeWidget(self._request)
        self._request.hide()
        self._request.deleteLater()
        self._request = None
        self._open()
        self.enter()

    # ------------------------------------------------------------ the panel

    def _open(self) -> None:
        # Not at the top: these need what may have to be installed first.
        from hexafix.mrml.logic import SceneLogic
        from hexafix.mrml.scene_file import read_scene
        from hexafix.panel import Panel
        from hexafix.presenter import Presenter
        from hexafix.slicer_panel.clicks import SliceClicks
        from hexafix.slicer_panel.widgets import load_panel

        self._widgets = load_panel(self._parent)
        self._ui = UiThread(host.qt().QTimer(self._widgets.root))
        self.presenter = Presenter(post=self._ui.post, read_scene=read_scene)
        self.logic = SceneLogic(self._scene, app_logic=self._app_logic)
        self._join_scene()
        self.panel = Panel(self._widgets, self.presenter)
        self.panel.ball_chosen.connect(self._show_ball)
        self.panel.playback_moved.connect(lambda row: self.sync.show_playback_row(row))
        self.panel.dragging_changed.connect(self._drag)
        self.presenter.changed.connect(self._changed)
        self._clicks = SliceClicks(host.slicer().app.layoutManager(), self._clicked, self._released)
        for event, call in (
            (self._scene.EndCloseEvent, self._scene_closed),
            (self._scene.EndImportEvent, self._scene_opened),
        ):
            tag = self._scene.AddObserver(event, lambda *_, call=call: call())
            self._observers.append(tag)

    def _join_scene(self) -> None:
        from hexafix.mrml.sync import SceneSync

        self.sync = SceneSync(self.logic, self.presenter)

    def _scene_closed(self) -> None:
        """The nodes are gone, the case is not: it is shown again at the next change."""
        self.sync.close()
        self._join_scene()

    def _scene_opened(self) -> None:
        """Take over the case of an opened scene, unless the panel has one of its own.

        The CT has to be chosen again: a scene does not say where it came from (H51).
        """
        from hexafix.mrml.parameter_node import IN_THE_SCENE
        from hexafix.presenter.casefile import TYPED_ONCE

        snapshot = self.presenter.snapshot
        if snapshot.case_path is not None or snapshot.edited or snapshot.can_undo:
            return
        document = self.logic.case_document_from_scene()
        if document is None:
            return
        if document.get("image", {}).get("path") == IN_THE_SCENE:
            del document["image"]
        # Of readings that were typed once: here they are asked for again in any case (H24).
        document.pop(TYPED_ONCE, None)
        self.presenter.edit("take over the case of the scene", lambda _: document)

    def enter(self) -> None:
        """The user came to the module: watch the views, bring the scene up to date."""
        if self.panel is not None:
            self._clicks.start()
            self._guarded(self._scene_opened)
            self._guarded(lambda: self.sync.update(self.presenter.snapshot))

    def exit(self) -> None:
        """The user left the module; clicks in the views are no longer ours."""
        if self.panel is not None:
            self._clicks.stop()

    def close(self) -> None:
        """Stop the work and forget views and scene."""
        if self.panel is not None:
            self._clicks.stop()
            self.presenter.changed.disconnect(self._changed)
            self.panel.close()
            self.presenter.close()
            self.sync.close()
            self._ui.close()
        for tag in self._observers:
            self._scene.RemoveObserver(tag)
        self._observers.clear()

    # ------------------------------------------------------------ scene and views

    def _changed(self, snapshot: Any) -> None:
        self._ui.set_busy(snapshot.busy)
        self._guarded(lambda: self.sync.update(snapshot))

    def _show_ball(self, index: int) -> None:
        """Mark a ball and let all slices go through it."""
        place = self.logic.select_ball(index)
        if place is not None:
            ras = self.logic.ras_from_lps(place)
            host.slicer().vtkMRMLSliceNode.JumpAllSlices(self._scene, *ras)

    def _clicked(self, lps_mm: tuple[float, float, float]) -> None:
        self._guarded(lambda: self.panel.clicked(lps_mm, self.logic.ball_at(lps_mm)))

    def _released(self) -> None:
        if self.panel.dragging:
            self._guarded(self.sync.commit_fragment)

    def _drag(self, on: bool) -> None:
        self.sync.drag_fragment(on, moving=self.panel.moving_fragment())
        if not on:
            self._guarded(self.sync.commit_fragment)

    @staticmethod
    def _guarded(work: Callable[[], Any]) -> None:
        """Do something; a fault that the panel does not show itself comes as Slicer's message."""
        try:
            work()
        except HexaFixError as error:
            from hexafix.presenter.notices import line_of

            words = "; ".join(line_of(fault) for fault in error.faults)
            host.slicer().util.errorDisplay(words, windowTitle="HexaFix")
