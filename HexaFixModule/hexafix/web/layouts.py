"""The layouts of the views and what lies over each view: name, position, patient letters, slider.

The views keep Slicer's own tags (Red, Green, Yellow), so that a saved scene opens there too.
"""

from __future__ import annotations

from typing import Any

FOUR = "four"
"""Layout of all four views."""

NAMES = {
    FOUR: "Four views",
    "axial": "Axial",
    "coronal": "Coronal",
    "sagittal": "Sagittal",
    "space": "3D",
    "axial-space": "Axial and 3D",
}
"""Layout and its name in the menu."""

VIEW_NAMES = {"Red": "Axial", "Green": "Coronal", "Yellow": "Sagittal", "ThreeD": "3D"}
"""Tag of a view and its name for people."""

EDGES = ("left", "right", "top", "bottom")

STYLE = """
html { overflow: hidden; }
.hxv-views-bar { display: flex; align-items: center; gap: 8px; padding: 6px 8px;
  flex-wrap: wrap; }
.hxv-views-bar .v-field__input, .hxv-views-bar .v-text-field__suffix,
.hxv-views-bar .v-text-field__prefix, .hxv-views-bar .v-select__selection { font-size: 14px; }
.hxv-hint { position: absolute; z-index: 2; top: 30px; left: 50%; transform: translateX(-50%);
  padding: 2px 10px; border-radius: 4px; background: rgba(0, 0, 0, 0.75); color: #ffe082;
  font-weight: 600; pointer-events: none; white-space: nowrap; }
.hxv-aim, .hxv-aim * { cursor: crosshair !important; }
.hxv-over { position: absolute; pointer-events: none; color: #ffffff; user-select: none;
  text-shadow: 0 0 3px #000, 0 0 3px #000; font-size: 14px; line-height: 1.25; }
.hxv-whole { position: absolute; inset: 0; pointer-events: none; }
.hxv-name { top: 6px; left: 10px; font-weight: 600; }
.hxv-position { top: 24px; left: 10px; white-space: pre-line; font-variant-numeric: tabular-nums; }
.hxv-edge { font-size: 18px; font-weight: 700; color: #ffe082; }
.hxv-left { left: 8px; top: 50%; transform: translateY(-50%); }
.hxv-right { right: 8px; top: 50%; transform: translateY(-50%); }
.hxv-top { top: 4px; left: 50%; transform: translateX(-50%); }
.hxv-bottom { bottom: 34px; left: 50%; transform: translateX(-50%); }
.hxv-slider { position: absolute; bottom: 0; left: 8px; right: 8px; }
.hxv-reset { position: absolute; top: 2px; right: 2px; }
.hxv-note { position: absolute; top: 50%; left: 50%; transform: translate(-50%, -50%);
  padding: 6px 14px; border-radius: 4px; background: #000; color: #e0e0e0; pointer-events: none;
  font-size: 16px; }
"""
"""Style of what lies over the views; white on a dark rim is legible on bone and on air."""


def grid() -> dict[str, Any]:
    """The layouts by id."""
    from trame_slicer.views import Layout, LayoutDirection, ViewLayoutDefinition

    axial = ViewLayoutDefinition.axial_view()
    coronal = ViewLayoutDefinition.coronal_view()
    sagittal = ViewLayoutDefinition.sagittal_view()
    space = ViewLayoutDefinition.threed_view(background_color=("#20252b", "#3a424b"))
    across, down = LayoutDirection.Horizontal, LayoutDirection.Vertical
    return {
        FOUR: Layout(down, [Layout(across, [axial, space]), Layout(across, [coronal, sagittal])]),
        "axial": Layout(down, [axial]),
        "coronal": Layout(down, [coronal]),
        "sagittal": Layout(down, [sagittal]),
        "space": Layout(down, [space]),
        "axial-space": Layout(across, [axial, space]),
    }


def state_name(view_id: str, what: str) -> str:
    """Name of a view's own state, e.g. ``Red_position``."""
    return f"{view_id}_{what}"


def over_slice(server: Any, view_id: str, view: Any) -> None:
    """What lies over a slice view; it follows the slice."""
    from trame.widgets import html
    from trame_slicer.app.logic.slice_view_logic import connect_slice_view_slider_to_state
    from trame_slicer.app.ui.slider import Slider

    for what in ("position", *EDGES):
        server.state.setdefault(state_name(view_id, what), "")
    name_over(view)
    html.Div(
        f"{{{{ {state_name(view_id, 'position')} }}}}",
        v_if="views_loaded",
        classes="hxv-over hxv-position",
        raw_attrs=[f'data-testid="{view_id}-position"'],
    )
    for edge in EDGES:
        html.Div(
            f"{{{{ {state_name(view_id, edge)} }}}}",
            v_if="views_loaded",
            classes=f"hxv-over hxv-edge hxv-{edge}",
            raw_attrs=[f'data-testid="{view_id}-{edge}"'],
        )
    reset_button(view)
    with html.Div(classes="hxv-slider"):
        Slider(typed_state=connect_slice_view_slider_to_state(server, view), density="compact")
    follow_slice(server, view_id, view)


def follow_slice(server: Any, view_id: str, view: Any) -> None:
    """Keep position and letters of a slice view true."""
    from hexafix.mrml.screen import edge_letters, slice_position

    def show(*_: Any) -> None:
        node = view.get_view_node()
        with server.state as state:
            state[state_name(view_id, "position")] = slice_position(node)
            for edge, letters in edge_letters(node).items():
                state[state_name(view_id, edge)] = letters

    view.modified.connect(show)
    show()


def over_space(server: Any, view_id: str, view: Any) -> None:
    """What lies over the 3D view."""
    name_over(view)
    reset_button(view)


def name_over(view: Any) -> None:
    """The view's name; tests find the whole view by it."""
    from trame.widgets import html

    tag = view.get_singleton_tag()
    html.Div(classes="hxv-whole", raw_attrs=[f'data-testid="over-{tag}"'])
    html.Div(VIEW_NAMES[tag], classes="hxv-over hxv-name")


def reset_button(view: Any) -> None:
    """The button that shows the whole picture again."""
    from trame.widgets import html
    from trame.widgets import vuetify3 as v3

    with html.Div(classes="hxv-reset"):
        v3.VBtn(
            icon="mdi-fit-to-screen-outline",
            title="Show all",
            size="small",
            variant="text",
            color="white",
            click=view.reset_view,
        )
