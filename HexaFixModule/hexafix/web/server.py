"""The workstation's web server: who may ask, and what every answer carries.

Loopback only unless a host and a token are given. The token guards the page, its WebSocket and
the downloads; host and origin are checked against DNS rebinding and cross-site WebSockets.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import ssl
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote, urlsplit

from hexafix.errors import InputError

if TYPE_CHECKING:
    from aiohttp import web

LEAST_TOKEN_LENGTH = 16
"""Characters of a token that the user makes up; a made one has 43."""

SESSION_URL = "ws://use_host/ws"
"""The trame client's name for a WebSocket of the page's own host."""


@dataclass(frozen=True)
class Access:
    """Where the server listens and who may ask.

    Attributes
    ----------
    host : str
        Name or address to bind.
    port : int
        Port to bind; 0 lets the system choose.
    token : str
        What the first request must carry.
    tls : ssl.SSLContext or None
        Encrypts what others on the way could read.
    session : str
        Value of the cookie given for the token; never the token itself.
    """

    host: str
    port: int
    token: str = field(repr=False)
    tls: ssl.SSLContext | None = field(default=None, repr=False)
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)

    def url(self, port: int) -> str:
        """The address to open, with the token."""
        shown = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        name = f"[{shown}]" if ":" in shown else shown
        scheme = "https" if self.tls else "http"
        return f"{scheme}://{name}:{port}/?token={quote(self.token, safe='')}"


def access(
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    token: str | None = None,
    certificate: Path | None = None,
    key: Path | None = None,
) -> Access:
    """Check where to listen; a host that others can reach needs a token said on purpose.

    Parameters
    ----------
    host, port, token
        As in `Access`; token None or ``auto``: a new one.
    certificate, key : Path or None
        PEM files for an encrypted connection; both or none.

    Raises
    ------
    InputError
        If others could come in, or certificate and key do not go together.
    """
    if not is_loopback(host) and token is None:
        raise InputError.of(
            "host-without-token",
            "others could reach this host, and no token was given",
            limit="127.0.0.1 without a token",
            where="--host",
            next_step="leave --host out and reach the machine by an SSH tunnel, or add "
            "--token auto",
        )
    if token in (None, "auto"):
        token = secrets.token_urlsafe(32)
    if len(token) < LEAST_TOKEN_LENGTH:
        raise InputError.of(
            "token-too-short",
            "the token can be guessed",
            value=f"{len(token)} characters",
            limit=f"at least {LEAST_TOKEN_LENGTH}",
            where="--token",
            next_step="use --token auto",
        )
    return Access(host=host, port=port, token=token, tls=encryption(certificate, key))


def encryption(certificate: Path | None, key: Path | None) -> ssl.SSLContext | None:
    """TLS 1.2 or newer by a certificate and its key; None without both."""
    if certificate is None and key is None:
        return None
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        context.load_cert_chain(str(certificate or ""), str(key or ""))
    except (OSError, ValueError) as error:
        raise InputError.of(
            "certificate-unusable",
            "certificate and key cannot be used together",
            where="--certificate",
            next_step="give --certificate and --key, both as PEM files, the key without a password",
        ) from error
    return context


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches `host`."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


Handler = Callable[["web.Request"], Awaitable["web.StreamResponse"]]


class Guard:
    """What stands before every request.

    Parameters
    ----------
    access : Access
        Who may ask.
    policy : str
        Content-Security-Policy of every answer.
    """

    def __init__(self, access: Access, policy: str) -> None:
        self._access = access
        self._headers = {
            "Content-Security-Policy": policy,
            "X-Content-Type-Options": "nosniff",
            "X-Frame-Options": "DENY",
            "Referrer-Policy": "no-referrer",
            "Cross-Origin-Opener-Policy": "same-origin",
            "Cross-Origin-Resource-Policy": "same-origin",
        }

    def install(self, app: web.Application) -> None:
        """Put the guard before all routes of `app`."""
        from aiohttp import web

        @web.middleware
        async def guarded(request: web.Request, handler: Handler) -> web.StreamResponse:
            return await self._pass(request, handler)

        app.middlewares.insert(0, guarded)
        app.on_response_prepare.append(self._add_headers)

    async def _pass(self, request: web.Request, handler: Handler) -> web.StreamResponse:
        from aiohttp import web

        if not self._own_host(request):
            return web.Response(status=421, text="this server does not answer to that name")
        if not self._own_origin(request):
            return web.Response(status=403, text="requests of other pages are refused")
        if request.method not in ("GET", "HEAD"):
            return web.Response(status=405, text="read only", headers={"Allow": "GET, HEAD"})
        if request.path == "/" and "token" in request.query:
            return self._welcome(request)
        if not same(request.cookies.get(cookie_name(request), ""), self._access.session):
            return web.Response(
                status=401, text="open the address that hexafix serve printed, with its token"
            )
        return await handler(request)

    def _welcome(self, request: web.Request) -> web.Response:
        """Change the token for a cookie, so that the address bar does not keep the token."""
        from aiohttp import web

        if not same(request.query["token"], self._access.token):
            return web.Response(status=401, text="the token is not the one of this server")
        answer = web.Response(status=303, headers={"Location": "/"})
        answer.set_cookie(
            cookie_name(request),
            self._access.session,
            httponly=True,
            secure=self._access.tls is not None,
            samesite="Strict",
            path="/",
        )
        return answer

    def _own_host(self, request: web.Request) -> bool:
        """Whether the request names this machine: a rebound name is a stranger's."""
        name = urlsplit(f"//{request.host}").hostname or ""
        bound = local_address(request)
        names = {self._access.host, bound}
        if is_loopback(bound):
            names |= {"localhost", "127.0.0.1", "::1"}
        return name in names - {"0.0.0.0", "::"}

    def _own_origin(self, request: web.Request) -> bool:
        """Whether the page that asks is ours; a WebSocket must name its page."""
        origin = request.headers.get("Origin")
        if origin is None:
            return request.headers.get("Upgrade", "").lower() != "websocket"
        return urlsplit(origin).netloc == request.host

    async def _add_headers(self, request: web.Request, response: web.StreamResponse) -> None:
        response.headers.update(self._headers)
        response.headers.pop("Server", None)
        if not request.path.startswith(("/assets/", "/__")):
            response.headers["Cache-Control"] = "no-store"


def same(given: str, expected: str) -> bool:
    """Compare in constant time."""
    return hmac.compare_digest(given.encode(), expected.encode())


def local_address(request: web.Request) -> str:
    """The address of ours that the request came to."""
    name = request.transport.get_extra_info("sockname") if request.transport else None
    return str(name[0]) if name else ""


def cookie_name(request: web.Request) -> str:
    """A cookie of one port's own: browsers share cookies between ports."""
    name = request.transport.get_extra_info("sockname") if request.transport else None
    return f"hexafix-{name[1]}" if name else "hexafix"


def add_downloads(app: web.Application, files: Callable[[], Mapping[str, bytes] | None]) -> None:
    """Serve the files of the fresh prescription from memory, each as ``/export/NAME``."""
    from aiohttp import web

    async def download(request: web.Request) -> web.Response:
        held: Mapping[str, Any] = files() or {}
        name = request.match_info["name"]
        if name not in held:
            raise web.HTTPNotFound(text="there is no such file in the prescription as it stands")
        return web.Response(
            body=held[name],
            content_type="application/octet-stream",
            headers={"Content-Disposition": f'attachment; filename="{name}"'},
        )

    app.router.add_get("/export/{name}", download)
