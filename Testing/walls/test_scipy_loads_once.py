"""SciPy's parts are imported when first used, and by one thread before others need them."""

import ast
from pathlib import Path

from hexafix.pipeline.look import SCIPY

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule" / "hexafix"

CHAIN = ("geometry", "imaging", "markers", "recognition", "kinematics", "accuracy", "correction")
"""The rooms whose steps a workstation computes on two threads."""


def parts_used(room):
    """Every part of SciPy that a room names, e.g. ``scipy.linalg.lapack.dgesv``."""
    for file in sorted((PACKAGE / room).glob("*.py")):
        for node in ast.walk(ast.parse(file.read_text("utf-8"))):
            if isinstance(node, ast.Attribute):
                text = ast.unparse(node)
                if text.startswith("scipy."):
                    yield text
            elif isinstance(node, ast.ImportFrom) and (node.module or "").startswith("scipy."):
                yield node.module


def test_all_that_the_chain_uses_of_scipy_is_loaded_before_the_first_ball_is_looked_for():
    used = {text for room in CHAIN for text in parts_used(room)}
    assert len(used) > 5
    roots = {".".join(text.split(".")[:2]) for text in used}
    assert roots == {".".join(name.split(".")[:2]) for name in SCIPY}
