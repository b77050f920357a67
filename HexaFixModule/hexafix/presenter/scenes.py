"""Scenes as files (``.mrb``): their case and their CT, read whole by a room above this one.

A scene's CT has no other file: in a case its path is the scene's, and it is read from there again
whenever it is needed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, cast

from hexafix.errors import Fault, InputError
from hexafix.presenter.casefile import TYPED_ONCE, portable, require_case
from hexafix.presenter.engine import Engine
from hexafix.presenter.history import Origin, Version, document_bytes
from hexafix.presenter.inputs import Inputs
from hexafix.presenter.state import Step
from hexafix.progress import Progress, silent

SCENE_SUFFIX = ".mrb"


@dataclass(frozen=True, eq=False)
class SceneContent:
    """What a scene's file holds of the work.

    Attributes
    ----------
    document : mapping
        The case, draft or whole, as it stands in the scene: without its image's path.
    case_sha256 : str
        Hash of the case file that it was read from, as the scene tells it.
    volume : Volume or None
        The CT, exactly as it was read for the case; None for a scene without one.
    relaxed : bool
        Whether the relaxed angle rule was accepted.
    step : str
        The step that the user looked at.
    computed_to : str
        The last of the steps whose results were done; empty: none.
    split_fraction : float
        Where the bone is cut for the picture.
    """

    document: Mapping[str, Any]
    case_sha256: str
    volume: Any = None
    relaxed: bool = False
    step: str = ""
    computed_to: str = ""
    split_fraction: float = 0.5


class ReadScene(Protocol):
    """Reads a scene's file whole, or refuses it; called on the working thread."""

    def __call__(self, path: Path, *, progress: Progress = ...) -> SceneContent:
        """What the file holds."""
        ...


def is_scene(path: Path) -> bool:
    """Whether a path is that of a scene's file."""
    return path.name.lower().endswith(SCENE_SUFFIX)


@dataclass(frozen=True, eq=False)
class OpenedScene:
    """A scene made ready to go on with; nothing in it can fail any more.

    Attributes
    ----------
    file : Path
    version : Version
        The case as it reads beside the scene's file.
    typed_once : bool
        Whether its readings were typed and not repeated (H24).
    volume : Volume or None
    image : mapping
        The volume's image document; empty without one.
    step : Step
    computed_to : Step or None
    split_fraction : float
    """

    file: Path
    version: Version
    typed_once: bool
    volume: Any
    image: Mapping[str, Any]
    step: Step
    computed_to: Step | None
    split_fraction: float


def opened(content: SceneContent, file: Path, engine: Engine) -> OpenedScene:
    """A scene that was read, made ready.

    Raises
    ------
    InputError
        If it holds no case of a known version.
    """
    require_case(content.document)
    document = dict(content.document)
    typed_once = document.pop(TYPED_ONCE, None) is True
    if content.volume is None:
        document.pop("image", None)
    else:
        document["image"] = {"path": file.name, "series_instance_uid": None}
    raw = _bytes(document)
    # Readings typed once make another case than its file holds.
    origin = None if typed_once else Origin(hashlib.sha256(raw).hexdigest(), content.case_sha256)
    version = Version(raw, file.parent, content.relaxed, "open the scene", origin)
    Inputs(version).fingerprint(Step.EXPORT)
    return OpenedScene(
        file=file,
        version=version,
        typed_once=typed_once,
        volume=content.volume,
        image={} if content.volume is None else engine.image_document(content.volume),
        step=_step(content.step) or Step.LOAD,
        computed_to=_step(content.computed_to),
        split_fraction=min(max(content.split_fraction, 0.0), 1.0),
    )


def case_for_scene(version: Version, *, typed_once: bool) -> tuple[dict[str, Any], str | None]:
    """A version as a scene holds it, and the hash of its file where that speaks of it."""
    document = portable(version)
    if typed_once:
        return {**document, "schema_version": 2, TYPED_ONCE: True}, None
    return document, version.sha256


def _bytes(document: Mapping[str, Any]) -> bytes:
    try:
        return document_bytes(document)
    except ValueError as error:  # half a character, which JSON can escape and no file can hold
        raise InputError.of(
            "not-json",
            "the scene's case holds a text that cannot stand in a case",
            hazard="H55",
            next_step="open only scenes that HexaFix saved",
        ) from error


def _step(name: str) -> Step | None:
    return Step(name) if name in tuple(Step) else None


def no_scenes() -> InputError:
    """The door was built without a reader of scenes."""
    return InputError.of(
        "scene-not-opened-here",
        "this program opens no scenes",
        next_step="open the scene in the browser workstation",
    )


def volume_of(content: SceneContent) -> Any:
    """The CT of a scene; InputError if it holds none."""
    if content.volume is None:
        raise InputError.of(
            "no-volume-in-scene",
            "the scene holds no CT",
            where="image.path",
            next_step="choose the CT",
        )
    return content.volume


CHANGED_MEANWHILE = Fault(
    "scene-changed-meanwhile",
    "the scene was not opened: the open case was edited, or the file changed, while it was read",
    hazard="H47",
    next_step="open the scene again when both are at rest",
)


def require_no_scene(target: Path) -> None:
    """InputError if a case were saved under the name of a scene."""
    if is_scene(target):
        raise InputError.of(
            "case-named-as-scene",
            "a case file cannot have the name of a scene",
            limit="a name that does not end in .mrb",
            next_step="save the case as case.json, or save the scene",
        )


class EngineWithScenes:
    """An engine that reads the CT of a scene's file, too.

    Parameters
    ----------
    engine : Engine
    read_scene : ReadScene
    """

    def __init__(self, engine: Engine, read_scene: ReadScene) -> None:
        self._engine, self._read_scene = engine, read_scene

    def __getattr__(self, name: str) -> Any:
        return getattr(self._engine, name)

    def read_image(
        self, path: Path, *, series_instance_uid: str | None = None, progress: Progress = silent
    ) -> Any:
        """Read a CT from its files or from a scene."""
        if not is_scene(path) or path.is_dir():
            return self._engine.read_image(
                path, series_instance_uid=series_instance_uid, progress=progress
            )
        return volume_of(self._read_scene(path, progress=progress))


def with_scenes(engine: Engine, read_scene: ReadScene) -> Engine:
    """The engine, whose images may stand in scenes as well."""
    return cast(Engine, EngineWithScenes(engine, read_scene))
