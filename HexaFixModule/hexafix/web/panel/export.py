"""Step 8: the side a second time, the prescription, its files and the export folder."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.export import MANIFEST
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.prescription import PrescriptionPages
from hexafix.web.panel.widgets import button, marked, note, title

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

FILES = {
    "prescription.pdf": "Prescription for patient and surgeon",
    "schedule.csv": "Scale values, one row an adjustment",
    "plan.json": "Everything computed, with input hashes and gates",
    "markers.mrk.json": "Numbered ball centres for 3D Slicer",
    "manifest.json": "SHA-256 of each file",
}
"""What each file of an export is."""


@dataclass
class ExportState:
    """What can be downloaded.

    Attributes
    ----------
    files : list of dict
        name, words.
    """

    files: list = field(default_factory=list)


class ExportStep:
    """Confirm the side, make the prescription, look at it, download or export it."""

    def __init__(self, context: PanelContext, chooser: Chooser, pages: PrescriptionPages) -> None:
        self._context, self._chooser, self._pages = context, chooser, pages
        self._data, self._name = typed_state(context.server, ExportState)

    def build(self) -> None:
        """Make the question, the pages and the files."""
        from trame.widgets import html

        name = self._context.name
        button(
            "Make the prescription",
            "run-export",
            self._run,
            icon="mdi-file-document-check-outline",
            primary=True,
            disabled=(name.busy,),
        )
        self._side()
        title("Export")
        html.Div(
            f"Blocked: {{{{ {name.export_blocked_by} }}}}",
            v_if=f"!{name.can_export}",
            classes="hxp-blocked",
            **marked("export-blocked", role="status"),
        )
        with html.Ul(v_if=f"{name.can_export}", classes="hxp-files", **marked("files")):  # noqa: SIM117
            with html.Li(v_for=f"file in {self._name.files}", key="file.name"):
                html.A(
                    "{{ file.name }}",
                    href=("'export/' + file.name",),
                    download=("file.name",),
                    **marked(("'download-' + file.name",)),
                )
                html.Span(" {{ file.words }}", classes="hxp-note")
        button(
            "Export to a folder",
            "export-folder",
            self._choose,
            icon="mdi-folder-arrow-down-outline",
            disabled=(f"!{name.can_export}",),
        )
        html.Div(
            f"Exported to {{{{ {name.export_folder} }}}}",
            v_if=name.export_folder,
            classes="hxp-done",
            **marked("exported-to", role="status"),
        )
        note("Every file is marked: not approved. The printed prescription is signed by hand.")
        self._pages.build()

    def _side(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        confirmed = self._context.name.confirmed
        with html.Div(classes="hxp-side", **marked("side")):
            html.B("Look at the patient: which limb carries the frame?")
            with html.Div(classes="hxp-row"):
                for side in ("left", "right"):
                    button(side, f"confirm-{side}", (self._confirm, f"['{side}']"))
                with html.Span(
                    v_if=f"{confirmed}.side", classes="hxp-done", **marked("side-confirmed")
                ):
                    v.VIcon(icon="mdi-check-circle", size="small", color="success")
                    html.Span(
                        f"{{{{ {self._context.name.form}.side }}}} side, given twice and the same"
                    )
                html.Span(
                    "not confirmed",
                    v_else=True,
                    classes="hxp-note",
                    **marked("side-not-confirmed"),
                )

    def update(self, snapshot: Snapshot, files: Mapping[str, bytes] | None) -> None:
        """List the files of the fresh prescription."""
        names = (*files, MANIFEST) if files else ()
        self._data.files = [{"name": name, "words": FILES.get(name, "")} for name in names]

    def _confirm(self, side: str) -> None:
        self._context.act(lambda: self._context.presenter.confirm_side(side))

    def _run(self) -> None:
        from hexafix.presenter import Step

        self._context.plan(lambda: self._context.presenter.run(Step.EXPORT))

    def _choose(self) -> None:
        def take(folder: Path) -> Any:
            self._context.act(lambda: self._context.presenter.export(folder))

        self._chooser.ask(
            "Export to a folder",
            "Export here",
            take,
            name="prescription",
            hint="A new folder; it appears complete or not at all.",
        )
