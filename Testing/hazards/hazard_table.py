"""The hazard table as data: read, checked against the tree, printed as Markdown.

``python Testing/hazards/hazard_table.py`` writes the tables of Resources/Documents/hazards.md anew
from hazards.toml; what stands outside the marks there is written by hand.
"""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
TOP = HERE.parents[1]
PACKAGE = Path("HexaFixModule/hexafix")
DOCUMENT = Path("Resources/Documents/hazards.md")
STATUS = ("tested", "partly", "not built")
CODE = re.compile(r"[a-z*][a-z0-9*]*(-[a-z0-9*]+)*")
HAZARD = re.compile(r"H[0-5][0-9]")
NO_PLAN = ("benchmark", "comparison", "phantom", "scenarios", "study")
"""Rooms that make synthetic data or measure: no patient's plan passes through their faults."""
_CODE_ARGUMENT = {"Fault": 0, "of": 0, "fault": 0, "_fault": 0, "Gate": 1, "at_most": 1}


@dataclass(frozen=True)
class Removal:
    """A change of the package's source that takes one gate away.

    Attributes
    ----------
    file : Path
        Relative to the checkout.
    function : str or None
        Qualified name in that file whose body becomes ``return <put>``.
    find : str or None
        Else the text, there once, that `put` replaces.
    put : str
    """

    file: Path
    function: str | None
    find: str | None
    put: str

    def applied(self, source: str) -> str:
        """The source without the gate; LookupError if the gate is not there any more."""
        if self.find is not None:
            if source.count(self.find) != 1:
                raise LookupError(f"{self.file}: not there once: {self.find!r}")
            return source.replace(self.find, self.put)
        node = function_of(ast.parse(source), self.function or "")
        if node is None:
            raise LookupError(f"{self.file}: no function {self.function}")
        lines = source.splitlines(keepends=True)
        first, last = node.body[0], node.body[-1]
        indent = " " * first.col_offset
        body = f"{indent}return {self.put}\n"
        return "".join([*lines[: first.lineno - 1], body, *lines[last.end_lineno :]])


@dataclass(frozen=True)
class Gate:
    """One detection of a hazard: what finds it, what proves it, what takes it away."""

    row: str
    number: int
    codes: tuple[str, ...]
    by: str
    limit: str
    tests: tuple[str, ...]
    removal: Removal

    @property
    def name(self) -> str:
        return f"{self.row}.{self.number}"


@dataclass(frozen=True)
class Row:
    """One hazard or one mandatory gate."""

    id: str
    fault: str
    status: str
    missing: str
    behaviour: str
    residual: str
    gates: tuple[Gate, ...]


def load() -> tuple[list[Row], dict[str, str]]:
    """Rows of the table, and the codes of faults that are no hazard with the reason."""
    data = tomllib.loads((HERE / "hazards.toml").read_text("utf-8"))
    return [_row(row) for row in data["row"]], data["no_hazard"]


def _row(data: dict[str, Any]) -> Row:
    gates = tuple(_gate(data["id"], n, gate) for n, gate in enumerate(data.get("gate", []), 1))
    keys = ("id", "fault", "status", "missing", "behaviour", "residual")
    return Row(*(data.get(key, "") for key in keys), gates)


def _gate(row: str, number: int, data: dict[str, Any]) -> Gate:
    remove = data["remove"]
    file, function = place(remove.get("at", data["by"]))
    find = remove.get("find")
    removal = Removal(file, None if find else function, find, remove["put"])
    codes = data.get("codes", [])
    return Gate(row, number, tuple(codes), data["by"], data["limit"], tuple(data["tests"]), removal)


def place(dotted: str) -> tuple[Path, str]:
    """File and qualified name of ``room.module.name``; the name may be a method's."""
    parts = dotted.split(".")
    for count in range(len(parts), 0, -1):
        file = PACKAGE.joinpath(*parts[:count]).with_suffix(".py")
        if (TOP / file).is_file():
            return file, ".".join(parts[count:])
    raise LookupError(f"no module of the package: {dotted}")


def function_of(tree: ast.Module, name: str) -> ast.FunctionDef | None:
    """The function or method of a qualified name."""
    body: list[ast.stmt] = tree.body
    found: ast.stmt | None = None
    for part in name.split("."):
        kinds = (ast.FunctionDef, ast.ClassDef)
        found = next((n for n in body if isinstance(n, kinds) and n.name == part), None)
        if found is None:
            return None
        body = found.body
    return found if isinstance(found, ast.FunctionDef) else None


def has_name(file: Path, name: str) -> bool:
    """Whether a module defines a function, method, class or value of this qualified name."""
    tree = ast.parse((TOP / file).read_text("utf-8"))
    if name == "" or function_of(tree, name) is not None:
        return True
    plain = [n for n in tree.body if isinstance(n, ast.ClassDef) and n.name == name]
    values = [
        target.id
        for n in tree.body
        if isinstance(n, ast.Assign)
        for target in n.targets
        if isinstance(target, ast.Name)
    ]
    return bool(plain) or name in values


def test_functions(file: Path) -> set[str]:
    """Names of the test functions of a test file."""
    tree = ast.parse(file.read_text("utf-8"))
    return {n.name for n in tree.body if isinstance(n, ast.FunctionDef) and n.name[:5] == "test_"}


def package_files(*, everywhere: bool = False) -> Iterator[tuple[Path, ast.Module]]:
    """Every module of the package with its syntax tree; else without the rooms of `NO_PLAN`."""
    for file in sorted((TOP / PACKAGE).rglob("*.py")):
        if file.relative_to(TOP / PACKAGE).parts[0] in NO_PLAN and not everywhere:
            continue
        yield file.relative_to(TOP), ast.parse(file.read_text("utf-8"))


def codes_of(tree: ast.Module) -> set[str]:
    """Fault codes that a module can give; ``*`` stands for what is filled in."""
    found: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = node.func.id if isinstance(node.func, ast.Name) else None
            name = node.func.attr if isinstance(node.func, ast.Attribute) else name
            at = _CODE_ARGUMENT.get(name or "", len(node.args))
            values = [*node.args[at : at + 1], *(k.value for k in node.keywords if k.arg == "code")]
            found.update(text for value in values for text in _texts(value))
        elif isinstance(node, ast.Tuple) and _is_fault_row(node):
            found.update(text for text in _texts(node.elts[0]) if "-" in text)
    return {text for text in found if CODE.fullmatch(text)}


def _is_fault_row(row: ast.Tuple) -> bool:
    """Rows of a table of faults begin with the code and go on with a sentence."""
    if len(row.elts) < 4:
        return False
    return not any("-" in text and CODE.fullmatch(text) for text in _texts(row.elts[1]))


def _texts(node: ast.expr) -> list[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        return [node.value]
    if isinstance(node, ast.IfExp):
        return _texts(node.body) + _texts(node.orelse)
    if isinstance(node, ast.JoinedStr):
        parts = [p.value if isinstance(p, ast.Constant) else "*" for p in node.values]
        return ["".join(map(str, parts))]
    return []


def hazards_of(tree: ast.Module) -> set[str]:
    """Hazard ids that a module's values name; words in docstrings do not count."""
    strings = [n.value for n in ast.walk(tree) if isinstance(n, ast.Constant)]
    return {text for text in strings if isinstance(text, str) and HAZARD.fullmatch(text)}


def table(rows: list[Row]) -> str:
    """The rows as a Markdown table, one line for each gate of a row."""
    head = "| id | fault | status | found by: code, limit | function | then | test |"
    lines = [head, "|" + "---|" * 7]
    for row in rows:
        status = row.status + (f": {row.missing}" if row.missing else "")
        first = [row.id, row.fault, status]
        if not row.gates:
            lines.append(_line([*first, "", "", row.behaviour, ""]))
        for gate in row.gates:
            codes = ", ".join(f"`{code}`" for code in gate.codes)
            how = f"{codes}: {gate.limit}" if codes else gate.limit
            tests = "<br>".join(f"`{test}`" for test in gate.tests)
            then = row.behaviour if first[0] else ""
            lines.append(_line([*first, how, f"`{gate.by}`", then, tests]))
            first = ["", "", ""]
    return "\n".join(lines)


def risks(rows: list[Row]) -> str:
    """What is left of each hazard, one line each."""
    lines = ["| id | what is left |", "|---|---|"]
    return "\n".join([*lines, *(_line([row.id, row.residual]) for row in rows if row.residual)])


def others(no_hazard: dict[str, str]) -> str:
    """The codes of faults that are no hazard."""
    by_reason: dict[str, list[str]] = {}
    for code, reason in no_hazard.items():
        by_reason.setdefault(reason, []).append(f"`{code}`")
    lines = ["| why no hazard | codes |", "|---|---|"]
    return "\n".join([*lines, *(_line([why, ", ".join(c)]) for why, c in by_reason.items())])


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def totals(rows: list[Row]) -> str:
    """How many rows and gates there are."""
    counts = {status: sum(row.status == status for row in rows) for status in STATUS}
    gates = sum(len(row.gates) for row in rows)
    words = ", ".join(f"{count} {status}" for status, count in counts.items())
    return f"{len(rows)} rows: {words}; {gates} gates, each with its removal."


def document(text: str, parts: dict[str, str]) -> str:
    """The document with each part between its marks."""
    for name, content in parts.items():
        marks = f"<!-- {name} -->", f"<!-- end {name} -->"
        before, rest = text.split(marks[0])
        after = rest.split(marks[1])[1]
        text = f"{before}{marks[0]}\n{content}\n{marks[1]}{after}"
    return text


def parts() -> dict[str, str]:
    """The generated parts of the document."""
    rows, no_hazard = load()
    gates = [row for row in rows if row.id.startswith("G")]
    hazards = [row for row in rows if row.id.startswith("H")]
    return {
        "totals": totals(rows),
        "gates": table(gates),
        "hazards": table(hazards),
        "residual": risks(hazards),
        "others": others(no_hazard),
    }


if __name__ == "__main__":
    path = TOP / DOCUMENT
    path.write_text(document(path.read_text("utf-8"), parts()), "utf-8")
    print(totals(load()[0]))
