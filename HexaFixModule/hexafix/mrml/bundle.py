"""The scene as one file (``.mrb``): pseudonymous when saved, distrusted when opened.

A bundle holds our nodes and nothing else of the scene (H51). When one is opened, the archive, every
file and the scene's own text are checked, then it is read into a scene of its own; only if all of
that succeeds does the user's scene change.
"""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Any

from hexafix.errors import Refused
from hexafix.mrml import hierarchy
from hexafix.mrml.app import HeadlessMrmlApp
from hexafix.mrml.archive import IMAGE, not_written, pack, unpack
from hexafix.mrml.bundle_content import NEXT_STEP, SCENE_FILE, check_content
from hexafix.mrml.markups import ROWS
from hexafix.mrml.nodes import ROLE, nodes_of, remove
from hexafix.mrml.parameter_node import stored_document
from hexafix.mrml.transfer import copy_nodes
from hexafix.progress import Progress, silent

TOP = "hexafix"
"""The archive's one folder; its name says nothing of case or patient."""

EXTENSIONS = {
    "vtkMRMLScalarVolumeNode": IMAGE,
    "vtkMRMLModelNode": ".vtp",
    "vtkMRMLMarkupsFiducialNode": ".mrk.json",
    "vtkMRMLLinearTransformNode": ".tfm",
    "vtkMRMLTableNode": ".tsv",
}
"""Class of a node and the kind of file that holds its content."""


class TakenBundle:
    """A scene as it was when it was taken, to be written on any thread and whatever becomes of it.

    Nothing of MRML is left in it: the files of a bundle, in a folder of their own until they are
    written or given up.

    Parameters
    ----------
    scene : vtkMRMLScene
        On its own thread; its voxels are not packed yet, so that this takes moments.

    Raises
    ------
    InputError
        If there is no room for its files.
    """

    def __init__(self, scene: Any) -> None:
        self._work = tempfile.TemporaryDirectory(prefix="hexafix-")
        try:
            write_files(scene, Path(self._work.name))
        except BaseException:
            self.give_up()
            raise

    def write(self, path: Path, *, progress: Progress = silent) -> None:
        """Write the bundle, all or nothing, and forget it.

        Parameters
        ----------
        path : Path
            The file, ``.mrb``.
        progress : Progress, optional

        Raises
        ------
        InputError
            If it cannot be written; an older file is left as it was.
        """
        try:
            pack(Path(self._work.name), Path(path), progress=progress)
        finally:
            self.give_up()

    def give_up(self) -> None:
        """Forget it."""
        self._work.cleanup()


def save_bundle(scene: Any, path: Path) -> None:
    """Save our nodes of a scene as a bundle, all or nothing.

    Parameters
    ----------
    scene : vtkMRMLScene
    path : Path
        The file, ``.mrb``.

    Raises
    ------
    InputError
        If it cannot be written; an older file is left as it was.
    """
    TakenBundle(scene).write(path)


def write_files(scene: Any, work: Path) -> None:
    """Write the files of a bundle, its voxels plain, below an empty folder."""
    with HeadlessMrmlApp() as app:
        nodes = copy_nodes(scene, app.scene)
        document = stored_document(app.scene) or {}
        hierarchy.arrange(app.scene, str(document.get("case_id") or "case"))
        top = work / TOP
        (top / "Data").mkdir(parents=True)
        app.scene.SetRootDirectory(str(top))
        for role, node in nodes.items():
            _write(node, top / "Data" / role.replace("/", "-"))
        app.scene.SetURL(str(top / SCENE_FILE))
        if not app.scene.Commit():
            raise not_written("no room for its scene file")


def _write(node: Any, stem: Path) -> None:
    """Write a node's content beside the scene file."""
    extension = EXTENSIONS.get(node.GetClassName())
    if extension is None:
        return
    node.AddDefaultStorageNode()
    storage = node.GetStorageNode()
    # Shapes as plain text, so that every number can be checked when they come back; voxels are
    # packed with the bundle.
    if extension == IMAGE:
        # Left as it is stored: a mirrored index must come back mirrored.
        storage.SetForceRightHandedIJKCoordinateSystem(False)
    storage.SetUseCompression(extension not in (".vtp", IMAGE))
    storage.SetFileName(f"{stem}{extension}")
    if not storage.WriteData(node):
        raise not_written(f"no room for its {extension} files")
    if extension == IMAGE:
        storage.SetUseCompression(True)  # as it will be once it is packed


def open_bundle(scene: Any, path: Path) -> None:
    """Put the nodes of a bundle into a scene in place of our nodes there.

    Parameters
    ----------
    scene : vtkMRMLScene
        Left as it was if the bundle is refused.
    path : Path

    Raises
    ------
    InputError
        If the file cannot be read.
    Refused
        If any part of it is not as HexaFix saves it (H48, H49, H50).
    """
    with tempfile.TemporaryDirectory(prefix="hexafix-") as work, HeadlessMrmlApp() as app:
        files = unpack(Path(path), Path(work))
        check_content(Path(work), files)
        scene_file = next(file for file in files if file.name == SCENE_FILE)
        app.scene.SetURL(str(Path(work) / scene_file))
        if not app.scene.Import() or not _complete(app.scene):
            raise Refused.of(
                "bundle-damaged",
                "the scene of the bundle cannot be read whole",
                hazard="H49",
                next_step=NEXT_STEP,
            )
        remove(scene, "")
        copy_nodes(app.scene, scene)
        document = stored_document(scene) or {}
        hierarchy.arrange(scene, str(document.get("case_id") or "case"))


def _complete(scene: Any) -> bool:
    """Whether the scene holds nodes of ours, one a role, each with its content."""
    roles = [node.GetAttribute(ROLE) for node in nodes_of(scene)]
    if not roles or len(set(roles)) != len(roles):
        return False
    return all(_filled(node) for node in nodes_of(scene))


def _filled(node: Any) -> bool:
    """Whether a node's file was read into it."""
    if node.IsA("vtkMRMLScalarVolumeNode"):
        return node.GetImageData() is not None
    if node.IsA("vtkMRMLModelNode"):
        return node.GetPolyData() is not None
    if node.IsA("vtkMRMLMarkupsNode"):
        return node.GetNumberOfControlPoints() == len(json.loads(node.GetAttribute(ROWS) or "[]"))
    return not node.IsA("vtkMRMLTableNode") or node.GetNumberOfColumns() > 0
