"""The window: panel at the side, four views in the middle, menus and shortcuts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from hexafix.panel import Panel, QtWidgets
from hexafix.panel.frame import may_leave, new_case, open_case, save
from hexafix.paths import resources
from hexafix.presenter import Presenter, Snapshot
from hexafix.presenter.scenes import SceneContent
from hexafix.progress import Progress, silent
from hexafix.qt.kit import kit, made, views
from hexafix.qt.stage import WINDOWS, Stage

NOTICE = "Research software, not a medical device."

SIZE = (1440, 900)
PANEL_WIDTH = 530

SETTINGS = ("HexaFix", "hexafix")
RECENT = "recentCase"


def read_scene(path: Path, *, progress: Progress = silent) -> SceneContent:
    """Case and CT of a scene's file; see `hexafix.mrml.scene_file.read_scene`."""
    # Not at the top: a start without a scene need not wait for it.
    from hexafix.mrml.scene_file import read_scene as read

    return read(path, progress=progress)


def panel_widget() -> Any:
    """The widget that ``HexaFixModule.ui`` describes."""
    file = resources() / "UI" / "HexaFixModule.ui"
    return kit().QUiLoader().load(str(file))


class Window:
    """The stand-alone workstation.

    Parameters
    ----------
    presenter : Presenter, optional
        A new one, whose work runs beside the window's thread, if not given.
    settings : QSettings, optional
        Where the recent case is remembered.
    """

    def __init__(self, presenter: Presenter | None = None, *, settings: Any = None) -> None:
        q = kit()
        views()
        self.poster = made().Poster()
        self.presenter = presenter or Presenter(post=self.poster.post, read_scene=read_scene)
        self.settings = settings if settings is not None else q.QSettings(*SETTINGS)
        self.main = q.QMainWindow()
        self.main.setObjectName("hexafixWindow")
        self.main.resize(*SIZE)
        self.root = panel_widget()
        self.widgets = QtWidgets(self.root, q, self._find)
        self.panel = Panel(self.widgets, self.presenter)
        self.stage = Stage(self.panel, self.presenter, self.poster.post)
        self.main.setCentralWidget(self.stage.widget)
        self._dock(q)
        self._tools(q)
        self._guard_wheel(q)
        self._closing = made().Closing(self.main, self._may_close)
        self.closed = False
        self.presenter.changed.connect(self.update)
        self.update(self.presenter.snapshot)

    def _find(self, name: str) -> Any:
        found = self.root.findChild(kit().QObject, name)
        if found is None:
            raise KeyError(name)
        return found

    def _dock(self, q: Any) -> None:
        dock = q.QDockWidget("Workflow")
        dock.setObjectName("workflowDock")
        dock.setFeatures(q.QDockWidget.DockWidgetMovable | q.QDockWidget.DockWidgetFloatable)
        dock.setWidget(self.root)
        self.main.addDockWidget(q.Qt.LeftDockWidgetArea, dock)
        self.main.resizeDocks([dock], [PANEL_WIDTH], q.Qt.Horizontal)
        self.dock = dock

    def _tools(self, q: Any) -> None:
        bar = self.main.menuBar()
        menu = bar.addMenu("&Case")
        self.actions = {}
        for key, text, keys, work in (
            ("new", "&New", q.QKeySequence.New, lambda: self._new()),
            ("open", "&Open…", q.QKeySequence.Open, lambda: self._open()),
            ("recent", "Open &recent", None, lambda: self._open_recent()),
            ("save", "&Save", q.QKeySequence.Save, lambda: self._save()),
            ("save as", "Save &as…", q.QKeySequence.SaveAs, lambda: self._save(elsewhere=True)),
            ("quit", "&Quit", q.QKeySequence.Quit, lambda: self.main.close()),
        ):
            self.actions[key] = self._action(q, menu, text, keys, work)
        edit = bar.addMenu("&Edit")
        self.actions["undo"] = self._action(
            q, edit, "&Undo", q.QKeySequence("Ctrl+Z"), lambda: self._step_back(redo=False)
        )
        self.actions["redo"] = self._action(
            q, edit, "&Redo", q.QKeySequence("Ctrl+Shift+Z"), lambda: self._step_back(redo=True)
        )
        view = bar.addMenu("&View")
        self._action(q, view, "&Fit all views", q.QKeySequence("Ctrl+0"), self._fit)
        box = q.QComboBox()
        box.setObjectName("greyWindowComboBox")
        box.setAccessibleName("Grey window of the slices")
        box.addItems([name for name, _ in WINDOWS])
        box.activated.connect(self.stage.set_window)
        tools = self.main.addToolBar("Slices")
        tools.setObjectName("slicesToolBar")
        tools.setMovable(False)
        tools.addWidget(q.QLabel(" Grey window "))
        tools.addWidget(box)
        tools.addWidget(q.QLabel("  wheel: next slice · click: show or pick · drag: window/level"))
        self.main.statusBar().addPermanentWidget(q.QLabel(NOTICE))

    def _action(self, q: Any, menu: Any, text: str, keys: Any, work: Any) -> Any:
        action = q.QAction(text, self.main)
        if keys is not None:
            action.setShortcut(q.QKeySequence(keys))
        action.triggered.connect(lambda *_: work())
        menu.addAction(action)
        return action

    def _guard_wheel(self, q: Any) -> None:
        self._wheel = made().WheelGuard(self.main)
        for kind in (q.QComboBox, q.QSpinBox, q.QDateEdit):
            for widget in self.root.findChildren(kind):
                widget.installEventFilter(self._wheel)

    # ------------------------------------------------------------ following the presenter

    def update(self, snapshot: Snapshot) -> None:
        """Show the newest snapshot in title, menus and views; the panel follows by itself."""
        if self.closed:
            return
        name = snapshot.case_id or "unnamed case"
        self.main.setWindowTitle(f"{name}[*] – HexaFix")
        self.main.setWindowModified(snapshot.edited)
        for key, possible, label in (
            ("undo", snapshot.can_undo, snapshot.undo_label),
            ("redo", snapshot.can_redo, snapshot.redo_label),
        ):
            self.actions[key].setEnabled(possible)
            word = key.capitalize()
            self.actions[key].setText(f"&{word} {label}" if label else f"&{word}")
        if snapshot.case_path and snapshot.case_path != self.recent():
            self.settings.setValue(RECENT, snapshot.case_path)
        recent = Path(self.recent())
        known = bool(self.recent())
        self.actions["recent"].setEnabled(known)
        where = f": {recent.parent.name}/{recent.name}" if known else ""
        self.actions["recent"].setText(f"Open &recent{where}")
        self.main.statusBar().showMessage(
            "Ready for the export." if snapshot.can_export else snapshot.export_blocked_by
        )
        self.stage.update(snapshot)

    def recent(self) -> str:
        """The case that was open last."""
        return str(self.settings.value(RECENT, "") or "")

    # ------------------------------------------------------------ actions

    def open_case(self, path: Path) -> bool:
        """Open a case in place of the present one."""
        return self.panel.open_case(path)

    def _new(self) -> None:
        new_case(self.panel)

    def _open(self) -> None:
        open_case(self.panel)

    def _open_recent(self) -> None:
        recent = self.recent()
        if recent and may_leave(self.panel):
            self.panel.open_case(Path(recent))

    def _save(self, *, elsewhere: bool = False) -> None:
        save(self.panel, elsewhere=elsewhere)

    def _step_back(self, *, redo: bool) -> None:
        self.widgets.finish()
        self.presenter.redo() if redo else self.presenter.undo()

    def _fit(self) -> None:
        for pane in self.stage.slices:
            pane.fit()
        self.stage.view3d.refit()
        self.stage.view3d.look((-1, -2, 1), (0, 0, 1))
        self.stage.render()

    # ------------------------------------------------------------ the end

    def show(self) -> None:
        """Show the window; the views are fitted once they have their size."""
        self.main.show()
        for pane in self.stage.slices:
            pane.fit()

    def _may_close(self) -> bool:
        if not self.closed:
            if not may_leave(self.panel):
                return False
            self.close()
        return True

    def close(self) -> None:
        """Stop the work under way, free the views."""
        if self.closed:
            return
        self.closed = True
        self.presenter.changed.disconnect(self.update)
        self.panel.close()
        self.presenter.close()
        self.stage.close()
