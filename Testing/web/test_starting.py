"""What is served while the workstation starts, and how it hands over."""

import http.client
import json
import signal
import socket
import subprocess
import sys
import threading
from contextlib import closing
from io import BytesIO
from urllib.parse import urlsplit

import numpy as np
import pytest
from hexafix.web.ahead import PACKAGES, extension_files, hurry, link_libraries
from hexafix.web.app import BEFORE_VTK
from hexafix.web.page import index_text, waits
from hexafix.web.run import SIGNALS, interruptible, starting, trame_page
from hexafix.web.server import access
from hexafix.web.starting import FirstPicture, StartingServer
from PIL import Image

PLAIN = """<html><head><title>trame</title></head><body><div id="app"></div></body></html>"""


@pytest.fixture
def a_waiting_server():
    server = StartingServer(access(), *trame_page())
    yield server
    server.close()


def ask(server, path, *, cookie="", host=None):
    with closing(http.client.HTTPConnection("127.0.0.1", server.port, timeout=10)) as connection:
        headers = {"Cookie": cookie, "Host": host or f"127.0.0.1:{server.port}"}
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()


def welcome(server):
    """The cookie that is given for the token."""
    parts = urlsplit(server._access.url(server.port))
    status, headers, _ = ask(server, f"/?{parts.query}")
    assert status == 303
    return headers["Set-Cookie"].partition(";")[0]


@pytest.mark.parametrize("path", ["/index.html", "/starting.json", "/starting.png", "/logo.png"])
def test_nobody_sees_the_start_without_the_token(a_waiting_server, path):
    assert ask(a_waiting_server, path)[0] == 401
    cookie = welcome(a_waiting_server)
    assert ask(a_waiting_server, path, cookie=cookie, host="evil.example")[0] == 421


def test_the_waiting_page_is_whole(a_waiting_server):
    cookie = welcome(a_waiting_server)
    status, headers, body = ask(
        a_waiting_server, "/index.html?sessionURL=ws://use_host/ws", cookie=cookie
    )
    assert status == 200
    assert "sha256-" in headers["Content-Security-Policy"]
    assert b"not a medical device" in body
    client = body.partition(b'rel="modulepreload" crossorigin href=".')[2].partition(b'"')[0]
    assert ask(a_waiting_server, client.decode(), cookie=cookie)[0] == 200


def a_page_that_asks(server, cookie):
    """Thread that asks how far the start is, and what it has heard."""
    heard = []

    def wait():
        heard.append(json.loads(ask(server, "/starting.json", cookie=cookie)[2]))

    thread = threading.Thread(target=wait)
    thread.start()
    thread.join(0.3)
    return thread, heard


def test_the_page_hears_of_the_ct_as_soon_as_it_is_read(a_waiting_server, a_phantom):
    cookie = welcome(a_waiting_server)
    asking, heard = a_page_that_asks(a_waiting_server, cookie)
    assert not heard
    a_waiting_server.first.volume = lambda: a_phantom.volume
    asking.join(10)
    assert "S " in heard[0]["picture"]
    assert "ready" not in heard[0]
    png = ask(a_waiting_server, "/starting.png", cookie=cookie)[2]
    shown = np.asarray(Image.open(BytesIO(png)))
    assert shown.shape == (512, 512)
    assert len(np.unique(shown)) > 16


def test_a_page_that_waits_is_told_of_the_hand_over_and_the_port_is_free(a_waiting_server):
    cookie = welcome(a_waiting_server)
    asking, heard = a_page_that_asks(a_waiting_server, cookie)
    a_waiting_server.close()
    asking.join(10)
    assert heard[0]["wait_ms"] > 0
    with socket.socket() as other:
        other.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        other.bind(("127.0.0.1", a_waiting_server.port))


def test_a_port_that_is_taken_is_refused(a_waiting_server):
    with pytest.raises(OSError, match="in use"):
        StartingServer(access(port=a_waiting_server.port), *trame_page())


def test_the_ct_is_drawn_once(a_phantom, monkeypatch):
    first, drawn = FirstPicture(), []
    first.volume = lambda: a_phantom.volume
    make = FirstPicture._make
    monkeypatch.setattr(FirstPicture, "_make", lambda self, v: (drawn.append(v), make(self, v)))
    asking = [threading.Thread(target=first.state) for _ in range(4)]
    for thread in asking:
        thread.start()
    for thread in asking:
        thread.join()
    assert len(drawn) == 1


def test_a_picture_that_cannot_be_made_does_not_hold_up_the_start():
    first, asked = FirstPicture(), []
    first.volume = lambda: asked.append("once") or object()
    assert [first.state()["picture"] for _ in range(3)] == ["", "", ""]
    assert asked == ["once"]


def test_a_server_that_cannot_be_made_says_so(tmp_path):
    with pytest.raises(ValueError, match="does not exist"):
        StartingServer(access(), tmp_path / "nowhere", "")


def test_the_installed_trame_page_can_wait_and_a_strange_one_starts_as_it_is(tmp_path):
    folder, text = trame_page()
    assert waits(text)
    assert "loading.tpl" not in text
    (tmp_path / "index.html").write_text(PLAIN)
    strange = index_text(tmp_path)
    assert not waits(strange)
    with starting(access(), folder, strange) as server:
        assert server is None


def python(code):
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return json.loads(run.stdout.splitlines()[-1])


def test_what_is_imported_while_the_ct_is_read_needs_no_vtk():
    loaded = python(
        "import sys, json, importlib\n"
        "import hexafix.presenter\n"
        f"for name in {BEFORE_VTK!r}: importlib.import_module(name)\n"
        "print(json.dumps(sorted({m.partition('.')[0] for m in sys.modules})))"
    )
    assert "trame" in loaded
    assert not {"vtk", "vtkmodules", "slicer", "slicer_core", "scipy.linalg"} & set(loaded)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="linked ahead on Linux only")
def test_the_libraries_that_slicer_and_vtk_import_are_linked_before():
    found = python(
        "import sys, json\n"
        "from hexafix.web.ahead import link_libraries\n"
        "before = set(sys.modules)\n"
        "link_libraries()\n"
        "maps = {line.split()[-1] for line in open('/proc/self/maps') if '.so' in line}\n"
        "new = sorted(m for m in set(sys.modules) - before if m.startswith(('vtk', 'slicer')))\n"
        "import slicer, vtk\n"
        "files = {m.__file__ for n, m in list(sys.modules.items())\n"
        "         if n.startswith(('vtkmodules.', 'slicer')) and getattr(m, '__file__', None)}\n"
        "files = {f for f in files if f.endswith('.so')}\n"
        "print(json.dumps([len(files), len(files - maps), new]))"
    )
    imported, missed, modules = found
    assert imported > 100
    assert missed == 0
    assert modules == []


def test_where_nothing_is_installed_nothing_is_linked(monkeypatch):
    assert extension_files("no_such_package_of_ours") == []
    monkeypatch.setattr(sys, "platform", "win32")
    link_libraries()
    assert all(len(extension_files(package)) > 1 for package in PACKAGES)


def test_the_interpreter_is_as_it_was_once_the_start_is_over():
    import gc

    patience = sys.getswitchinterval()
    has_started = hurry()
    assert not gc.isenabled()
    assert sys.getswitchinterval() < patience
    has_started()
    assert gc.isenabled()
    assert sys.getswitchinterval() == pytest.approx(patience)
    gc.unfreeze()


def test_a_browser_sees_the_ct_first_and_then_the_views(start_serving, a_case_on_disk, a_page):
    process, url = start_serving(a_case_on_disk)
    a_page.goto(url)
    shown = "() => document.querySelector('#hexafix-starting-image')?.naturalWidth === 512"
    a_page.wait_for_function(shown, timeout=60_000, polling=20)
    assert process.poll() is None
    assert a_page.locator("#hexafix-starting-place").inner_text().startswith("Axial slice")
    a_page.wait_for_selector('[data-testid="step-load"]', timeout=60_000)
    assert a_page.locator("#hexafix-starting").count() == 0
    assert a_page.said == []


@pytest.mark.parametrize("name", SIGNALS)
def test_a_signal_ends_a_start_and_leaves_the_handlers_as_they_were(name):
    before = signal.getsignal(name)
    with pytest.raises(KeyboardInterrupt), interruptible():
        signal.raise_signal(name)
    assert signal.getsignal(name) is before


def test_an_interrupted_start_ends_quietly(start_serving):
    process, _ = start_serving()
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 0
    assert said == "hexafix: the workstation has ended\n"
