"""How many pages show the case: all of them are one workstation, and each is told."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.widgets import marked


@dataclass
class PagesState:
    """How many pages are open."""

    count: int = 0


class OpenPages:
    """Counts the pages by their connections, and says so where there are several."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, PagesState)
        self._clients: set[Any] = set()
        context.server.add_protocol_to_configure(self._listen)

    def build(self) -> None:
        """Make the line above the messages."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        count = self._name.count
        with (
            html.Div(v_if=f"{count} > 1", classes="hxp-banners"),
            html.Div(
                classes="hxp-banner hxp-banner-warning",
                **marked("open-pages", role="status", data_count=(count,)),
            ),
        ):
            v.VIcon(icon="mdi-alert", size="small", color="warning")
            html.Div(
                f"{{{{ {count} }}}} pages show this one case: what is done in one of them is done "
                "in all. Close those that nobody needs.",
                classes="hxp-banner-text",
            )

    def _listen(self, protocol: Any) -> None:
        from wslink.websocket import LinkProtocol

        pages = self

        class Connections(LinkProtocol):
            """Hears of every WebSocket that comes and goes."""

            def onConnect(self, request: Any, client_id: Any) -> None:  # noqa: N802 - wslink's
                """Count a page that came."""
                pages.changed(pages._clients | {client_id})

            def onClose(self, client_id: Any) -> None:  # noqa: N802 - wslink's
                """Count one less."""
                pages.changed(pages._clients - {client_id})

        protocol.registerLinkProtocol(Connections())

    def changed(self, clients: set[Any]) -> None:
        """Tell how many pages there are now."""
        self._clients = clients
        with self._context.server.state:
            self._data.count = len(clients)
