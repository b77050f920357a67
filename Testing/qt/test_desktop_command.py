"""`hexafix desktop` says in words what is missing."""

import os
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule"


def desktop(code="", **changed):
    kept = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    kept.pop("QT_QPA_PLATFORM", None)
    start = f"import sys\n{code}\nfrom hexafix.cli import main\nmain(['desktop'])"
    return subprocess.run(
        [sys.executable, "-c", start],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**kept, "PYTHONPATH": str(PACKAGE), **changed},
    )


def test_without_a_display_it_says_so():
    run = desktop()
    assert run.returncode == 2
    assert "needs a display" in run.stderr
    assert "Traceback" not in run.stderr


def test_a_display_that_does_not_answer_does_not_end_the_process_in_an_abort():
    run = desktop(DISPLAY=":99999")
    assert run.returncode == 2
    assert "needs a display" in run.stderr


def test_without_qt_it_names_the_extra_to_install():
    run = desktop("sys.modules['qtpy'] = None")
    assert run.returncode == 2
    assert "hexafix[qt]" in run.stderr
