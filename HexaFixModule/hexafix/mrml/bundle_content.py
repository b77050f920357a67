"""What a scene bundle may hold: five kinds of files, a few kinds of nodes, no module but ours.

Everything is checked before any of it is handed to MRML's own readers: the image by our isolated
reader, shapes, points, transforms and the scene itself number by number (H49, H50, H52).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path, PurePath, PurePosixPath
from typing import Any
from xml.parsers import expat

from hexafix.errors import Cancelled, Fault, HexaFixError, Refused
from hexafix.imaging import Volume, read_volume
from hexafix.mrml.mesh_file import check_mesh
from hexafix.mrml.parameter_node import MODULE, PARAMETERS
from hexafix.progress import Progress, silent
from hexafix.strict_json import read_json_object

SCENE_FILE = "scene.mrml"

NODES = {
    **dict.fromkeys(("Selection", "Interaction", "Crosshair", "SubjectHierarchy"), ""),
    **dict.fromkeys(("SubjectHierarchyItem", "ScriptedModule", "LinearTransform", "Table"), ""),
    **dict.fromkeys(("Volume", "VolumeDisplay", "Model", "ModelDisplay", "MarkupsFiducial"), ""),
    **dict.fromkeys(("MarkupsFiducialDisplay", "TransformDisplayNode"), ""),
    "VolumeArchetypeStorage": ".nrrd",
    "ModelStorage": ".vtp",
    "MarkupsJsonStorage": ".mrk.json",
    "TransformStorage": ".tfm",
    "TableStorage": ".tsv",
}
"""Elements of the scene file, and the kind of file that a storage element names."""

MAX_TEXT_BYTES = 16 * 1024 * 1024
"""Of a scene file and of a table; the largest of a hundred days is a hundredth of it."""

MAX_POINTS, FAR_MM = 20_000, 1e5

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_TRANSFORM = re.compile(
    r"#Insight Transform File V1\.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
    rf"Parameters:(?: {_NUMBER}){{12}} ?\nFixedParameters:(?: {_NUMBER}){{3}} ?\n+"
)

NEXT_STEP = "open only bundles that HexaFix saved, and that came a way you trust"


def check_content(
    folder: Path, files: Iterable[PurePosixPath], *, progress: Progress = silent
) -> dict[PurePosixPath, Volume]:
    """Check every file of an unpacked bundle.

    Parameters
    ----------
    folder : Path
        Where the bundle was unpacked.
    files : iterable of PurePosixPath
        Its files, relative to `folder`.
    progress : Progress, optional
        Of the image's reading.

    Returns
    -------
    dict of PurePosixPath
        Its images, which had to be read whole.

    Raises
    ------
    Refused
        With what is wrong, a fault for each file.
    """
    files = list(files)
    faults: list[Fault] = []
    images: dict[PurePosixPath, Volume] = {}

    def check_image(path: Path) -> None:
        images[PurePosixPath(path.relative_to(folder))] = _check_image(path, progress)

    scenes = [path for path in files if path.name == SCENE_FILE]
    if len(scenes) != 1 or len(scenes[0].parts) > 2:
        faults.append(_fault("bundle-damaged", "the bundle holds no scene, or several", "H49"))
    if len(scenes) == 1:
        faults += _scene_faults(folder / scenes[0], scenes[0].parent, set(files))
    # The image last, and only if all else is sound: reading it takes the longest.
    for path in sorted(files, key=lambda path: _kind(path) == ".nrrd"):
        if _kind(path) != ".nrrd" or not faults:
            check = check_image if _kind(path) == ".nrrd" else _CHECKS.get(_kind(path))
            faults += _file_faults(check, folder / path)
    if faults:
        raise Refused(*dict.fromkeys(faults))
    return images


def _file_faults(check: Callable[[Path], None] | None, path: Path) -> Sequence[Fault]:
    if check is None:
        return [_fault("bundle-foreign-file", "a file is of no kind of ours", "H49")]
    try:
        check(path)
    except Cancelled:
        raise
    except HexaFixError as error:
        return error.faults
    except (OSError, UnicodeDecodeError, ValueError, KeyError, TypeError, AttributeError):
        return [_fault("bundle-damaged", f"a {_kind(path)} file is damaged", "H49")]
    return []


def _kind(path: PurePath) -> str:
    return ".mrk.json" if path.name.endswith(".mrk.json") else path.suffix


def _check_image(path: Path, progress: Progress) -> Volume:
    # In a process of its own; also refuses data outside the file (H50).
    return read_volume(path, progress=progress)


def _check_points(path: Path) -> None:
    _, content = read_json_object(path, what="list of points")
    lists = content["markups"]
    if len(lists) != 1 or lists[0]["type"] != "Fiducial":
        raise ValueError
    if lists[0].get("coordinateSystem") != "LPS":
        raise Refused.of(
            "bundle-frame",
            "a list of points does not say that it is in LPS",
            hazard="H36",
            next_step=NEXT_STEP,
        )
    points = lists[0]["controlPoints"]
    if len(points) > MAX_POINTS:
        raise ValueError
    for point in points:
        x, y, z = (float(value) for value in point["position"])
        if not max(abs(x), abs(y), abs(z)) <= FAR_MM:
            raise ValueError


def _check_transform(path: Path) -> None:
    if not _TRANSFORM.fullmatch(_text(path)):
        raise ValueError


def _check_table(path: Path) -> None:
    for line in _text(path).splitlines():
        if not line.replace("\t", " ").isprintable():
            raise ValueError


def _check_scene_size(path: Path) -> None:
    _text(path)


_CHECKS: dict[str, Callable[[Path], None]] = {
    ".vtp": check_mesh,
    ".mrk.json": _check_points,
    ".tfm": _check_transform,
    ".tsv": _check_table,
    ".mrml": _check_scene_size,
}


def _text(path: Path) -> str:
    if path.stat().st_size > MAX_TEXT_BYTES:
        raise ValueError
    return path.read_bytes().decode("utf-8").replace("\r\n", "\n")


class _SceneFile:
    """Faults of a scene file, found while its elements are read."""

    def __init__(self, files: set[PurePosixPath], folder: PurePosixPath) -> None:
        self.faults: list[Fault] = []
        self._files, self._folder = files, folder
        self._depth = 0

    def declared(self, *_: Any) -> None:
        raise ValueError("declarations and entities are not read")

    def ended(self, _: str) -> None:
        self._depth -= 1

    def started(self, tag: str, attributes: dict[str, str]) -> None:
        self._depth += 1
        if self._depth == 1:
            if tag != "MRML":
                raise ValueError("no scene")
            return
        if self._depth > 40:
            raise ValueError("elements in elements in elements")
        if tag not in NODES:
            self.faults.append(
                _fault("bundle-foreign-node", "the scene holds a node of no kind of ours", "H49")
            )
            return
        for name, value in attributes.items():
            self._attribute(tag, name, value)
        if tag == "ScriptedModule":
            self._module(attributes)

    def _attribute(self, tag: str, name: str, value: str) -> None:
        kind = NODES.get(tag, "")
        if kind and (name == "fileName" or _LIST_MEMBER.fullmatch(name)):
            if self._folder / value not in self._files or not value.endswith(kind):
                self.faults.append(
                    _fault("bundle-reference", "a node names a file outside the bundle", "H50")
                )
        elif "file" in name.lower() and name not in _HARMLESS:
            self.faults.append(
                _fault("bundle-reference", "a node names a file in an unknown way", "H50")
            )
        elif name.lower() in ("uri", "url", "urls") or "://" in value:
            self.faults.append(_fault("bundle-reference", "a node names an address", "H50"))

    def _module(self, attributes: dict[str, str]) -> None:
        """Desktop Slicer looks up modules by these names."""
        names = {attributes.get("ModuleName"), attributes.get("singletonTag")}
        held = {
            value.split(" ", 1)[0] for name, value in attributes.items() if _PARAMETER.match(name)
        }
        own = {name for name in attributes if not _PARAMETER.match(name)} <= _NODE_ATTRIBUTES
        if names != {MODULE} or not held <= PARAMETERS or not own:
            self.faults.append(
                _fault("bundle-foreign-module", "the scene holds another module's data", "H49")
            )


_LIST_MEMBER, _PARAMETER = re.compile(r"fileListMember\d+"), re.compile(r"parameter\d+$")

_HARMLESS = ("defaultWriteFileExtension", "UseOrientationFromFile")

_NODE_ATTRIBUTES = {
    *("id", "name", "description", "hideFromEditors", "selectable", "selected", "singletonTag"),
    *("attributes", "references", "userTags", "ModuleName"),
}


def _scene_faults(path: Path, folder: PurePosixPath, files: set[PurePosixPath]) -> list[Fault]:
    reader = _SceneFile(files, folder)
    parser = expat.ParserCreate()
    parser.StartElementHandler = reader.started
    parser.EndElementHandler = reader.ended
    parser.StartDoctypeDeclHandler = reader.declared
    parser.EntityDeclHandler = reader.declared
    parser.ProcessingInstructionHandler = reader.declared
    try:
        parser.Parse(path.read_bytes(), True)
    except (expat.ExpatError, ValueError, OSError):
        return [*reader.faults, _fault("bundle-damaged", "the scene file is damaged", "H49")]
    return reader.faults


def _fault(code: str, what: str, hazard: str) -> Fault:
    return Fault(code, what, hazard=hazard, next_step=NEXT_STEP)
