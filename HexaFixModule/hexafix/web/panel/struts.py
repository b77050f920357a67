"""The six struts' colours, as the prescription prints them, always with their number."""

from __future__ import annotations

from typing import Any

from hexafix.web.panel.widgets import marked


def badge(index: str) -> Any:
    """A strut's number on its colour.

    Parameters
    ----------
    index : str
        Template expression that counts from 0.
    """
    from trame.widgets import html

    return html.Span(
        f"{{{{ {index} + 1 }}}}",
        classes=(f"'hxp-badge hxp-strut-' + ({index} + 1)",),
        **marked((f"'badge-' + ({index} + 1)",)),
    )
