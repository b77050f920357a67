"""The page itself: trame's index with our start, and the policy that keeps it on this machine."""

from __future__ import annotations

import base64
import hashlib
import re
from pathlib import Path
from typing import TYPE_CHECKING

from hexafix.web.server import SESSION_URL

if TYPE_CHECKING:
    from aiohttp import web

PAGE_NAMES = ("/", "/index.html")

STATIC = Path(__file__).with_name("static")

CLIENT = re.compile(r'<script type="module"[^>]*\bsrc="([^"]+)"[^>]*></script>')
"""Where trame's page loads its client."""

LOADER = re.compile(r"<script>[^<]*loading\.tpl.*?</script>", re.DOTALL)
"""What trame's page does meanwhile."""


def index_text(folder: Path) -> str:
    """Trame's page with our title, which waits for the workstation; scripts' names are trame's own.

    Parameters
    ----------
    folder : Path
        Trame's own static folder.
    """
    text = (folder / "index.html").read_text("utf-8")
    text = re.sub(r"<title>.*?</title>", "<title>HexaFix</title>", text)
    text = re.sub(r'<link rel="icon"[^>]*>', '<link rel="icon" href="data:," />', text)
    if CLIENT.search(text) is None or LOADER.search(text) is None:
        return text
    own = {name: (STATIC / f"starting.{name}").read_text("utf-8") for name in ("html", "js")}
    text = CLIENT.sub(r'<link rel="modulepreload" crossorigin href="\1">', text)
    text = LOADER.sub(lambda _: f"<script>\n{own['js']}</script>", text)
    return text.replace('<div id="app"></div>', f'<div id="app">\n{own["html"]}</div>')


def waits(text: str) -> bool:
    """Whether the page asks when the workstation is there, and so may be served before it."""
    return "modulepreload" in text


def policy(text: str) -> str:
    """Content-Security-Policy for a page: nothing from elsewhere, no inline script but its own.

    Vue compiles trame's templates in the page, hence ``unsafe-eval``; Vuetify writes its theme
    into style elements, hence inline styles.
    """
    inline = re.findall(r"<script>(.*?)</script>", text, flags=re.DOTALL)
    digests = (hashlib.sha256(script.encode()).digest() for script in inline)
    own = " ".join(f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests)
    return "; ".join(
        [
            "default-src 'self'",
            f"script-src 'self' 'unsafe-eval' {own}".rstrip(),
            "style-src 'self' 'unsafe-inline'",
            "img-src 'self' data: blob:",
            "font-src 'self' data:",
            "connect-src 'self'",
            "object-src 'none'",
            "frame-ancestors 'none'",
            "base-uri 'self'",
            "form-action 'none'",
        ]
    )


def add_page(app: web.Application, text: str) -> None:
    """Serve the page; a page without the WebSocket's address would ask for a launcher first."""
    from aiohttp import web

    async def page(request: web.Request) -> web.Response:
        if dict(request.query) != {"sessionURL": SESSION_URL}:
            raise web.HTTPFound(f"/index.html?sessionURL={SESSION_URL}")
        return web.Response(text=text, content_type="text/html")

    for name in PAGE_NAMES:
        app.router.add_get(name, page)
