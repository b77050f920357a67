"""The bar over the views: layout, window and level, what is shown."""

from __future__ import annotations

from typing import Any

from hexafix.web.layouts import NAMES
from hexafix.web.views import SHOWN, Views
from hexafix.web.window import PRESETS, SUGGESTED

SMALL = {"density": "compact", "hide_details": True, "variant": "outlined"}


def build_bar(views: Views, state: Any) -> None:
    """Make the bar at the place of the call.

    Parameters
    ----------
    views : Views
        What the bar acts on.
    state : trame_server.state.State
        Gets the names that begin with ``views_``.
    """
    from trame.widgets import html

    with html.Div(classes="hxv-views-bar", raw_attrs=['data-testid="views-bar"']):
        _layout_menu()
        _grey_values()
        _shown()
    _connect(views, state)


def _layout_menu() -> None:
    from trame.widgets import vuetify3 as v3

    v3.VSelect(
        v_model=("views_layout",),
        items=("views_layouts", [{"title": words, "value": name} for name, words in NAMES.items()]),
        label="Layout",
        style="max-width: 140px;",
        raw_attrs=['data-testid="views-layout"'],
        **SMALL,
    )


def _grey_values() -> None:
    from trame.widgets import vuetify3 as v3

    presets = [{"title": "Suggested", "value": SUGGESTED}]
    presets += [{"title": words, "value": name} for name, (words, *_) in PRESETS.items()]
    presets += [{"title": "Own", "value": "own", "props": {"disabled": True}}]
    v3.VSelect(
        v_model=("views_preset",),
        items=("views_presets", presets),
        label="Grey values",
        style="max-width: 140px;",
        raw_attrs=['data-testid="views-preset"'],
        **SMALL,
    )
    for name, letter, words in (("views_window", "W", "Window"), ("views_level", "L", "Level")):
        v3.VTextField(
            model_value=(name,),
            change=f"{name} = Number($event.target.value)",
            type="number",
            prefix=letter,
            suffix="HU",
            style="max-width: 120px;",
            raw_attrs=[f'aria-label="{words} in HU"', f'data-testid="{name}"'],
            **SMALL,
        )
    with v3.VBtn(
        icon="mdi-contrast-circle",
        size="small",
        variant=("views_drag ? 'flat' : 'text'",),
        color=("views_drag ? 'primary' : undefined",),
        click="views_drag = !views_drag",
        raw_attrs=['aria-label="Drag in a slice to change the grey values"'],
    ):
        pass


def _shown() -> None:
    from trame.widgets import vuetify3 as v3

    with v3.VBtnToggle(
        v_model=("views_shown", list(SHOWN)),
        multiple=True,
        color="primary",
        density="compact",
        variant="outlined",
        divided=True,
    ):
        for name, words in SHOWN.items():
            v3.VBtn(
                words,
                value=name,
                size="small",
                classes="text-none",
                raw_attrs=[f'data-testid="show-{name}"'],
            )


def _connect(views: Views, state: Any) -> None:
    """Act on what the user sets in the bar."""

    @state.change("views_layout")
    def layout(views_layout: str, **_: Any) -> None:
        if views_layout in NAMES:
            views.set_layout(views_layout)

    @state.change("views_preset")
    def preset(views_preset: str, **_: Any) -> None:
        if views_preset in (SUGGESTED, *PRESETS):
            views.window.use(views_preset)

    @state.change("views_window", "views_level")
    def numbers(views_window: Any, views_level: Any, **_: Any) -> None:
        views.window.ask(views_window, views_level)

    @state.change("views_drag")
    def drag(views_drag: bool, **_: Any) -> None:
        views.drag_window(bool(views_drag))

    @state.change("views_shown")
    def shown(views_shown: Any, **_: Any) -> None:
        views.show_only([name for name in views_shown or () if name in SHOWN])
