"""A display of these tests' own, and the workstation's window with the phantom's case on it."""

import os
import shutil
import subprocess
import time
from contextlib import contextmanager

import pytest

SCREEN = "1440x900x24"


@pytest.fixture(scope="session")
def a_display():
    """An X server without a screen; other tests do not see it."""
    server = shutil.which("Xvfb")
    assert server, "Xvfb is needed: install the system packages that .ci/run names"
    read, write = os.pipe()
    process = subprocess.Popen(
        [server, "-displayfd", str(write), "-screen", "0", SCREEN, "-nolisten", "tcp"],
        pass_fds=[write],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    os.close(write)
    with os.fdopen(read) as numbers:
        display = f":{numbers.readline().strip()}"
    changed = {"DISPLAY": display, "QT_QPA_PLATFORM": "xcb", "LIBGL_ALWAYS_SOFTWARE": "1"}
    before = {name: os.environ.get(name) for name in (*changed, "VTK_DEFAULT_OPENGL_WINDOW")}
    os.environ.update(changed)
    yield display
    for name, value in before.items():
        os.environ.pop(name, None)
        if value is not None:
            os.environ[name] = value
    # Qt ends the whole process if its display goes first.
    from qtpy.QtWidgets import QApplication

    if QApplication.instance() is not None:
        QApplication.instance().shutdown()
    process.terminate()
    process.wait(10)


@pytest.fixture(scope="session")
def qapp_args(a_display):
    return ["hexafix"]


@pytest.fixture
def an_own_case(a_case_on_disk, tmp_path):
    """A case file that a test may overwrite; its CT is the shared one."""
    import json

    document = json.loads(a_case_on_disk.read_text())
    document["image"]["path"] = str(a_case_on_disk.parent / document["image"]["path"])
    path = tmp_path / "case.json"
    path.write_text(json.dumps(document))
    return path


@contextmanager
def opened(qapp, folder):
    from hexafix.qt import Window
    from hexafix.qt.kit import kit

    q = kit()
    window = Window(settings=q.QSettings(str(folder / "settings.ini"), q.QSettings.IniFormat))
    window.show()
    yield window
    window.close()
    window.main.close()
    window.main.deleteLater()
    qapp.sendPostedEvents(None, q.QEvent.DeferredDelete)
    qapp.processEvents()


@pytest.fixture
def a_window(qapp, tmp_path):
    """A window without a case."""
    with opened(qapp, tmp_path) as window:
        yield window


@pytest.fixture(scope="module")
def a_planned_window(qapp, a_case_on_disk, tmp_path_factory):
    """A window with the phantom's case, run to the prescription; tests leave it as they got it."""
    with opened(qapp, tmp_path_factory.mktemp("planned")) as window:
        assert window.open_case(a_case_on_disk)
        window.root.findChild(type(window._find("runAllButton")), "runAllButton").click()
        settle(qapp, window)
        yield window


def settle(qapp, window, *, seconds=60.0):
    """Let the window work until nothing is under way and everything is drawn."""
    end = time.monotonic() + seconds
    quiet = 0
    while quiet < 3:
        qapp.processEvents()
        waiting = window.presenter.snapshot.busy or window.stage.working
        quiet = 0 if waiting else quiet + 1
        assert time.monotonic() < end, "the window is still at work"
        time.sleep(0.01)


@pytest.fixture
def settled(qapp):
    """`settled(window)`: wait until it has nothing to do."""
    return lambda window: settle(qapp, window)


@pytest.fixture
def pixels(qapp):
    """`pixels(widget) -> (H, W, 3)`: what a widget shows on the screen."""
    import numpy as np

    def grab(widget):
        qapp.processEvents()
        image = widget.grab().toImage()
        image = image.convertToFormat(image.Format.Format_RGB888)
        rows = np.frombuffer(image.constBits(), np.uint8).reshape(image.height(), -1)
        return rows[:, : 3 * image.width()].reshape(image.height(), image.width(), 3).copy()

    return grab
