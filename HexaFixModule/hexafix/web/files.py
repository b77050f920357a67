"""The server's own folders as a chooser shows them: cases, scenes and images, nothing else."""

from __future__ import annotations

from pathlib import Path

from hexafix.errors import InputError

CASE_SUFFIXES = (".json",)
SCENE_SUFFIXES = (".mrb",)
IMAGE_SUFFIXES = (".nrrd", ".nii.gz", ".nii", ".mha")

MOST_ENTRIES = 500
"""A folder of a CT holds thousands of slices: nobody chooses among them one by one."""


def start_folder(case_path: str | None) -> Path:
    """Where a chooser opens: beside the case, else where the program was started."""
    return Path(case_path).resolve().parent if case_path else Path.cwd()


def listing(folder: Path, suffixes: tuple[str, ...]) -> dict[str, object]:
    """Sub-folders and fitting files of a folder, by name; hidden ones are left out.

    Parameters
    ----------
    folder : Path
    suffixes : tuple of str
        What a file's name must end with; empty for folders alone.

    Returns
    -------
    dict
        ``folder`` and ``parent`` as text, ``entries`` with name, path and kind, ``left_out`` (how
        many files were not shown), ``cut`` (whether there are more than can be shown).

    Raises
    ------
    InputError
        If the folder cannot be read.
    """
    folder = folder.expanduser().absolute()
    folders, files, left_out = [], [], 0
    try:
        for path in folder.iterdir():
            if path.name.startswith("."):
                continue
            if path.is_dir():
                folders.append(path)
            elif path.name.lower().endswith(suffixes) and suffixes:
                files.append(path)
            else:
                left_out += 1
    except OSError as error:
        raise InputError.of(
            "folder-unreadable",
            f"the folder cannot be read ({error.strerror or 'no reason given'})",
            where=str(folder),
            next_step="choose another folder",
        ) from None
    entries = [
        {"name": path.name, "path": str(path), "kind": kind}
        for kind, paths in (("folder", folders), ("file", files))
        for path in sorted(paths, key=lambda path: path.name.casefold())
    ]
    return {
        "folder": str(folder),
        "parent": str(folder.parent),
        "entries": entries[:MOST_ENTRIES],
        "left_out": left_out,
        "cut": len(entries) > MOST_ENTRIES,
    }
