"""The subject hierarchy: patient, study, plan, named by the case's pseudonym alone (H51)."""

from __future__ import annotations

from typing import Any

from hexafix.mrml.nodes import ROLE, nodes_of, slicer_core

FOLDERS = {
    "volume": "Image",
    "markups": "Balls and numbers",
    "markups/frame": "Frame",
    "markups/landmarks": "Target",
    "model/balls": "Balls and numbers",
    "model/bone": "Bone",
    "model/target": "Target",
    "transform/target": "Target",
    "transform/fragment": "Target",
    "model": "Frame",
    "transform/ring": "Frame",
    "table": "Plan",
    "parameters": "Plan",
}
"""The longest role that a node's role begins with decides its folder."""

STUDY = "Planning"

UID_NAME = "HexaFix"
"""Under it the two levels are found again; their values stand for nobody."""


def arrange(scene: Any, case_id: str) -> int:
    """Put every node of ours below patient, study and folder; returns the patient's item.

    Parameters
    ----------
    scene : vtkMRMLScene
    case_id : str
        The case's pseudonym: the patient's name in the tree.
    """
    tree = slicer_core().vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)
    patient = _level(tree, tree.GetSceneItemID(), "patient", case_id, "CreateSubjectItem")
    study = _level(tree, patient, "study", STUDY, "CreateStudyItem")
    folders: dict[str, int] = {}
    for node in nodes_of(scene):
        title = folder_of(node.GetAttribute(ROLE))
        if title is None:
            continue
        if title not in folders:
            found = tree.GetItemChildWithName(study, title)
            folders[title] = found or tree.CreateFolderItem(study, title)
        item = tree.GetItemByDataNode(node)
        if not item:
            tree.CreateItem(folders[title], node)
        elif tree.GetItemParent(item) != folders[title]:
            tree.SetItemParent(item, folders[title])
    return patient


def _level(tree: Any, parent: int, uid: str, name: str, make: str) -> int:
    """The item of this UID below `parent`, made by method `make` if there is none, so named."""
    item = tree.GetItemByUID(UID_NAME, uid)
    if not item:
        item = getattr(tree, make)(parent, name)
        tree.SetItemUID(item, UID_NAME, uid)
    if tree.GetItemName(item) != name:
        tree.SetItemName(item, name)
    return item


def folder_of(role: str) -> str | None:
    """The folder for a role."""
    parts = role.split("/")
    for end in range(len(parts), 0, -1):
        title = FOLDERS.get("/".join(parts[:end]))
        if title:
            return title
    return None


def tree_of(scene: Any) -> list[tuple[int, str]]:
    """Depth and name of every item of the tree, top down."""
    from vtkmodules.vtkCommonCore import vtkIdList

    tree = slicer_core().vtkMRMLSubjectHierarchyNode.GetSubjectHierarchyNode(scene)
    rows: list[tuple[int, str]] = []

    def below(item: int, depth: int) -> None:
        children = vtkIdList()
        tree.GetItemChildren(item, children)
        for place in range(children.GetNumberOfIds()):
            child = children.GetId(place)
            rows.append((depth, tree.GetItemName(child)))
            below(child, depth + 1)

    below(tree.GetSceneItemID(), 0)
    return rows
