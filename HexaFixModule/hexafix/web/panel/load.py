"""Step 1: whose limb, which frame, which CT."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.web.files import IMAGE_SUFFIXES, start_folder
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.frame_choice import FrameChoice
from hexafix.web.panel.widgets import button, choice, marked, note, table, title
from hexafix.web.panel.widgets import field as text_field

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

BONES = ("tibia", "femur", "humerus", "radius", "ulna", "forearm", "foot")


@dataclass
class LoadState:
    """The image's path as written, and which series of the list is picked.

    Attributes
    ----------
    uids : list of str
        The listed series' UIDs, row by row; empty where a row cannot be chosen.
    """

    path: str = ""
    uids: list = field(default_factory=list)
    picked: int = -1


class LoadStep:
    """Case id, limb, fixator, image and series."""

    def __init__(self, context: PanelContext, chooser: Chooser) -> None:
        self._context, self._chooser = context, chooser
        self._data, self._name = typed_state(context.server, LoadState)
        self._frame = FrameChoice(context, chooser)

    def build(self) -> None:
        """Make the step's fields and tables."""
        from trame.widgets import html

        context, form = self._context, self._context.name.form
        with html.Div(classes="hxp-grid-2"):
            with html.Div(classes="hxp-whole"):
                text_field(
                    context, "case-id", "Case id (no patient name)", f"{form}.case_id", self._id
                )
            sides = ("[{title: 'left', value: 'left'}, {title: 'right', value: 'right'}]",)
            choice(context, "limb-side", "Side", f"{form}.side", sides, self._side)
            choice(context, "limb-bone", "Bone", f"{form}.bone", ([*BONES],), self._bone)
            with html.Div(classes="hxp-whole"):
                self._frame.build()
        self._frame.build_file()
        title("CT")
        self._image()
        table(
            context,
            "series",
            "Series in the folder",
            click=(self._pick, "[i]"),
            picked=f"{self._name.picked} === i",
            hidden=("SeriesInstanceUID",),
        )
        button(
            "Load the CT",
            "load-image",
            self._load,
            icon="mdi-tray-arrow-down",
            primary=True,
            disabled=(context.name.busy,),
        )
        table(context, "image", "The CT that is loaded")

    def _image(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        with html.Div(classes="hxp-row"):
            v.VTextField(
                label="DICOM folder or image file",
                v_model=(self._name.path,),
                density="compact",
                variant="outlined",
                hide_details="auto",
                keydown_enter=self._list,
                **marked("image-path", label="DICOM folder or image file on this computer"),
            )
            button("Browse", "browse-image", self._browse)
            button("List series", "list-series", self._list, disabled=(self._context.name.busy,))
        note("A DICOM folder, or a .nrrd, .nii.gz or .mha file. Nothing leaves this computer.")

    def update(self, form: Mapping[str, Any], snapshot: Snapshot) -> None:
        """Show the document's image path where another one is not being written."""
        self._frame.update(snapshot)
        table = snapshot.tables.get("series")
        listed = list(zip(table.rows, table.alerts, strict=True)) if table else []
        self._data.uids = ["" if alert else row[-1] for row, alert in listed]
        if form["image"] != getattr(self, "_shown", None):
            self._shown = form["image"]
            self._data.path = form["image"]
            self._data.picked = -1

    def _id(self, text: str) -> None:
        self._set("case-id", lambda: self._context.presenter.set_case_id(text.strip()))

    def _side(self, side: str) -> None:
        self._set("limb-side", lambda: self._context.presenter.set_limb(side=side))

    def _bone(self, bone: str) -> None:
        self._set("limb-bone", lambda: self._context.presenter.set_limb(bone=bone))

    def _set(self, name: str, work: Any) -> None:
        self._context.act(work, field=name)

    def _browse(self) -> None:
        self._chooser.ask(
            "Choose the CT",
            "Choose",
            self._chosen,
            suffixes=IMAGE_SUFFIXES,
            hint="Go into the DICOM folder, or pick an image file.",
        )

    def _chosen(self, path: Path) -> None:
        self._data.path = str(path)
        self._list()

    def _list(self) -> None:
        self._data.picked = -1
        self._context.act(lambda: self._context.presenter.list_series(self._path()))

    def _path(self) -> Path:
        """The path as written; a relative one is relative to the case file."""
        path = Path(self._data.path.strip()).expanduser()
        return start_folder(self._context.presenter.snapshot.case_path) / path

    def _pick(self, row: int) -> None:
        """Pick a series; one that cannot be read stays unpicked, its reason stands below it."""
        if self._data.uids[row]:
            self._data.picked = row

    def _load(self) -> None:
        row = self._data.picked
        uids = self._data.uids
        uid = uids[row] if 0 <= row < len(uids) else None
        self._context.act(
            lambda: self._context.presenter.load_image(self._path(), series_instance_uid=uid)
        )
