"""The CT of a case that was saved from a scene: it has no file but the scene's."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hexafix.progress import Progress

if TYPE_CHECKING:
    from hexafix.case import Case
    from hexafix.imaging import Volume


def scene_volume(case: Case, *, progress: Progress) -> Volume | None:
    """The CT that lies in a scene's file; None where the case's image has files of its own.

    Raises
    ------
    InputError, Refused
        As `hexafix.mrml.scene_file.read_scene`; also if the scene holds no CT.
    """
    path = case.image_path
    if path.suffix.lower() != ".mrb" or path.is_dir():
        return None
    # Not at the top: cases with a CT of their own need neither.
    from hexafix.mrml.scene_file import read_scene
    from hexafix.presenter.scenes import volume_of

    return volume_of(read_scene(path, progress=progress))
