"""Nodes of a scene by their role: made once, found again after a reload, removed with their parts.

A role such as ``balls/proximal`` stands in a node's attribute, so that nothing about the scene has
to be remembered beside it.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from typing import Any

from hexafix.errors import MissingLibrary

ROLE = "HexaFix.role"
"""Node attribute that says what a node is to HexaFix."""

PREFIX = "HexaFix."
"""All attributes of ours begin with it."""

NAME = f"{PREFIX}name"
"""The name we gave a node; the user may give it another one, which may name a patient."""


@cache
def slicer_core() -> Any:
    """The module ``slicer``, of desktop Slicer or of slicer-core.

    Raises
    ------
    MissingLibrary
        If there is none.
    """
    try:
        import slicer
    except ImportError as error:
        raise MissingLibrary.of(
            "library-missing",
            "the MRML scene needs slicer-core, which is not installed",
            next_step="install hexafix[workstation], or run HexaFix inside 3D Slicer",
        ) from error
    return slicer


def nodes_of(scene: Any, prefix: str = "") -> Iterator[Any]:
    """All nodes of ours whose role is `prefix` or begins with ``prefix/``."""
    held = scene.GetNodes()
    for index in range(held.GetNumberOfItems()):
        node = held.GetItemAsObject(index)
        role = node.GetAttribute(ROLE)
        if role and (not prefix or role == prefix or role.startswith(f"{prefix}/")):
            yield node


def find(scene: Any, role: str) -> Any | None:
    """The node of a role, None if the scene has none."""
    return next((node for node in nodes_of(scene, role) if node.GetAttribute(ROLE) == role), None)


def ensure(scene: Any, class_name: str, role: str, name: str) -> Any:
    """The node of a role, made and named if the scene has none."""
    node = find(scene, role)
    if node is None:
        node = getattr(slicer_core(), class_name)()
        node.SetName(name)
        node.SetAttribute(ROLE, role)
        scene.AddNode(node)
    if node.GetAttribute(NAME) != name:
        node.SetName(name)
        node.SetAttribute(NAME, name)
    return node


def ensure_displayed(scene: Any, class_name: str, role: str, name: str) -> tuple[Any, Any]:
    """As `ensure`, with its display node."""
    node = ensure(scene, class_name, role, name)
    if node.GetDisplayNode() is None:
        node.CreateDefaultDisplayNodes()
    return node, node.GetDisplayNode()


def remove(scene: Any, prefix: str) -> None:
    """Remove the nodes of a role and below it, with what displays, stores and lists them."""
    tree = scene.GetFirstNodeByClass("vtkMRMLSubjectHierarchyNode")
    for node in list(nodes_of(scene, prefix)):
        # Its item first: the tree looks its nodes up by address.
        if tree is not None and (item := tree.GetItemByDataNode(node)):
            tree.RemoveItem(item, False, False)
        for part in parts_of(node):
            scene.RemoveNode(part)
        scene.RemoveNode(node)


def parts_of(node: Any) -> list[Any]:
    """The display and storage nodes that belong to `node` alone."""
    if not node.IsA("vtkMRMLStorableNode"):
        return []
    parts = [node.GetNthStorageNode(k) for k in range(node.GetNumberOfStorageNodes())]
    if node.IsA("vtkMRMLDisplayableNode"):
        parts += [node.GetNthDisplayNode(k) for k in range(node.GetNumberOfDisplayNodes())]
    return [part for part in parts if part is not None]
