"""The page that loads case and CT."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hexafix.errors import InputError
from hexafix.panel.binding import Binding, button, choice, field, idle, shown, table
from hexafix.panel.text import at
from hexafix.strict_json import read_json_object

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

CHOOSE = "choose"
"""What a combo box shows while nothing is chosen: no choice is ever made for the user."""

SIDES = (CHOOSE, "left", "right")
BONES = (CHOOSE, "tibia", "femur", "humerus", "forearm", "foot")

JSON_FILES = "JSON (*.json)"
IMAGE_FILES = "Images (*.nrrd *.nhdr *.nii *.nii.gz *.mha *.mhd *.dcm);;All files (*)"


@cache
def shipped_titles() -> Mapping[str, str]:
    """What the list of fixators calls those that come with HexaFix, by id; read once."""
    from hexafix.case import shipped_fixator_names

    return {known: f"{name} ({known})" for known, name in shipped_fixator_names().items()}


def own_title(given: Any) -> str:
    """What the list calls the case's own fixator; empty where it has none of its own."""
    if isinstance(given, Mapping):
        called = given.get("name") or given.get("id") or "without a name"
        return f"{called} (definition in the case)"
    return f"{given} (definition in a file)" if given and given not in shipped_titles() else ""


def with_own(items: tuple[str, ...], own: str) -> tuple[str, ...]:
    """The items, and the case's own one where it is another."""
    return items if not own or own in items else (*items, own)


def index_in(items: tuple[str, ...], own: str) -> int:
    """Where the case's own value stands; the first, where there is none."""
    return items.index(own) if own in items else 0


def _bone(snapshot: Snapshot) -> str:
    return str(at(snapshot.document, "limb", "bone") or "")


def _bones(snapshot: Snapshot) -> tuple[str, ...]:
    return with_own(BONES, _bone(snapshot))


def _fixator(snapshot: Snapshot) -> str:
    given = at(snapshot.document, "fixator")
    return own_title(given) or shipped_titles().get(given, "")


def _fixators(snapshot: Snapshot) -> tuple[str, ...]:
    return with_own((CHOOSE, *shipped_titles().values()), _fixator(snapshot))


def _set_side(panel: Panel, index: int) -> None:
    if index > 0:
        panel.presenter.set_limb(side=SIDES[index])


def _set_bone(panel: Panel, index: int) -> None:
    if index > 0:
        panel.presenter.set_limb(bone=_bones(panel.snapshot)[index])


def _set_fixator(panel: Panel, index: int) -> None:
    known = tuple(shipped_titles())
    if 0 < index <= len(known):
        panel.presenter.set_fixator(known[index - 1])


def _fixator_file(panel: Panel, _: Any) -> None:
    path = panel.widgets.ask_file("A fixator's definition", JSON_FILES)
    if path:
        _, definition = read_json_object(Path(path), what="fixator definition")
        panel.presenter.set_fixator(definition)


def _image_path(_: Panel, snapshot: Snapshot) -> str:
    return str(at(snapshot.document, "image", "path") or "No image chosen.")


def _open_folder(panel: Panel, _: Any) -> None:
    folder = panel.widgets.ask_folder("The folder with the CT's DICOM files")
    if folder:
        panel.image_folder = folder
        panel.presenter.list_series(Path(folder))


def _open_file(panel: Panel, _: Any) -> None:
    path = panel.widgets.ask_file("A CT as one file", IMAGE_FILES)
    if path:
        panel.presenter.load_image(Path(path))


def _load_series(panel: Panel, _: Any) -> None:
    rows = panel.table("series").rows
    chosen = panel.widgets.get("seriesTable", "index")
    if chosen < 0 and len(rows) == 1:
        chosen = 0
    if not 0 <= chosen < len(rows):
        raise InputError.of(
            "no-series-chosen",
            "no series is chosen",
            next_step="click a row of the list of series, then load it",
        )
    panel.presenter.load_image(
        Path(panel.image_folder), series_instance_uid=rows[chosen][-1] or None
    )


def _can_load(panel: Panel, snapshot: Snapshot) -> bool:
    return bool(panel.image_folder and panel.table("series").rows) and not snapshot.busy


BINDINGS: tuple[Binding, ...] = (
    field(
        "caseIdLineEdit",
        lambda panel, text: panel.presenter.set_case_id(text.strip()),
        lambda _, snapshot: str(at(snapshot.document, "case_id") or ""),
    ),
    choice(
        "limbSideComboBox",
        _set_side,
        lambda _, snapshot: index_in(SIDES, str(at(snapshot.document, "limb", "side") or "")),
        items=lambda *_: SIDES,
    ),
    choice(
        "limbBoneComboBox",
        _set_bone,
        lambda _, snapshot: index_in(_bones(snapshot), _bone(snapshot)),
        items=lambda _, snapshot: _bones(snapshot),
    ),
    choice(
        "fixatorComboBox",
        _set_fixator,
        lambda _, snapshot: index_in(_fixators(snapshot), _fixator(snapshot)),
        items=lambda _, snapshot: _fixators(snapshot),
    ),
    button("fixatorFileButton", _fixator_file),
    button("openDicomFolderButton", _open_folder, enabled=idle),
    button("openImageFileButton", _open_file, enabled=idle),
    button("loadSeriesButton", _load_series, enabled=_can_load),
    shown("imagePathLabel", "text", _image_path),
    table("seriesTable", "series"),
    table("imageTable", "image"),
)
