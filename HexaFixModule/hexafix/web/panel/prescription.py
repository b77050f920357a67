"""The prescription as it will be printed, page by page."""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.widgets import icon_button, marked, picture

PDF = "prescription.pdf"


@dataclass
class PrescriptionState:
    """The page that is shown.

    Attributes
    ----------
    page : int
        From 1; 0 while there is none.
    image : str
        The page as a data address.
    """

    page: int = 0
    pages: int = 0
    image: str = ""
    large: bool = False


class PrescriptionPages:
    """Pages of the fresh prescription, drawn once and sent one at a time."""

    def __init__(self, context: PanelContext) -> None:
        self._data, self._name = typed_state(context.server, PrescriptionState)
        self._held = ""
        self._images: list[bytes] = []

    def build(self) -> None:
        """Make the page with its buttons."""
        from trame.widgets import html

        name = self._name
        with html.Div(v_if=name.image, **marked("prescription")):
            self._buttons("")
            with html.Button(
                type="button",
                classes="hxp-page",
                click=f"{name.large} = true",
                **marked("enlarge-page", label="Show the page large"),
            ):
                picture(name.image, "Page of the prescription", "page-image")

    def build_dialog(self) -> None:
        """Make the large view of a page."""
        from trame.widgets import vuetify3 as v

        name = self._name
        with (
            v.VDialog(v_model=(name.large,), max_width=940, scrollable=True),
            v.VCard(**marked("page-dialog", label="Page of the prescription")),
        ):
            with v.VCardActions(classes="py-0"):
                self._buttons("large-")
                v.VSpacer()
                icon_button("mdi-close", "Close", "close-page", f"{name.large} = false")
            with v.VCardText(classes="pa-2"):
                picture(name.image, "Page of the prescription, large", "page-image-large")

    def _buttons(self, prefix: str) -> None:
        from trame.widgets import html

        name = self._name
        with html.Div(classes="hxp-row"):
            icon_button(
                "mdi-chevron-left",
                "Page before",
                f"{prefix}page-before",
                (self._turn, "[-1]"),
                disabled=(f"{name.page} <= 1",),
            )
            html.Span(
                f"Page {{{{ {name.page} }}}} of {{{{ {name.pages} }}}}",
                **marked(f"{prefix}page-words", role="status"),
            )
            icon_button(
                "mdi-chevron-right",
                "Next page",
                f"{prefix}page-next",
                (self._turn, "[1]"),
                disabled=(f"{name.page} >= {name.pages}",),
            )

    def update(self, files: Mapping[str, bytes] | None) -> None:
        """Show the fresh prescription from its first page, or nothing if there is none."""
        pdf = (files or {}).get(PDF)
        digest = hashlib.sha256(pdf).hexdigest() if pdf else ""
        if digest == self._held:
            return
        self._held = digest
        self._images = []
        if pdf:
            from hexafix.pipeline import prescription_pages

            self._images = prescription_pages(pdf, dpi=110)
        self._data.pages = len(self._images)
        self._data.page = 0
        self._data.large = False
        self._turn(1)

    def _turn(self, by: int) -> None:
        page = self._data.page + by
        if 1 <= page <= len(self._images):
            self._data.page = page
            self._data.image = data_address(self._images[page - 1], "image/png")
        elif not self._images:
            self._data.image = ""


def data_address(content: bytes | str, kind: str) -> str:
    """Bytes or text as an address that a page can show without asking anybody."""
    raw: Any = content.encode() if isinstance(content, str) else content
    return f"data:{kind};base64,{base64.b64encode(raw).decode()}"
