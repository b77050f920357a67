"""A command as SlicerExecutionModel XML, told by the command's own parameters.

Slicer, 3D workstations and workflow tools read such a description and compose the command line
from it; nothing here is a second list of options. Flags are written with underscores, which the
schema asks for and the command line takes as well.
"""

from __future__ import annotations

import inspect
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints
from xml.etree import ElementTree

from cyclopts import App, Argument

from hexafix import __version__

XML = "--xml"
"""The one argument by which such tools ask for the description."""

CATEGORY = "Orthopedics"
LICENSE = "Apache-2.0"
CONTRIBUTOR = "HexaFix developers"

SCALARS = {bool: "boolean", int: "integer", float: "double", str: "string"}

FOR_SCRIPTS = ("json", "quiet")
"""What a terminal or a script wants; a form hides them behind its advanced options."""


@dataclass(frozen=True, slots=True)
class Channel:
    """What a path of a command is; stands beside its cyclopts parameter in the annotation.

    Attributes
    ----------
    tag : str
        ``file`` or ``directory``.
    direction : str
        ``input`` or ``output``.
    extensions : str
        Of a file, with dots and commas.
    """

    tag: Literal["file", "directory"]
    direction: Literal["input", "output"]
    extensions: str = ""


def execution_model_xml(app: App, command: str) -> str:
    """The description of `command`, ending in a newline.

    Raises
    ------
    TypeError
        If a parameter is of a kind that the description cannot say.
    """
    sub = app[command]
    function = sub.default_command
    assert function is not None
    hints = get_type_hints(function, include_extras=True)
    root = ElementTree.Element("executable")
    title = f"HexaFix {command.replace('-', ' ')}"
    notice = "Research software, not a medical device."
    summary = inspect.cleandoc(function.__doc__ or "").split("\n\n")[0]
    for tag, text in (
        ("category", CATEGORY),
        ("title", title),
        ("description", f"{' '.join(summary.split())} {notice}"),
        ("version", __version__),
        ("license", LICENSE),
        ("contributor", CONTRIBUTOR),
    ):
        ElementTree.SubElement(root, tag).text = text
    arguments = [a for a in sub.assemble_argument_collection() if XML not in a.names]
    shown = [a for a in arguments if a.field_info.name not in FOR_SCRIPTS]
    hidden = [a for a in arguments if a.field_info.name in FOR_SCRIPTS]
    _group(root, "Parameters", f"What {title} needs and does.", shown, hints)
    if hidden:
        _group(root, "Terminal", "What is printed.", hidden, hints).set("advanced", "true")
    ElementTree.indent(root, " ")
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ElementTree.tostring(
        root, encoding="unicode"
    ) + "\n"  # fmt: skip


def _group(
    root: ElementTree.Element,
    label: str,
    description: str,
    arguments: list[Argument],
    hints: dict[str, Any],
) -> ElementTree.Element:
    group = ElementTree.SubElement(root, "parameters")
    ElementTree.SubElement(group, "label").text = label
    ElementTree.SubElement(group, "description").text = description
    for argument in arguments:
        group.append(_parameter(argument, hints[argument.field_info.name]))
    return group


def _parameter(argument: Argument, hint: Any) -> ElementTree.Element:
    """One parameter, its elements in the order of the schema."""
    name = argument.field_info.name
    default = argument.field_info.default
    channels = [extra for extra in get_args(hint)[1:] if isinstance(extra, Channel)]
    choices = get_args(argument.hint) if get_origin(argument.hint) is Literal else ()
    element = ElementTree.Element(_tag(name, argument.hint, channels, choices))
    if channels and channels[0].extensions:
        element.set("fileExtensions", channels[0].extensions)
    entries = [("name", name), *_flags(argument)]
    entries += [("description", argument.parameter.help or ""), ("label", _label(name))]
    if default is not inspect.Parameter.empty and default is not None:
        entries.append(("default", _text(name, default)))
    entries += [("channel", channel.direction) for channel in channels]
    entries += [("element", str(choice)) for choice in choices]
    for tag, text in entries:
        ElementTree.SubElement(element, tag).text = text
    return element


def _tag(name: str, hint: Any, channels: list[Channel], choices: tuple[Any, ...]) -> str:
    if hint is Path and len(channels) == 1:
        return channels[0].tag
    if choices and all(isinstance(choice, str) for choice in choices):
        return "string-enumeration"
    if hint in SCALARS and not channels:
        return SCALARS[hint]
    raise TypeError(f"{name}: the description has no element for {hint}; a path needs a Channel")


def _flags(argument: Argument) -> list[tuple[str, str]]:
    """The schema's flag and longflag, or the index of a positional argument."""
    if argument.index is not None:
        return [("index", str(argument.index))]
    short = [name for name in argument.names if not name.startswith("--")]
    long = [name for name in argument.names if name.startswith("--")]
    return [
        *(("flag", name) for name in short[:1]),
        *(("longflag", "--" + name[2:].replace("-", "_")) for name in long[:1]),
    ]


def _label(name: str) -> str:
    return name.replace("_", " ").capitalize()


def _text(name: str, default: Any) -> str:
    if isinstance(default, bool):
        if default:
            raise TypeError(f"{name}: a flag that is on by default cannot be switched off")
        return "false"
    return str(default)
