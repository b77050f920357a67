"""NRRD headers: the space, the directions, and where the voxels lie."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from hexafix.errors import ImageRefused, InputError
from hexafix.imaging.file_geometry import (
    FileGeometry,
    detached_fault,
    outside_folder,
    refuse_geometry,
    require_three_dimensions,
)

# Signs that turn the space's axes into left, posterior, superior.
_SPACES = {
    "left-posterior-superior": (1, 1, 1),
    "lps": (1, 1, 1),
    "right-anterior-superior": (-1, -1, 1),
    "ras": (-1, -1, 1),
    "left-anterior-superior": (1, -1, 1),
    "las": (1, -1, 1),
}
_UNITS_MM = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "um": 1e-3, "µm": 1e-3}
_MAX_HEADER = 1 << 20
_LARGEST_SIDE = 10**9
_ENCODINGS = ("raw", "gzip", "gz")
_VECTOR = re.compile(r"\(([^()]*)\)")


def read_nrrd_header(path: Path) -> FileGeometry:
    """Geometry of an NRRD file by its own header.

    Raises
    ------
    InputError
        If it is no three-dimensional NRRD file.
    ImageRefused
        If it has no anatomical space or directions (H07), or points outside its folder (H50).
    """
    fields = _fields(path)
    where = "NRRD header"
    data_file = fields.get("data file", fields.get("datafile"))
    if data_file is not None and _leaves_folder(path, data_file):
        raise ImageRefused(detached_fault(where))
    if data_file is not None and not all(map(Path.is_file, _data_files(path, data_file))):
        # A FIFO would keep its reader waiting, too.
        raise _broken("data file is not there, or no file")
    if fields.get("encoding", "").strip().lower() not in _ENCODINGS:
        # Text is read so loosely that damage to it becomes other numbers.
        raise _broken("encoding")
    try:
        size = tuple(int(n) for n in fields["sizes"].split())
    except (KeyError, ValueError):
        raise _broken("sizes") from None
    require_three_dimensions(len(size), where)
    if not all(1 <= side <= _LARGEST_SIDE for side in size):
        raise _broken("sizes")
    signs = _SPACES.get(fields.get("space", "").strip().lower())
    if signs is None:
        raise ImageRefused(
            refuse_geometry(
                "the space is not named as one of the patient's (LPS, RAS, LAS)",
                where,
                value="another one" if "space" in fields else "none",
            )
        )
    axes, origin = _directions(fields, where)
    unit = _unit(fields, where)
    affine = np.eye(4)
    affine[:3, :3] = np.array(axes).T * unit
    affine[:3, 3] = np.array(origin) * unit
    affine[:3] *= np.array(signs, float)[:, None]
    return FileGeometry((size[0], size[1], size[2]), affine, unit)


def _directions(fields: dict[str, str], where: str) -> tuple[list[list[float]], list[float]]:
    try:
        axes = [_vector(text) for text in _VECTOR.findall(fields["space directions"])]
        origins = [_vector(text) for text in _VECTOR.findall(fields["space origin"])]
    except KeyError as missing:
        raise ImageRefused(refuse_geometry(f"the field {missing} is missing", where)) from None
    except ValueError:
        raise _broken("space directions or space origin") from None
    if len(axes) != 3 or len(origins) != 1 or {len(v) for v in [*axes, *origins]} != {3}:
        raise _broken("space directions or space origin")
    return axes, origins[0]


def _vector(text: str) -> list[float]:
    return [float(part) for part in text.split(",")]


def _unit(fields: dict[str, str], where: str) -> float:
    units = set(re.findall(r'"([^"]*)"', fields.get("space units", '"mm"')))
    if len(units) == 1 and (unit := units.pop().strip().lower()) in _UNITS_MM:
        return _UNITS_MM[unit]
    raise ImageRefused(
        refuse_geometry(
            "the unit of length is not one that HexaFix knows",
            where,
            limit="mm, cm, m or um",
            hazard="H08",
        )
    )


def _fields(path: Path) -> dict[str, str]:
    with path.open("rb") as file:
        head = file.read(_MAX_HEADER)
    end = re.search(rb"\r?\n\r?\n", head)
    text = head[: end.start() if end else len(head)].decode("utf-8", "replace")
    lines = text.splitlines()
    if not lines or not lines[0].startswith("NRRD"):
        raise _broken("magic word")
    fields: dict[str, str] = {}
    for line in lines[1:]:
        name, found, value = line.partition(": ")
        if line.startswith("#") or not found or ":=" in line.split(": ")[0]:
            continue
        name = name.strip().lower()
        if name in fields:
            raise _broken("a field given twice")
        fields[name] = value.strip()
    data = fields.get("data file", fields.get("datafile", ""))
    if data.upper().startswith("LIST"):
        fields["data file"] = data + "\n" + "\n".join(_list_entries(lines))
    return fields


def _list_entries(lines: list[str]) -> list[str]:
    start = next(k for k, line in enumerate(lines) if "LIST" in line.upper())
    return lines[start + 1 :]


def _leaves_folder(path: Path, data_file: str) -> bool:
    first, *entries = data_file.splitlines()
    if first.upper().startswith("LIST"):
        return any(outside_folder(path, entry.strip()) for entry in entries)
    # "name%03d.raw 1 10 1" numbers its files; the name decides the folder.
    return outside_folder(path, first)


def _data_files(path: Path, data_file: str) -> list[Path]:
    """The files of voxels that the header names one by one."""
    first, *entries = data_file.splitlines()
    named = entries if first.upper().startswith("LIST") else [] if "%" in first else [first]
    return [path.parent / entry.strip() for entry in named if entry.strip()]


def _broken(what: str) -> InputError:
    return InputError.of(
        "bad-nrrd",
        "the NRRD header cannot be read",
        value=what,
        where="NRRD header",
        next_step="store the image again",
    )
