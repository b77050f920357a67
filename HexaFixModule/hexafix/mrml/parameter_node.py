"""The parameter node: the whole case and what a shell remembers, as Slicer's wrapper writes it.

A scalar is ``str(value)``, an enumeration its member's name, a nested class ``outer.inner``, a node
an empty text and a reference of the same name: what desktop Slicer's ``parameterNodeWrapper`` reads
and writes. The case stands there without the image's path and series, which may name somebody
(H51): in a scene the image is the volume node.
"""

from __future__ import annotations

import copy
import dataclasses
import enum
import hashlib
import json
import pathlib
import typing
from collections.abc import Mapping
from typing import Any

from hexafix.case import Case, case_from_document
from hexafix.errors import InputError
from hexafix.hardware.definition import shipped_fixators
from hexafix.mrml.nodes import ROLE, find, slicer_core
from hexafix.strict_json import parse_json_object

MODULE = "HexaFixModule"
"""The scripted module whose parameters these are."""

ROLE_OF_PARAMETERS = "parameters"

IN_THE_SCENE = "volume-node"
"""What stands for the image's path: the volume node that `inputVolume` refers to."""


Kind = typing.TypeVar("Kind")


@dataclasses.dataclass
class ShellParameters:
    """What stands in the parameter node; the names are those of desktop Slicer's wrapper.

    Attributes
    ----------
    caseJson : str
        The case document, LPS, without path and series of the image; empty: no case.
    caseJsonSha256, caseFileSha256 : str
        Of that text when it was stored, and of the case file it came from.
    inputVolume : vtkMRMLScalarVolumeNode or None
    step : str
        Where the user stands, ``load`` to ``export``.
    splitFraction : float
        Where the bone is cut for the picture, from the distal (0) to the proximal ring (1).
    acceptRelaxedLayout : bool
    playbackRow : int
        -1: what the CT shows.
    computedTo : str
        The last step of those whose results were done one after the other; empty: none.
    """

    caseJson: str = ""  # noqa: N815
    caseJsonSha256: str = ""  # noqa: N815
    caseFileSha256: str = ""  # noqa: N815
    inputVolume: Any = None  # noqa: N815
    step: str = "load"
    splitFraction: float = 0.5  # noqa: N815
    acceptRelaxedLayout: bool = False  # noqa: N815
    playbackRow: int = -1  # noqa: N815
    computedTo: str = ""  # noqa: N815


def parameter_node(scene: Any) -> Any:
    """The module's parameter node, made if the scene has none."""
    node = find(scene, ROLE_OF_PARAMETERS) or scene.GetSingletonNode(
        MODULE, "vtkMRMLScriptedModuleNode"
    )
    if node is None:
        node = slicer_core().vtkMRMLScriptedModuleNode()
        node.SetSingletonTag(MODULE)
        node.SetName(MODULE)
        node.SetModuleName(MODULE)
        node.SetAttribute("ModuleName", MODULE)
        node = scene.AddNode(node)
    if node.GetAttribute(ROLE) is None:
        node.SetAttribute(ROLE, ROLE_OF_PARAMETERS)
    return node


PARAMETERS = frozenset(field.name for field in dataclasses.fields(ShellParameters))
"""Names of all parameters."""


def copy_parameters(source: Any, target: Any) -> None:
    """Copy the values of a parameter node, the case without what may name somebody (H51)."""
    shell = read(source, ShellParameters)
    if shell.caseJson:
        document = parse_json_object(shell.caseJson.encode(), what="case", where="caseJson")
        bare = without_image(document)
        if bare != document:
            text = json.dumps(bare, allow_nan=False)
            shell = dataclasses.replace(
                shell, caseJson=text, caseJsonSha256=_sha256(text), caseFileSha256=_sha256(text)
            )
    shell.inputVolume = target.GetNodeReference("inputVolume")
    write(target, shell)


def write(node: Any, parameters: Any, prefix: str = "") -> None:
    """Write a dataclass instance into a parameter node."""
    state = node.StartModify()
    for field in dataclasses.fields(parameters):
        key, value = prefix + field.name, getattr(parameters, field.name)
        if dataclasses.is_dataclass(value):
            write(node, value, f"{key}.")
        elif value is None or hasattr(value, "IsA"):
            node.SetParameter(key, "")
            node.SetNodeReferenceID(key, value.GetID() if value is not None else None)
        else:
            node.SetParameter(key, value.name if isinstance(value, enum.Enum) else str(value))
    node.EndModify(state)


def read(node: Any, kind: type[Kind], prefix: str = "") -> Kind:
    """A dataclass instance from a parameter node; what it lacks keeps its default.

    Raises
    ------
    InputError
        If a value is not one of its kind.
    """
    found: dict[str, Any] = {}
    for name, hint in typing.get_type_hints(kind).items():
        key = prefix + name
        raw = node.GetParameter(key) or ""
        if dataclasses.is_dataclass(hint):
            found[name] = read(node, typing.cast(type, hint), f"{key}.")
        elif node.GetNodeReferenceID(key):
            found[name] = node.GetNodeReference(key)
        elif raw:
            found[name] = _value(raw, hint, name)
    return kind(**found)


def _value(raw: str, hint: Any, name: str) -> Any:
    try:
        if hint is bool:
            return {"True": True, "False": False}[raw]
        if isinstance(hint, type) and issubclass(hint, enum.Enum):
            return hint[raw]
        if hint in (int, float, str, pathlib.Path):
            return hint(raw)
    except (KeyError, ValueError):
        raise InputError.of(
            "parameter-value",
            "the scene's parameter node holds a value that HexaFix does not know",
            where=name,
            hazard="H55",
            next_step="open the scene that HexaFix saved, or start with a new one",
        ) from None
    return None


def without_image(document: Mapping[str, Any]) -> dict[str, Any]:
    """A case document, draft or whole, without what may name somebody: path, series, file paths.

    A fixator given by the path of a file is left out; a `Case` holds its definition instead.
    """
    bare = copy.deepcopy(dict(document))
    bare["image"] = {"path": IN_THE_SCENE, "series_instance_uid": None}
    fixator = bare.get("fixator")
    if isinstance(fixator, str) and fixator not in shipped_fixators():
        del bare["fixator"]
    return bare


def shell_of(held: Mapping[str, str]) -> ShellParameters:
    """The parameters of a scene that no MRML reads, by name; what it lacks keeps its default.

    Raises
    ------
    InputError
        If a value is not one of its kind.
    """
    hints = typing.get_type_hints(ShellParameters)
    found = {name: _value(raw, hints[name], name) for name, raw in held.items() if raw}
    return ShellParameters(**found)


def store_case(
    scene: Any, case: Case | Mapping[str, Any], *, case_sha256: str | None = None, **shell: Any
) -> Any:
    """Put a case or a draft into the parameter node.

    Parameters
    ----------
    scene : vtkMRMLScene
    case : Case or mapping
    case_sha256 : str, optional
        Hash of the case file that a draft is the content of; of what is stored if not given.
    **shell
        Other `ShellParameters` by name.
    """
    node = parameter_node(scene)
    kept = read(node, ShellParameters)
    whole = isinstance(case, Case)
    text = json.dumps(without_image(case.document if whole else case), allow_nan=False)
    changed = dataclasses.replace(
        kept,
        caseJson=text,
        caseJsonSha256=_sha256(text),
        caseFileSha256=case.case_sha256 if whole else case_sha256 or _sha256(text),
        **shell,
    )
    if changed != kept:
        write(node, changed)
    return node


def stored_document(scene: Any) -> dict[str, Any] | None:
    """The case document of the scene, draft or whole, its image being the volume node; or None."""
    node = find(scene, ROLE_OF_PARAMETERS)
    text = read(node, ShellParameters).caseJson if node is not None else ""
    if not text:
        return None
    return parse_json_object(text.encode(), what="case of the scene", where="caseJson")


def stored_case(scene: Any, *, plannable: bool = True) -> Case:
    """The case of the scene; its hash is the case file's, as long as nobody changed it.

    Raises
    ------
    InputError
        If the scene holds no case, or a faulty one.
    """
    node = find(scene, ROLE_OF_PARAMETERS)
    shell = ShellParameters() if node is None else read(node, ShellParameters)
    if not shell.caseJson:
        raise no_case()
    case = case_from_document(
        shell.caseJson.encode(), folder=pathlib.Path(), needs_image=False, plannable=plannable
    )
    untouched = is_as_stored(shell) and shell.caseFileSha256
    return dataclasses.replace(case, case_sha256=shell.caseFileSha256) if untouched else case


def is_as_stored(shell: ShellParameters) -> bool:
    """Whether nobody changed the case since it was stored."""
    return _sha256(shell.caseJson) == shell.caseJsonSha256


def no_case() -> InputError:
    """The scene holds no case."""
    return InputError.of(
        "no-case-in-scene",
        "the scene holds no case",
        next_step="open a case, or a scene that HexaFix saved",
    )


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
