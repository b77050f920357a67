"""Make the generated parts of the method page: pictures, equation map and table of departures.

``python Resources/Documents/make_method.py`` writes all of them beside this file; the names
``conventions``, ``equations``, ``departures`` pick some.
"""

from __future__ import annotations

import ast
import re
import sys
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).resolve().parent
PACKAGE = HERE.parents[1] / "HexaFixModule" / "hexafix"
sys.path.insert(0, str(PACKAGE.parent))

COMMAND = "python Resources/Documents/make_method.py"

EQUATIONS: dict[int, tuple[str, str]] = {
    1: ("position and orientation of a ring, X = (x y z α β γ)",
        "geometry.pose.Pose.from_xyz_fixed"),
    2: ("orientation matrix of the X-Y-Z fixed angles",
        "geometry.rotations.matrix_from_xyz_fixed"),
    3: ("angles of an orientation matrix", "geometry.rotations.angles_xyz_fixed_from_matrix"),
    4: ("mechanism pose, {A} in {B}", "recognition.mechanism.mechanism_pose"),
    5: ("place of a marker in its ring from t, φ, h", "hardware.layout.MarkerLayout.points_mm"),
    6: ("closed loop image, ring, marker", "recognition.least_squares.ring_pose"),
    7: ("orientation from the axes u, v, w", "recognition.groups.paper_group_pose"),
    8: ("differences of a group's markers", "recognition.groups.triads"),
    9: ("a group's z axis", "recognition.groups.triads"),
    10: ("direction to a marker in the ring", "recognition.groups.paper_group_pose"),
    11: ("unit difference of two markers", "recognition.groups.triads"),
    12: ("that difference turned by λ about z", "recognition.groups.paper_group_pose"),
    13: ("the turn, by Rodrigues", "recognition.groups.paper_group_pose"),
    14: ("the angle λ", "recognition.groups.paper_group_pose"),
    15: ("linear equations for the x axis", "recognition.groups.paper_group_pose"),
    16: ("their solution", "recognition.groups.paper_group_pose"),
    17: ("the case cos φ = 0", "recognition.groups.paper_group_pose"),
    18: ("a group's position", "recognition.groups.group_poses"),
    19: ("mean of the groups", "recognition.groups.mean_rotation"),
    20: ("the 6 N error parameters", "accuracy.jacobian.paper_jacobian"),
    21: ("linear error model, Jacobian J", "study.jacobians.model_jacobians"),
    22: ("blocks of J", "recognition.group_pose.corner_jacobians"),
    23: ("errors of a sample", "study.sampling.LinearKernel"),
    24: ("expected absolute error", "accuracy.jacobian.expected_errors"),
    25: ("installation errors in t, φ, h", "study.error_model.installation_maps"),
    26: ("printed errors for N = 3", "study.number.study_number"),
    27: ("included angles, their sum 360°", "hardware.layout.MarkerLayout.included_angles_rad"),
    28: ("volume errors", "accuracy.jacobian.volume_error"),
    29: ("closed loop of a strut", "kinematics.inverse.strut_lengths"),
    30: ("forward kinematics", "kinematics.forward.forward_kinematics"),
    31: ("recognition error", "correction.compensation.Compensation.pose_vector_difference"),
    32: ("compensated target", "correction.compensation.target_of"),
    33: ("strut lengths of the target", "kinematics.inverse.strut_lengths"),
}  # fmt: skip
"""Every numbered equation of the paper: what it says, and the function to read first."""


def sources() -> Iterator[tuple[str, tuple[int, ...]]]:
    """Every function, method and class whose docstring names equations, and their numbers."""
    for path in sorted(PACKAGE.rglob("*.py")):
        module = ".".join(path.relative_to(PACKAGE).with_suffix("").parts)
        yield from _of_body(ast.parse(path.read_text(encoding="utf-8")).body, module)


def _of_body(body: list[ast.stmt], prefix: str) -> Iterator[tuple[str, tuple[int, ...]]]:
    for node in body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            name = f"{prefix}.{node.name}"
            if named := equations_named(ast.get_docstring(node) or ""):
                yield name, named
            yield from _of_body(node.body, name)


def equations_named(docstring: str) -> tuple[int, ...]:
    """Numbers of the equations behind ``Source:``, as far as the sentence goes."""
    numbers: set[int] = set()
    for part in re.findall(r"Source:(.*?)(?:Departs:|\Z|\n\n)", docstring, flags=re.DOTALL):
        numbers |= _numbers(part)
    return tuple(sorted(numbers))


def _numbers(text: str) -> set[int]:
    numbers: set[int] = set()
    for listed in re.findall(r"Eq\.\s*\(\d+\)(?:\s*[-,]\s*\(\d+\))*", text):
        for first, last in re.findall(r"\((\d+)\)(?:\s*-\s*\((\d+)\))?", listed):
            numbers |= set(range(int(first), int(last or first) + 1))
    return numbers


def equations_page() -> str:
    """The map from equations to functions."""
    found = list(sources())
    lines = [
        "# From equation to function",
        "",
        f"Made by `{COMMAND} equations` from the docstrings: a function that names an equation",
        "behind `Source:` stands in its row. Read the first one first. Names are below `hexafix.`.",
        "",
        "| Eq. | says | read first | also |",
        "|---|---|---|---|",
    ]
    for number, (says, first) in EQUATIONS.items():
        also = ", ".join(f"`{n}`" for n, named in found if number in named and n != first)
        lines.append(f"| ({number}) | {says} | `{first}` | {also or '-'} |")
    return "\n".join([*lines, ""])


def departures_page() -> str:
    """The table of departures, measured now."""
    from hexafix.study.departures import CASES, MEASURES, SEED

    lines = [
        "# Departures from the paper, measured",
        "",
        f"Made by `{COMMAND} departures` (seed {SEED}, simulated; each error that a single case",
        "shows is free of noise). *Exact*: both methods of HexaFix give the pose to 10⁻⁹ mm and",
        f"rad. The rows of Eq. (31), (32) are means of {CASES} corrections each;",
        "`hexafix benchmark compensation` makes them of 2500.",
        "",
        "| place | as printed | what it costs | HexaFix | with it |",
        "|---|---|---|---|---|",
    ]
    for measure in MEASURES.values():
        for row in measure():
            cells = (row.place, row.printed, row.harm, row.instead, row.gain)
            lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def main(names: list[str]) -> None:
    """Write what is named, or everything."""
    wanted = names or ["conventions", "equations", "departures"]
    for name in wanted:
        if name == "conventions":
            from hexafix.study.conventions import conventions_picture, deformity_picture

            (HERE / "images" / "conventions.svg").write_text(conventions_picture(), "utf-8")
            (HERE / "images" / "deformity-words.svg").write_text(deformity_picture(), "utf-8")
        elif name == "equations":
            (HERE / "method-equations.md").write_text(equations_page(), "utf-8")
        elif name == "departures":
            (HERE / "method-departures.md").write_text(departures_page(), "utf-8")
        else:
            raise SystemExit(f"no such part: {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
