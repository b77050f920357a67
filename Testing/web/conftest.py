"""A workstation on this machine and a real Chromium before it, both surely ended."""

import os
import shutil
import signal
import subprocess
import sys
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkOSOpenGLRenderWindow")

CHROMIUM = "/usr/bin/chromium"

CHROMIUM_FLAGS = [
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]

LONG_MS = 60_000
"""Patience with a machine that is busy with other work."""

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule"


@pytest.fixture(scope="session")
def start_serving():
    """Starts `hexafix serve` in its own process: `start_serving(*arguments) -> (process, url)`."""
    started = []

    def start(*arguments):
        process = subprocess.Popen(
            [sys.executable, "-m", "hexafix", "serve", *map(str, arguments), "--no-browser"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
            env={**os.environ, "PYTHONPATH": str(PACKAGE), "OPENBLAS_NUM_THREADS": "1"},
        )
        started.append(process)
        url = process.stdout.readline().strip()
        assert url.startswith(("http://", "https://")), process.stderr.read()
        return process, url

    yield start
    for process in started:
        end(process)


def end(process):
    """Interrupt a server, as Ctrl-C does; whatever is left after ten seconds is killed."""
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
    try:
        process.communicate(timeout=10)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


@pytest.fixture
def a_workstation_url(start_serving, a_case_on_disk):
    """Address, with its token, of a workstation that has the phantom's case open."""
    process, url = start_serving(a_case_on_disk)
    yield url
    end(process)


@pytest.fixture(scope="module")
def a_chromium():
    """One Chromium for a file's pages; while it runs, this thread has its event loop running."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=CHROMIUM_FLAGS)
        yield browser
        browser.close()


@pytest.fixture
def a_page(a_chromium, tmp_path):
    """A fresh page that keeps what it asked for (`asked`) and what it complained of (`said`)."""
    context = a_chromium.new_context(
        viewport={"width": 1600, "height": 1000}, accept_downloads=True
    )
    page = context.new_page()
    page.asked, page.said = [], []
    page.on("request", lambda request: page.asked.append(request.url))
    page.on("websocket", lambda socket: page.asked.append(socket.url))
    page.on("console", lambda m: page.said.append(m.text) if is_complaint(m) else None)
    page.on("pageerror", lambda error: page.said.append(str(error)))
    yield page
    context.close()


def is_complaint(message):
    """Whether the console tells of an error; at the hand-over a page may ask in vain."""
    asked = message.location["url"].removesuffix("?seen")
    return message.type == "error" and not asked.endswith("/starting.json")


class Desk:
    """A page with a workstation, spoken to by the names of its parts."""

    def __init__(self, page, case):
        self.page, self.case = page, case

    def at(self, name):
        return self.page.locator(f'[data-testid="{name}"]')

    def click(self, name):
        self.at(name).click()

    def open(self, step):
        if not self.at(f"body-{step}").is_visible():
            self.click(f"open-{step}")
        self.at(f"body-{step}").wait_for()

    def wait(self, step, state):
        """Wait until a step is in a state."""
        found = f'[data-testid="step-{step}"][data-state="{state}"]'
        self.page.wait_for_selector(found, timeout=LONG_MS)

    def wait_for(self, selector):
        self.page.wait_for_selector(selector, timeout=LONG_MS)

    def write(self, field, text):
        """Write into a field and leave it."""
        entry = self.at(field).locator("input")
        entry.fill(text)
        entry.press("Tab")

    def ball_of(self, number):
        return self.at(f"number-{number}").get_attribute("data-ball")


@contextmanager
def desk_of(start_serving, chromium, case=None):
    """A workstation of its own in a page of 1440 × 900."""
    process, url = start_serving(*([case] if case else []))
    context = chromium.new_context(viewport={"width": 1440, "height": 900}, accept_downloads=True)
    page = context.new_page()
    page.said, page.asked = [], []
    page.on("console", lambda m: page.said.append(m.text) if is_complaint(m) else None)
    page.on("pageerror", lambda error: page.said.append(str(error)))
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(url)
    yield Desk(page, case)
    context.close()
    process.send_signal(signal.SIGINT)
    process.communicate(timeout=20)


@pytest.fixture(scope="module")
def a_desk(start_serving, a_case_on_disk, a_chromium, tmp_path_factory):
    """With the phantom's case open."""
    folder = tmp_path_factory.mktemp("desk") / "phantom"
    shutil.copytree(a_case_on_disk.parent, folder)
    with desk_of(start_serving, a_chromium, folder / "case.json") as desk:
        desk.wait("load", "done")
        yield desk


@pytest.fixture
def a_new_desk(start_serving, a_chromium):
    """`a_new_desk(case=None)`: another server and page, ended with the test."""
    with ExitStack() as opened:
        yield lambda case=None: opened.enter_context(desk_of(start_serving, a_chromium, case))


@pytest.fixture(scope="module")
def a_planned_desk(a_desk):
    """The same, with the prescription made and the side of the limb given a second time."""
    a_desk.click("run-all")
    a_desk.wait("export", "done")
    a_desk.open("export")
    a_desk.click("confirm-left")
    a_desk.at("files").wait_for()
    return a_desk


@pytest.fixture(scope="session")
def a_certificate(tmp_path_factory):
    """Certificate and key for localhost, made here."""
    folder = tmp_path_factory.mktemp("tls")
    certificate, key = folder / "certificate.pem", folder / "key.pem"
    words = (
        "req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 -subj /CN=localhost"
    )
    names = ["-addext", "subjectAltName=DNS:localhost"]
    subprocess.run(
        ["openssl", *words.split(), *names, "-out", certificate, "-keyout", key],
        check=True,
        capture_output=True,
    )
    return certificate, key
