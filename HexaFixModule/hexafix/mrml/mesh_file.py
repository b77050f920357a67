"""A shape's file (.vtp) checked before VTK reads it: plain text, counts and indices that fit."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

MAX_BYTES = 1024**3

TYPES = ("Float32", "Float64", "Int64", "Int32", "UInt8", "Int8")

CELLS = ("Verts", "Lines", "Strips", "Polys")

SECTIONS = ("VTKFile", "PolyData", "FieldData", "Array", "Piece", "PointData", "CellData",
            "Points", "DataArray", "InformationKey", "Value", *CELLS)  # fmt: skip


@dataclass
class _Mesh:
    """What a shape's file holds, as far as it is checked."""

    sizes: dict[str, int] = field(default_factory=dict)
    points: NDArray[np.float64] | None = None
    cells: dict[str, dict[str, NDArray[np.int64]]] = field(default_factory=dict)
    path: list[str] = field(default_factory=list)
    array: dict[str, str] = field(default_factory=dict)
    text: list[str] = field(default_factory=list)

    def declared(self, *_: Any) -> None:
        raise ValueError("declarations and entities are not read")

    def started(self, tag: str, attributes: dict[str, str]) -> None:
        self.path.append(tag)
        if tag not in SECTIONS or len(self.path) > 7:
            raise ValueError("an unknown element")
        if tag == "VTKFile" and (
            attributes.get("type") != "PolyData" or "compressor" in attributes
        ):
            raise ValueError("not a plain mesh")
        if tag in ("DataArray", "Array"):
            if attributes.get("format") != "ascii":
                raise ValueError("not plain text")
            if tag == "DataArray" and attributes.get("type") not in TYPES:
                raise ValueError("an unknown type")
            self.array, self.text = attributes, []
        if tag == "Piece":
            if self.sizes:
                raise ValueError("several pieces")
            self.sizes = {
                name: int(value) for name, value in attributes.items() if name.startswith("Number")
            }
            if any(size < 0 for size in self.sizes.values()):
                raise ValueError("a negative size")

    def said(self, text: str) -> None:
        if self.path[-1] == "DataArray":
            self.text.append(text)

    def ended(self, tag: str) -> None:
        self.path.pop()
        if tag == "DataArray":
            self._take()

    def _take(self) -> None:
        numbers = np.array("".join(self.text).split(), np.float64)
        if not np.all(np.isfinite(numbers)):
            raise ValueError("a value that is no number")
        section, components = self.path[-1], int(self.array.get("NumberOfComponents", "1"))
        if section in CELLS:
            self.cells.setdefault(section, {})[self.array["Name"]] = numbers.astype(np.int64)
            return
        per = {"Points": "NumberOfPoints", "PointData": "NumberOfPoints"}.get(section)
        if per is not None and len(numbers) != self.sizes[per] * components:
            raise ValueError("a wrong number of values")
        if section == "Points":
            if components != 3:
                raise ValueError("points are not of three numbers")
            self.points = numbers


def check_mesh(path: Path) -> None:
    """Check a mesh file.

    Raises
    ------
    ValueError
        If it is not a mesh in plain text whose arrays have the stated sizes and whose cells name
        points that are there.
    """
    if path.stat().st_size > MAX_BYTES:
        raise ValueError("too large")
    mesh = _Mesh()
    parser = expat.ParserCreate()
    parser.buffer_text = True
    parser.StartElementHandler = mesh.started
    parser.EndElementHandler = mesh.ended
    parser.CharacterDataHandler = mesh.said
    parser.StartDoctypeDeclHandler = mesh.declared
    parser.EntityDeclHandler = mesh.declared
    parser.ProcessingInstructionHandler = mesh.declared
    try:
        with path.open("rb") as file:
            parser.ParseFile(file)
    except expat.ExpatError as error:
        raise ValueError("no XML") from error
    _check_cells(mesh)


def _check_cells(mesh: _Mesh) -> None:
    count = mesh.sizes["NumberOfPoints"]
    if mesh.points is None and count:
        raise ValueError("no points")
    for section in CELLS:
        arrays = mesh.cells.get(section, {})
        ends = arrays.get("offsets", np.zeros(0, np.int64))
        corners = arrays.get("connectivity", np.zeros(0, np.int64))
        if len(ends) != mesh.sizes.get(f"NumberOf{section}", 0):
            raise ValueError("a wrong number of cells")
        steps = np.diff(ends, prepend=0)
        if np.any(steps < 0) or (ends[-1] if len(ends) else 0) != len(corners):
            raise ValueError("cells that do not fit")
        if len(corners) and not (corners.min() >= 0 and corners.max() < count):
            raise ValueError("a cell of a point that is not there")
