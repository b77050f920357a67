"""Only this machine, only with the token, only from the workstation's own page."""

import asyncio
import http.client
import ssl
import threading

import pytest
from hexafix.errors import InputError
from hexafix.web.server import Access, Guard, access, add_downloads, is_loopback

TOKEN = "a-token-of-this-test"
FILES = {"schedule.csv": b"day,strut\n", "prescription.pdf": b"%PDF-1.7"}


@pytest.fixture
def a_guarded_server():
    """Port of a guarded application with a page, a WebSocket and downloads; its prescription."""
    from aiohttp import web

    held = {"files": FILES}
    ready, stop = threading.Event(), None
    places = {}

    async def socket(request):
        answer = web.WebSocketResponse()
        await answer.prepare(request)
        await answer.close()
        return answer

    async def page(_request):
        return web.Response(text="the page")

    async def run():
        nonlocal stop
        app = web.Application()
        Guard(Access(host="127.0.0.1", port=0, token=TOKEN), "default-src 'self'").install(app)
        add_downloads(app, lambda: held["files"])
        app.router.add_route("*", "/", page)
        app.router.add_get("/ws", socket)
        runner = web.AppRunner(app, handle_signals=False)
        await runner.setup()
        site = web.TCPSite(runner, "127.0.0.1", 0)
        await site.start()
        places["port"] = runner.addresses[0][1]
        places["loop"] = asyncio.get_running_loop()
        stop = asyncio.Event()
        ready.set()
        await stop.wait()
        await runner.cleanup()

    thread = threading.Thread(target=lambda: asyncio.run(run()))
    thread.start()
    assert ready.wait(10)
    yield places["port"], held
    places["loop"].call_soon_threadsafe(stop.set)
    thread.join(10)


def ask(port, path="/", *, method="GET", host=None, cookie=None, **headers):
    """One request; the answer with its body."""
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
    sent = {"Host": host or f"127.0.0.1:{port}", **headers}
    if cookie:
        sent["Cookie"] = cookie
    connection.putrequest(method, path, skip_host=True)
    for name, value in sent.items():
        connection.putheader(name.replace("_", "-"), value)
    connection.endheaders()
    answer = connection.getresponse()
    answer.body = answer.read() if answer.status != 101 else b""
    connection.close()
    return answer


def welcome(port):
    """The cookie that the token is changed for."""
    answer = ask(port, f"/?token={TOKEN}")
    assert answer.status == 303
    return answer.getheader("Set-Cookie")


def upgrade(port, **headers):
    """A WebSocket's handshake."""
    own = {"Upgrade": "websocket", "Connection": "Upgrade", "Sec_WebSocket_Version": "13"}
    own["Sec_WebSocket_Key"] = "dGhlIHNhbXBsZSBub25jZQ=="
    return ask(port, "/ws", **{**own, **headers})


def test_a_host_that_others_reach_is_refused_without_a_token():
    with pytest.raises(InputError) as caught:
        access(host="0.0.0.0")
    assert caught.value.faults[0].code == "host-without-token"
    assert "--token auto" in caught.value.faults[0].next_step
    assert access(host="0.0.0.0", token="auto").host == "0.0.0.0"


@pytest.mark.parametrize("host", ["127.0.0.1", "localhost", "::1", "127.8.9.1"])
def test_loopback_needs_no_token_of_the_user_and_gets_a_fresh_one(host):
    first, second = access(host=host), access(host=host)
    assert len(first.token) >= 43
    assert first.token != second.token
    assert first.session not in (second.session, first.token)


@pytest.mark.parametrize("host", ["0.0.0.0", "::", "192.168.1.7", "example.org", "127.0.0.1.evil"])
def test_only_addresses_of_this_machine_alone_are_loopback(host):
    assert not is_loopback(host)


def test_a_token_that_can_be_guessed_is_refused():
    with pytest.raises(InputError) as caught:
        access(token="1234")
    assert caught.value.faults[0].code == "token-too-short"
    assert "1234" not in str(caught.value)


def test_neither_token_nor_session_is_shown_by_accident():
    one = access(token=TOKEN)
    assert TOKEN not in repr(one)
    assert one.session not in repr(one)


def test_the_token_opens_the_page_once_and_leaves_the_address(a_guarded_server):
    port, _ = a_guarded_server
    answer = ask(port, f"/?token={TOKEN}")
    assert answer.status == 303
    assert answer.getheader("Location") == "/"
    cookie = answer.getheader("Set-Cookie")
    assert "HttpOnly" in cookie
    assert "SameSite=Strict" in cookie
    assert TOKEN not in cookie
    assert ask(port, "/", cookie=cookie.split(";")[0]).body == b"the page"


@pytest.mark.parametrize(
    "path", ["/", "/?token=another-token-of-16", "/export/schedule.csv", "/ws"]
)
def test_nothing_is_given_without_the_token(a_guarded_server, path):
    port, _ = a_guarded_server
    answer = ask(port, path)
    assert answer.status == 401
    assert answer.getheader("Set-Cookie") is None
    assert b"the page" not in answer.body
    assert b"day" not in answer.body


def test_a_made_up_cookie_opens_nothing(a_guarded_server):
    port, _ = a_guarded_server
    name = welcome(port).split("=")[0]
    assert ask(port, "/", cookie=f"{name}={TOKEN}").status == 401
    assert ask(port, "/", cookie=f"{name}=").status == 401


@pytest.mark.parametrize("host", ["evil.example", "evil.example:80", "127.0.0.1.evil.example", ""])
def test_a_name_rebound_to_this_machine_gets_nothing(a_guarded_server, host):
    port, _ = a_guarded_server
    cookie = welcome(port).split(";")[0]
    answer = ask(port, f"/?token={TOKEN}", host=host or " ", cookie=cookie)
    assert answer.status in (400, 421)
    assert answer.getheader("Set-Cookie") is None


def test_the_machines_own_names_are_answered(a_guarded_server):
    port, _ = a_guarded_server
    cookie = welcome(port).split(";")[0]
    for host in (f"localhost:{port}", f"127.0.0.1:{port}", "localhost:9000"):
        assert ask(port, "/", host=host, cookie=cookie).status == 200


def test_a_websocket_needs_the_token_and_its_own_page(a_guarded_server):
    port, _ = a_guarded_server
    cookie = welcome(port).split(";")[0]
    own = f"http://127.0.0.1:{port}"
    assert upgrade(port, Cookie=cookie, Origin=own).status == 101
    assert upgrade(port, Origin=own).status == 401
    assert upgrade(port, Cookie=cookie, Origin="http://evil.example").status == 403
    assert upgrade(port, Cookie=cookie, Origin="null").status == 403
    assert upgrade(port, Cookie=cookie, Origin="http://127.0.0.1:1").status == 403
    assert upgrade(port, Cookie=cookie).status == 403


def test_another_page_cannot_fetch_a_download(a_guarded_server):
    port, _ = a_guarded_server
    cookie = welcome(port).split(";")[0]
    answer = ask(port, "/export/schedule.csv", cookie=cookie, Origin="http://evil.example")
    assert answer.status == 403
    assert answer.getheader("Access-Control-Allow-Origin") is None


def test_the_prescription_is_given_byte_for_byte_and_only_while_it_is_fresh(a_guarded_server):
    port, held = a_guarded_server
    cookie = welcome(port).split(";")[0]
    for name, content in FILES.items():
        answer = ask(port, f"/export/{name}", cookie=cookie)
        assert answer.body == content
        assert answer.getheader("Content-Disposition") == f'attachment; filename="{name}"'
    assert ask(port, "/export/case.json", cookie=cookie).status == 404
    assert ask(port, "/export/..%2Fschedule.csv", cookie=cookie).status == 404
    assert ask(port, "/export/", cookie=cookie).status == 404
    held["files"] = None
    assert ask(port, "/export/schedule.csv", cookie=cookie).status == 404


@pytest.mark.parametrize("method", ["POST", "PUT", "DELETE", "OPTIONS"])
def test_the_server_only_answers_questions(a_guarded_server, method):
    port, _ = a_guarded_server
    cookie = welcome(port).split(";")[0]
    assert ask(port, "/", method=method, cookie=cookie).status == 405


def test_every_answer_keeps_the_browser_on_this_machine(a_guarded_server):
    port, _ = a_guarded_server
    cookie = welcome(port).split(";")[0]
    for answer in (
        ask(port, "/", cookie=cookie),
        ask(port, "/"),
        ask(port, "/none", cookie=cookie),
    ):
        assert answer.getheader("Content-Security-Policy") == "default-src 'self'"
        assert answer.getheader("X-Content-Type-Options") == "nosniff"
        assert answer.getheader("X-Frame-Options") == "DENY"
        assert answer.getheader("Cache-Control") == "no-store"
        assert answer.getheader("Access-Control-Allow-Origin") is None
        assert answer.getheader("Server") is None


def test_with_a_certificate_the_address_and_the_cookie_are_for_tls_alone(a_certificate):
    certificate, key = a_certificate
    one = access(host="0.0.0.0", token="auto", certificate=certificate, key=key)
    assert one.url(8443).startswith("https://127.0.0.1:8443/?token=")
    assert one.tls.minimum_version == ssl.TLSVersion.TLSv1_2
    assert access().url(8443).startswith("http://")


def test_a_certificate_without_its_key_is_refused(a_certificate, tmp_path):
    certificate, key = a_certificate
    other = tmp_path / "other.pem"
    other.write_text("no key")
    for pair in ((certificate, None), (None, key), (certificate, other), (tmp_path / "x", key)):
        with pytest.raises(InputError) as caught:
            access(certificate=pair[0], key=pair[1])
        assert caught.value.faults[0].code == "certificate-unusable"
