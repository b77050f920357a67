"""Our nodes from one scene into another: nothing else goes along, and no text but our own (H51).

A list of what may go, not of what must not: a scene of desktop Slicer holds whatever other modules
and the hospital's headers put there.
"""

from __future__ import annotations

from typing import Any

from hexafix.mrml.nodes import NAME, PREFIX, ROLE, nodes_of, parts_of
from hexafix.mrml.parameter_node import ROLE_OF_PARAMETERS, copy_parameters, parameter_node

ATTRIBUTES = ("ModuleName",)
"""Attributes that go along besides our own."""

DISPLAY, STORAGE = "display", "storage"


def copy_nodes(source: Any, target: Any) -> dict[str, Any]:
    """Copy our nodes of a scene, with what displays them, into another scene.

    Parameters
    ----------
    source, target : vtkMRMLScene

    Returns
    -------
    dict of str
        The new nodes by their role. Voxels and shapes are shared with the source, not copied.
    """
    pairs: dict[str, Any] = {}
    made: dict[str, Any] = {}
    nodes = list(nodes_of(source))
    displays = [part for node in nodes for part in parts_of(node) if part.IsA("vtkMRMLDisplayNode")]
    for part in displays:
        pairs[part.GetID()] = target.AddNode(_twin(part, part.GetNodeTagName()))
    for node in nodes:
        role = node.GetAttribute(ROLE)
        if role == ROLE_OF_PARAMETERS:
            twin = parameter_node(target)
        else:
            twin = _twin(node, node.GetAttribute(NAME) or node.GetNodeTagName())
            # Before it is added: a scene gives a node without display one of its own.
            for part in parts_of(node):
                if part.GetID() in pairs:
                    twin.AddNodeReferenceID(DISPLAY, pairs[part.GetID()].GetID())
            target.AddNode(twin)
        pairs[node.GetID()], made[role] = twin, twin
    for node in [*displays, *nodes]:
        _refer(node, pairs[node.GetID()], pairs, target)
    for node in nodes:
        if node.GetAttribute(ROLE) == ROLE_OF_PARAMETERS:
            copy_parameters(node, pairs[node.GetID()])
    return made


def _twin(node: Any, name: str) -> Any:
    """A node of the same class and content, our attributes, and no other text."""
    twin = node.CreateNodeInstance()
    twin.CopyContent(node, False)
    twin.SetName(name)
    twin.SetDescription("")
    names = list(twin.GetAttributeNames())
    for name_ in names:
        if not name_.startswith(PREFIX) and name_ not in ATTRIBUTES:
            twin.RemoveAttribute(name_)
    for name_ in node.GetAttributeNames():
        if name_.startswith(PREFIX):
            twin.SetAttribute(name_, node.GetAttribute(name_))
    return twin


def _refer(node: Any, twin: Any, pairs: dict[str, Any], target: Any) -> None:
    """Let a twin refer to twins, or to nodes that both scenes have, as the colour tables."""
    for place in range(node.GetNumberOfNodeReferenceRoles()):
        role = node.GetNthNodeReferenceRole(place)
        if role == STORAGE:
            continue
        ids = [
            node.GetNthNodeReferenceID(role, k) for k in range(node.GetNumberOfNodeReferences(role))
        ]
        known = [pairs[i].GetID() if i in pairs else i for i in ids]
        kept = [i for i in known if i and target.GetNodeByID(i) is not None]
        held = [
            twin.GetNthNodeReferenceID(role, k) for k in range(twin.GetNumberOfNodeReferences(role))
        ]
        if held == kept:
            continue
        twin.RemoveNodeReferenceIDs(role)
        for reference in kept:
            twin.AddNodeReferenceID(role, reference)
