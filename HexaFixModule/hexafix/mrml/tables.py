"""The strut schedule as a table node, with the same characters as ``schedule.csv``."""

from __future__ import annotations

from typing import Any

from hexafix.mrml.nodes import ensure
from hexafix.report.tables import SCHEDULE_COLUMNS, schedule_csv

ROLE_OF_TABLE = "table/struts"


def put_strut_table(scene: Any, document: dict[str, Any], name: str = "Strut schedule") -> Any:
    """The table node of a plan document's schedule: scale values, text as printed, mm.

    Parameters
    ----------
    scene : vtkMRMLScene
    document : dict
        A plan document, ``plan.json``.
    name : str
    """
    from vtkmodules.vtkCommonCore import vtkStringArray

    lines = schedule_csv(document).decode("utf-8").splitlines()
    rows = [line.split(",") for line in lines[1:]]
    node = ensure(scene, "vtkMRMLTableNode", ROLE_OF_TABLE, name)
    state = node.StartModify()
    node.RemoveAllColumns()
    for place, title in enumerate(SCHEDULE_COLUMNS):
        column = vtkStringArray()
        column.SetName(title)
        for row in rows:
            column.InsertNextValue(row[place])
        node.AddColumn(column)
        if title.endswith("_mm"):
            node.SetColumnUnitLabel(title, "mm")
    node.SetUseColumnTitleAsColumnHeader(True)
    node.SetLocked(True)
    node.EndModify(state)
    return node


def table_rows(node: Any) -> list[list[str]]:
    """The titles, then the rows, of a table node as text."""
    table = node.GetTable()
    columns = range(table.GetNumberOfColumns())
    rows = [[table.GetColumnName(c) for c in columns]]
    for row in range(table.GetNumberOfRows()):
        rows.append([table.GetValue(row, c).ToString() for c in columns])
    return rows
