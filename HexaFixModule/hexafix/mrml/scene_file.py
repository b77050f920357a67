"""Case and CT of a scene's file, without MRML: on any thread, beside any scene, and in one piece.

The bundle is checked as for MRML; then the few things that a case needs are taken from the scene's
own text: the parameter node and the attributes of the volume. Results that stand in the scene are
not read: they are computed anew.
"""

from __future__ import annotations

import math
import re
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from urllib.parse import unquote
from xml.parsers import expat

from hexafix.errors import Fault, ImageRefused, Refused
from hexafix.imaging import Volume
from hexafix.mrml.archive import unpack
from hexafix.mrml.bundle_content import NEXT_STEP, SCENE_FILE, check_content
from hexafix.mrml.nodes import ROLE
from hexafix.mrml.parameter_node import ROLE_OF_PARAMETERS, is_as_stored, no_case, shell_of
from hexafix.mrml.volume import VOLUME_ROLE, volume_as_saved
from hexafix.presenter.scenes import SceneContent
from hexafix.progress import Progress, silent
from hexafix.strict_json import parse_json_object

READ = ("ScriptedModule", "Volume", "VolumeArchetypeStorage")
"""Elements of the scene's text that are read."""

_PARAMETER = re.compile(r"parameter\d+$")
_SHA256 = re.compile(r"[0-9a-f]{64}")


def read_scene(path: Path, *, progress: Progress = silent) -> SceneContent:
    """The case and the CT of a scene that HexaFix saved.

    Parameters
    ----------
    path : Path
        The file, ``.mrb``.
    progress : Progress, optional

    Raises
    ------
    InputError
        If the file cannot be read, or holds no case.
    Refused
        If any part of the bundle is not as HexaFix saves it (H48, H49, H50), or if case or CT are
        not those that were saved.
    """
    progress("open the scene", 0.0)
    with tempfile.TemporaryDirectory(prefix="hexafix-") as work:
        folder = Path(work)
        files = unpack(Path(path), folder)
        progress("open the scene", 0.2)
        images = check_content(folder, files, progress=progress)
        scene = next(file for file in files if file.name == SCENE_FILE)
        nodes = _nodes(folder / scene)
    progress("open the scene", 0.8)
    content = _content(nodes, _volume(nodes, images, scene.parent))
    progress("open the scene", 1.0)
    return content


@dataclass
class _Nodes:
    """The elements of a scene's text that are read, and the roles of all."""

    found: dict[str, list[dict[str, str]]] = field(default_factory=dict)
    roles: list[str] = field(default_factory=list)

    def started(self, tag: str, attributes: dict[str, str]) -> None:
        role = _attributes(attributes).get(ROLE)
        if role is not None:
            self.roles.append(role)
        if tag in READ:
            self.found.setdefault(tag, []).append(attributes)

    def only(self, tag: str) -> dict[str, str] | None:
        """The one element of a kind; None without one, refused if there are more."""
        listed = self.found.get(tag, [])
        if len(listed) > 1:
            raise _damaged()
        return listed[0] if listed else None


def _nodes(scene: Path) -> _Nodes:
    """Of a scene's text that `check_content` found to be sound."""
    nodes, parser = _Nodes(), expat.ParserCreate()
    parser.StartElementHandler = nodes.started
    parser.Parse(scene.read_bytes(), True)
    if len(set(nodes.roles)) != len(nodes.roles):
        raise _damaged()
    return nodes


def _attributes(node: Mapping[str, str]) -> dict[str, str]:
    """The attributes that MRML packs into one."""
    pairs = (part.partition(":") for part in node.get("attributes", "").split(";"))
    return {unquote(name): unquote(value) for name, _, value in pairs if name}


def _references(node: Mapping[str, str]) -> dict[str, str]:
    pairs = (part.partition(":") for part in node.get("references", "").split(";"))
    return {name.strip(): ids.strip() for name, _, ids in pairs if name.strip()}


# ---------------------------------------------------------------- the case


def _content(nodes: _Nodes, volume: Volume | None) -> SceneContent:
    node = nodes.only("ScriptedModule")
    if node is None or _attributes(node).get(ROLE) != ROLE_OF_PARAMETERS:
        raise no_case()
    texts = [value for name, value in node.items() if _PARAMETER.fullmatch(name)]
    held = dict(text.split(" ", 1) for text in texts if " " in text)
    if len(held) != len(texts):
        raise _damaged()
    shell = shell_of(held)
    if not shell.caseJson:
        raise no_case()
    if not is_as_stored(shell) or not _SHA256.fullmatch(shell.caseFileSha256):
        raise Refused.of(
            "scene-case-changed",
            "the scene's case is not the one that was saved",
            hazard="H40",
            next_step="save the scene again where it was planned, or open the case file",
        )
    if not math.isfinite(shell.splitFraction):
        raise _damaged()
    document = parse_json_object(shell.caseJson.encode(), what="case of the scene", where="case")
    return SceneContent(
        document=document,
        case_sha256=shell.caseFileSha256,
        volume=volume,
        relaxed=shell.acceptRelaxedLayout,
        step=shell.step,
        computed_to=shell.computedTo,
        split_fraction=shell.splitFraction,
    )


# ---------------------------------------------------------------- the CT


def _volume(
    nodes: _Nodes, images: Mapping[PurePosixPath, Volume], folder: PurePosixPath
) -> Volume | None:
    """The scene's CT, exactly as it was saved; None for a scene without one."""
    node, storage = nodes.only("Volume"), nodes.only("VolumeArchetypeStorage")
    if node is None and storage is None and not images:
        return None
    if node is None or storage is None or len(images) != 1:
        raise _damaged()
    attributes, references = _attributes(node), _references(node)
    image = images.get(folder / storage.get("fileName", ""))
    if image is None or references.get("storage") != storage.get("id"):
        raise _damaged()
    if attributes.get(ROLE) != VOLUME_ROLE or not references.keys() <= {"display", "storage"}:
        raise ImageRefused(_moved())
    if storage.get("centerImage", "0") != "0" or "transformNodeRef" in node:
        raise ImageRefused(_moved())
    return volume_as_saved(image, attributes)


def _moved() -> Fault:
    return Fault(
        "scene-volume-moved",
        "the scene's CT stands under a transform, or is moved when it is read",
        hazard="H36",
        where="volume node",
        next_step="take the CT out from under its transform, without hardening it, and save again",
    )


def _damaged() -> Refused:
    return Refused.of(
        "bundle-damaged",
        "the scene of the bundle cannot be read whole",
        hazard="H49",
        next_step=NEXT_STEP,
    )
