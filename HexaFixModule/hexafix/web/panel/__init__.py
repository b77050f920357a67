"""The side panel of the browser workstation: one file a step, ready words only.

``Panel(server, presenter, controls)`` with ``.toolbar()`` (inside a VAppBar), ``.drawer()`` (inside
a VNavigationDrawer of about 470 px), ``.playback()`` (inside a VFooter under the views),
``.dialogs()`` (anywhere in the layout) builds it; ``.update(snapshot)`` pushes a snapshot;
``.ball_clicked(index)`` takes a click in a view.
"""

from hexafix.web.panel.controls import NoViews, ViewControls
from hexafix.web.panel.panel import Panel

__all__ = ["NoViews", "Panel", "ViewControls"]
