"""The page that is served, and what the environment may not change."""

import asyncio
import os
from pathlib import Path

import pytest
from hexafix.web.page import add_page, index_text, policy
from hexafix.web.run import prepare_environment
from hexafix.web.server import SESSION_URL

PAGE = """<html><head><link rel="icon" href="logo.png" /><title>trame</title>
<script src="vue.global.js"></script></head><body><script>say("hello")</script></body></html>"""


@pytest.fixture
def a_page_folder(tmp_path):
    (tmp_path / "index.html").write_text(PAGE)
    return tmp_path


def test_the_page_bears_our_name_and_keeps_its_scripts(a_page_folder):
    text = index_text(a_page_folder)
    assert "<title>HexaFix</title>" in text
    assert "logo.png" not in text
    assert '<script src="vue.global.js"></script>' in text


def test_the_installed_trame_page_is_one_that_we_understand():
    from trame_client.module import vue3

    text = index_text(Path(vue3.www))
    assert "<title>HexaFix</title>" in text
    assert text.count("<script>") == policy(text).count("'sha256-") == 1


def test_the_policy_lets_in_the_pages_own_script_and_nothing_from_elsewhere(a_page_folder):
    rules = dict(rule.split(" ", 1) for rule in policy(index_text(a_page_folder)).split("; "))
    # printf 'say("hello")' | openssl dgst -sha256 -binary | base64
    assert "'sha256-fFI4F8UYyqmuIV8vsBmK2XfMdBB2uTYNiA+JyIpAnTw='" in rules["script-src"]
    assert "'unsafe-inline'" not in rules["script-src"]
    assert rules["default-src"] == rules["connect-src"] == "'self'"
    assert rules["frame-ancestors"] == rules["object-src"] == rules["form-action"] == "'none'"
    assert not any("http" in rule or "*" in rule for rule in rules.values())


@pytest.mark.parametrize(
    "asked", ["/", "/index.html", "/index.html?sessionURL=ws://evil.example/ws", "/?secret=x"]
)
def test_the_page_speaks_to_its_own_server_whatever_the_address_says(asked):
    from aiohttp import web
    from aiohttp.test_utils import TestClient, TestServer

    async def run():
        app = web.Application()
        add_page(app, PAGE)
        async with TestClient(TestServer(app)) as client:
            first = await client.get(asked, allow_redirects=False)
            assert first.status == 302
            assert first.headers["Location"] == f"/index.html?sessionURL={SESSION_URL}"
            second = await client.get(first.headers["Location"], allow_redirects=False)
            assert second.status == 200
            assert await second.text() == PAGE

    asyncio.run(run())


def test_the_environment_cannot_loosen_the_server(monkeypatch):
    for name in ("WSLINK_FOLLOW_SYMLINKS", "WSLINK_HTTP_HEADERS", "TRAME_DEFAULT_HOST"):
        monkeypatch.setenv(name, "1")
    monkeypatch.setenv("TRAME_ARGS", "--host 0.0.0.0")
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")
    prepare_environment()
    left = {name: v for name, v in os.environ.items() if name.startswith(("TRAME_", "WSLINK_"))}
    assert left == {"TRAME_ARGS": ""}
    assert os.environ["VTK_DEFAULT_OPENGL_WINDOW"] == "vtkEGLRenderWindow"
