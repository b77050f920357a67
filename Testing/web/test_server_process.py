"""`hexafix serve` as a process of its own: the page in a real Chromium, the end of it."""

import http.client
import os
import re
import signal
import socket
import ssl
import subprocess
import sys
from pathlib import Path
from urllib.parse import urlsplit

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "HexaFixModule"

GREYS = Path(__file__).with_name("shades.js").read_text("utf-8").partition("\n")[2].strip()
"""How many of 16 shades of red each picture of the page has."""


@pytest.fixture(scope="module")
def a_server(start_serving, a_case_on_disk):
    """Process and address of a workstation with the phantom's case."""
    return start_serving(a_case_on_disk)


def ask(url, path, **headers):
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    answer.read()
    connection.close()
    return answer


def of_session(number):
    """Processes of a session that still run."""
    running = []
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                fields = (entry / "stat").read_text().rpartition(")")[2].split()
            except OSError:
                continue
            if int(fields[3]) == number and fields[0] != "Z":
                running.append(int(entry.name))
    return running


def test_the_page_shows_the_ct_in_all_views_and_asks_nobody_else(a_server, a_page):
    _, url = a_server
    a_page.goto(url)
    shown = f"(g => g.length === 4 && g.filter(shades => shades > 6).length >= 3)(({GREYS})())"
    a_page.wait_for_function(shown, timeout=60000)
    for edge, letter in (("left", "R"), ("right", "L"), ("top", "A"), ("bottom", "P")):
        assert a_page.locator(f'[data-testid="Red-{edge}"]').inner_text() == letter
    place = a_page.locator('[data-testid="Red-position"]').inner_text()
    assert re.fullmatch(r"S -?[\d.]+ mm in the middle\s+tilted [\d.]+°", place), place
    assert {urlsplit(asked).hostname for asked in a_page.asked if "blob:" not in asked} == {
        "127.0.0.1"
    }
    assert a_page.said == []
    assert "token" not in a_page.url
    a_page.reload()
    a_page.wait_for_function(f"({GREYS})().filter(shades => shades > 6).length >= 3", timeout=60000)
    assert a_page.said == []


def test_every_page_is_told_of_the_others(a_server, a_page):
    _, url = a_server
    line = '[data-testid="open-pages"]'
    a_page.goto(url)
    a_page.wait_for_selector('[data-testid="banners"]', state="attached", timeout=60000)
    assert a_page.locator(line).count() == 0
    other = a_page.context.new_page()
    other.goto(url)
    for page in (a_page, other):
        page.wait_for_selector(f'{line}[data-count="2"]', timeout=60000)
        assert page.locator(line).inner_text().startswith("2 pages show this one case")
    other.close()
    a_page.wait_for_selector(line, state="detached", timeout=60000)


def test_scrolling_in_the_browser_moves_the_slice(a_server, a_page):
    _, url = a_server
    a_page.goto(url)
    a_page.wait_for_function(f"({GREYS})().filter(shades => shades > 6).length >= 3", timeout=60000)
    place = a_page.locator('[data-testid="Red-position"]')
    before = place.inner_text()
    box = a_page.locator('[data-testid="over-Red"]').bounding_box()
    a_page.mouse.move(box["x"] + 150, box["y"] + 150)
    a_page.mouse.wheel(0, -120)
    a_page.wait_for_function(
        "was => document.querySelector('[data-testid=\"Red-position\"]').innerText !== was",
        arg=before,
        timeout=20000,
    )


def test_the_process_listens_on_loopback_alone_and_wants_its_token(a_server):
    _, url = a_server
    port = urlsplit(url).port
    listening = [
        line.split()[1].split(":")[0]
        for table in ("/proc/net/tcp", "/proc/net/tcp6")
        for line in Path(table).read_text().splitlines()[1:]
        if line.split()[3] == "0A" and int(line.split()[1].split(":")[1], 16) == port
    ]
    assert listening == ["0100007F"]
    for path in ("/", "/index.html", "/vue.global.js", "/ws", "/export/plan.json", "/paraview/"):
        assert ask(url, path).status == 401
    assert ask(url, "/", Host="evil.example").status == 421


def test_static_folders_are_not_listed(a_server):
    _, url = a_server
    answer = ask(url, urlsplit(url).path + "?" + urlsplit(url).query)
    cookie = answer.getheader("Set-Cookie").split(";")[0]
    for path in ("/assets/", "/assets", "/export/", "/__hexafix/"):
        assert ask(url, path, Cookie=cookie).status in (403, 404)


def test_an_address_that_is_taken_is_told_with_the_next_step():
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        run = subprocess.run(
            [sys.executable, "-m", "hexafix", "serve", "--no-browser", "--port", port],
            capture_output=True,
            text=True,
            timeout=120,
            env={**os.environ, "PYTHONPATH": str(PACKAGE)},
        )
    assert run.returncode == 2
    assert "Next step: leave --host and --port out" in run.stderr
    assert "Traceback" not in run.stderr


def test_ctrl_c_ends_the_server_and_everything_it_started(start_serving, a_case_on_disk):
    process, url = start_serving(a_case_on_disk)
    # At once: the CT is still being read.
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "Traceback" not in errors
    assert of_session(process.pid) == []
    with pytest.raises(ConnectionRefusedError):
        ask(url, "/")


def test_with_a_certificate_the_server_speaks_tls_alone(start_serving, a_certificate):
    certificate, key = a_certificate
    _, url = start_serving("--host", "localhost", "--certificate", certificate, "--key", key)
    parts = urlsplit(url)
    assert parts.scheme == "https"
    trusted = ssl.create_default_context(cafile=certificate)
    connection = http.client.HTTPSConnection("localhost", parts.port, timeout=10, context=trusted)
    connection.request("GET", f"/?{parts.query}")
    answer = connection.getresponse()
    answer.read()
    assert answer.status == 303
    assert "Secure" in answer.getheader("Set-Cookie")
    connection.close()
    with pytest.raises((http.client.HTTPException, OSError)):
        ask(f"http://localhost:{parts.port}", "/")


def test_a_case_that_is_not_there_is_an_input_error():
    run = subprocess.run(
        [sys.executable, "-m", "hexafix", "serve", "no-such-case.json"],
        capture_output=True,
        text=True,
        timeout=60,
        env={**os.environ, "PYTHONPATH": str(PACKAGE)},
    )
    assert run.returncode == 2
    assert "there is no such case file" in run.stderr
