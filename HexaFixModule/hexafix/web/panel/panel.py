"""The side panel as a whole: eight steps, banners, playback, dialogs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.export import MANIFEST, manifest
from hexafix.web.panel.banner import Banners
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.controls import ViewControls
from hexafix.web.panel.correction import CorrectionStep
from hexafix.web.panel.export import ExportStep
from hexafix.web.panel.load import LoadStep
from hexafix.web.panel.markers import MarkersStep
from hexafix.web.panel.numbering import NumberingStep
from hexafix.web.panel.pages import OpenPages
from hexafix.web.panel.playback import Playback
from hexafix.web.panel.poses import PosesStep
from hexafix.web.panel.prescription import PrescriptionPages, data_address
from hexafix.web.panel.readings import ReadingsStep
from hexafix.web.panel.scene import SceneFile
from hexafix.web.panel.schedule import ScheduleStep
from hexafix.web.panel.stepper import Stepper
from hexafix.web.panel.toolbar import Toolbar
from hexafix.web.state import PanelState, form_words, snapshot_words

if TYPE_CHECKING:
    from hexafix.presenter import Presenter, Snapshot

STATIC = Path(__file__).resolve().parents[1] / "static"
"""Style sheet and keys of the panel."""


class Panel:
    """Side panel, tool bar and playback of the browser workstation.

    Parameters
    ----------
    server : trame server
    presenter : Presenter
    controls : ViewControls
        What the panel asks of the views.
    """

    def __init__(self, server: Any, presenter: Presenter, controls: ViewControls) -> None:
        server.enable_module(
            {
                "serve": {"__hexafix": str(STATIC)},
                "scripts": ["__hexafix/keys.js"],
                "styles": ["__hexafix/panel.css"],
            }
        )
        data, name = typed_state(server, PanelState)
        self._context = context = PanelContext(server, presenter, controls, data=data, name=name)
        self._chooser = Chooser(context)
        self._scene = SceneFile(context, self._chooser)
        self._bar = Toolbar(context, self._chooser, self._scene)
        self._open_pages = OpenPages(context)
        self._banners = Banners(context)
        self._load = LoadStep(context, self._chooser)
        self._markers = MarkersStep(context)
        self._numbering = NumberingStep(context)
        self._readings = ReadingsStep(context)
        self._correction = CorrectionStep(context)
        self._pages = PrescriptionPages(context)
        self._export = ExportStep(context, self._chooser, self._pages)
        self._playback = Playback(context)
        self._schedule = ScheduleStep(context, self._playback.build_curves)
        self._stepper = Stepper(
            context,
            {
                "load": self._load.build,
                "markers": self._markers.build,
                "numbering": self._numbering.build,
                "poses": PosesStep(context).build,
                "readings": self._readings.build,
                "correction": self._correction.build,
                "schedule": self._schedule.build,
                "export": self._export.build,
            },
        )
        self._pictures: dict[str, str] = {}
        self._plan: Any = None
        server.trigger("hx_escape")(self.escape)

    def toolbar(self) -> None:
        """Make the content of the bar on top."""
        self._bar.build()

    def drawer(self) -> None:
        """Make banners and steps."""
        self._open_pages.build()
        self._scene.build_line()
        self._banners.build()
        self._stepper.build()

    def playback(self) -> None:
        """Make the bar under the views."""
        self._playback.build()

    def dialogs(self) -> None:
        """Make the file chooser, the large page and the question about unsaved edits."""
        self._chooser.build()
        self._pages.build_dialog()
        self._bar.build_dialog()
        self._scene.build_dialog()

    def ball_clicked(self, index: int) -> None:
        """Take a click on a ball in a view: it gets the picked number, else it is picked."""
        from hexafix.presenter import Step

        with self._context.server.state:
            if self._context.presenter.snapshot.current == Step.NUMBERING:
                self._numbering.ball_clicked(index)
            else:
                self._markers.pick(index)

    def act(self, work: Callable[[], Any]) -> bool:
        """Do what a view asks for; an error becomes a notice. Whether it was taken."""
        with self._context.server.state:
            return self._context.act(work)

    def escape(self) -> None:
        """Leave every mode: nothing is picked, added or dragged by the next click."""
        self._markers.stop()
        self._numbering.data.picked = ""
        self._correction.stop()
        self._schedule.stop()

    def update(self, snapshot: Snapshot) -> None:
        """Push a snapshot to the browser: only what changed is sent."""
        from hexafix.presenter import Step

        presenter, data = self._context.presenter, self._context.data
        with self._context.server.state:
            for name, words in snapshot_words(snapshot).items():
                setattr(data, name, words)
            form = form_words(snapshot.document)
            if form["readings"] != data.form.get("readings"):
                self._readings.clear()
            data.form = form
            self._load.update(form, snapshot)
            self._numbering.update(
                snapshot, presenter.value(Step.NUMBERING), presenter.is_fresh(Step.NUMBERING)
            )
            self._correction.update(snapshot, self._center())
            self._schedule.update(snapshot)
            self._show_plan(snapshot)
            files = presenter.prescription_files()
            self._pages.update(files)
            self._export.update(snapshot, files)

    def downloads(self) -> Mapping[str, bytes] | None:
        """An export's files while nothing blocks the export; else None."""
        presenter = self._context.presenter
        files = presenter.prescription_files() if presenter.snapshot.can_export else None
        return None if files is None else {**files, MANIFEST: manifest(files)}

    def close(self) -> None:
        """Stop what runs by itself."""
        self._playback.close()
        self._scene.close()

    def _center(self) -> Any:
        """LPS, mm: the point between the fragments, once the rings are known."""
        from hexafix.presenter import Step

        recognised = self._context.presenter.value(Step.POSES)
        if recognised is None:
            return None
        from hexafix.pipeline import split_point

        return split_point(recognised, self._context.presenter.split_fraction)

    def _show_plan(self, snapshot: Snapshot) -> None:
        """Pictures and playback, drawn anew only for another plan or another layout."""
        from hexafix.presenter import Step

        presenter = self._context.presenter
        plan, pictures = presenter.value(Step.SCHEDULE), presenter.pictures()
        if pictures != self._pictures:
            self._pictures = pictures
            self._context.data.pictures = {
                name: data_address(svg, "image/svg+xml") for name, svg in pictures.items()
            }
        if plan is not self._plan:
            self._plan = plan
            self._playback.take(snapshot, presenter.playback(), plan)
        self._playback.update(presenter.is_fresh(Step.SCHEDULE))
