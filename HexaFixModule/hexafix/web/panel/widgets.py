"""The panel's own small widgets: fields, tables and notes in one manner, named for tests."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from hexafix.web.panel.context import PanelContext

Bound = str | tuple[Any]
"""A text, or in a tuple an expression of the browser's template."""


def marked(test_id: Bound, *, label: Bound | None = None, **more: Bound) -> dict[str, Any]:
    """Attributes for tests and screen readers: ``**marked("open-case", label="Open a case")``."""
    raw = [_attribute("data-testid", test_id)]
    if label is not None:
        raw.append(_attribute("aria-label", label))
    raw += [_attribute(name.replace("_", "-"), value) for name, value in more.items()]
    return {"raw_attrs": raw}


def _attribute(name: str, value: Bound) -> str:
    if isinstance(value, tuple):
        return f':{name}="{value[0]}"'
    return f'{name}="{value}"'


def button(
    words: Bound,
    test_id: Bound,
    click: Any,
    *,
    icon: str | None = None,
    primary: bool = False,
    **more: Any,
) -> Any:
    """A labelled button; `more` are properties such as ``disabled``."""
    from trame.widgets import vuetify3 as v

    look = {"color": "primary", "variant": "flat"} if primary else {"variant": "outlined"}
    return v.VBtn(
        f"{{{{ {words[0]} }}}}" if isinstance(words, tuple) else words,
        click=click,
        size="small",
        prepend_icon=icon,
        classes="text-none",
        **{**look, **marked(test_id), **more},
    )


def icon_button(
    icon: str | tuple[str],
    label: Bound,
    test_id: Bound,
    click: Any,
    *,
    in_row: bool = False,
    **more: Any,
) -> Any:
    """A button that is a sign; its label is read out and shown as a tooltip.

    `in_row`: small, and its click is not one on the table's row.
    """
    from trame.widgets import vuetify3 as v

    if in_row:
        more |= {"click_stop": click, "__events": [("click_stop", "click.stop")]}
    else:
        more["click"] = click
    return v.VBtn(
        icon=icon,
        size="x-small" if in_row else "small",
        variant="text",
        density="comfortable",
        **{**marked(test_id, label=label, title=label), **more},
    )


def field(
    context: PanelContext,
    name: str,
    label: Bound,
    value: str,
    commit: Callable[..., Any],
    arguments: str = "",
    *,
    key: Bound | None = None,
    **more: Any,
) -> Any:
    """A field that shows a value of the document and hands its text over when it is left.

    Parameters
    ----------
    context : PanelContext
    name : str
        The field's name for tests and errors.
    label : str or (expression,)
    value : str
        Template expression of the document's value.
    commit : callable
        Called with `arguments` and the text.
    arguments : str
        Template expressions before the text, with commas.
    key : str or (expression,), optional
        The field's name where it depends on a loop.
    """
    from trame.widgets import vuetify3 as v

    key = key or name
    own = key[0] if isinstance(key, tuple) else f"'{key}'"
    raw = marked(key, label=label)["raw_attrs"]
    raw.append(f':key="{own} + ({context.name.field_keys}[{own}] || 0)"')
    return v.VTextField(
        label=label,
        model_value=(value,),
        change=(commit, f"[{arguments}$event.target.value]"),
        error_messages=(f"{context.name.field_errors}[{own}]",),
        density="compact",
        variant="outlined",
        hide_details="auto",
        autocomplete="off",
        __events=["change"],
        raw_attrs=raw,
        **more,
    )


def choice(
    context: PanelContext, name: str, label: str, value: str, items: Any, commit: Callable[..., Any]
) -> Any:
    """A drop-down that shows a value of the document and hands the chosen one over."""
    from trame.widgets import vuetify3 as v

    return v.VSelect(
        label=label,
        model_value=(value,),
        items=items,
        update_modelValue=(commit, "[$event]"),
        error_messages=(f"{context.name.field_errors}['{name}']",),
        density="compact",
        variant="outlined",
        hide_details="auto",
        **marked(name, label=label),
    )


def table(
    context: PanelContext,
    name: str,
    caption: str,
    *,
    click: Any = None,
    picked: str = "false",
    row_end: Callable[[], Any] | None = None,
    empty: str = "",
    hidden: tuple[str, ...] = (),
) -> None:
    """One of the snapshot's tables as it is: words in cells, grey when out of date.

    Parameters
    ----------
    context : PanelContext
    name : str
        The table's name in the snapshot.
    caption : str
        Read out, and shown above the table.
    click : trame event, optional
        What a click or Enter on a row does; the template knows ``row`` and ``i``.
    picked : str
        Template expression: whether row ``i`` is picked.
    row_end : callable, optional
        Builds what stands in a last cell of each row.
    empty : str
        Shown while there are no rows.
    hidden : tuple of str
        Heads of columns for which there is no room here.
    """
    from trame.widgets import html

    left = f"!{[*hidden]}.includes"
    words = getattr(context.name, f"table_{name}")
    if empty:
        html.Div(empty, v_if=f"!{words}.rows.length", classes="hxp-note", **marked(f"no-{name}"))
    with (
        html.Div(v_if=f"{words}.rows.length", classes="hxp-scroll"),
        html.Table(
            classes=(f"['hxp-table', {words}.stale ? 'hxp-stale' : '']",),
            **marked(f"table-{name}", data_stale=(f"{words}.stale",)),
        ),
    ):
        with html.Caption():
            html.Span(caption)
            html.Span(" · out of date", v_if=f"{words}.stale", classes="hxp-late")
        with html.Thead(), html.Tr():
            with html.Template(v_for=f"column in {words}.columns", key="column"):
                html.Th("{{ column }}", v_if=f"{left}(column)", scope="col")
            if row_end:
                html.Th(raw_attrs=['aria-label="actions"'])
        with html.Tbody():
            _rows(name, words, click, picked, row_end, left)


def _rows(name: str, words: str, click: Any, picked: str, row_end: Any, left: str) -> None:
    from trame.widgets import html

    raw = marked((f"'{name}-' + i",))["raw_attrs"]
    acts: dict[str, Any] = {}
    if click:
        raw += ['tabindex="0"', 'role="button"', f':aria-pressed="{picked}"']
        acts = {"click": click, "keydown_enter": click}
    with html.Template(v_for=f"(row, i) in {words}.rows", key="i"):
        with html.Tr(
            classes=(
                f"[{words}.alerts[i] ? 'hxp-alert' : '', ({picked}) ? 'hxp-picked' : '', "
                f"'{'hxp-click' if click else ''}']",
            ),
            raw_attrs=raw,
            **acts,
        ):
            with html.Template(v_for="(cell, j) in row", key="j"):
                html.Td(
                    "{{ cell }}",
                    v_if=f"{left}({words}.columns[j])",
                    classes=("/^-?[0-9][^ ]*$/.test(cell) ? 'hxp-figure' : ''",),
                )
            if row_end:
                with html.Td(classes="hxp-end"):
                    row_end()
        with html.Tr(v_if=f"{words}.alerts[i]", classes="hxp-alert"):
            html.Td(
                f"{{{{ {words}.alerts[i] }}}}",
                classes="hxp-why",
                raw_attrs=[f':colspan="{words}.columns.length + {int(row_end is not None)}"'],
            )


def title(words: str) -> Any:
    """A small heading inside a step."""
    from trame.widgets import html

    return html.H3(words, classes="hxp-title")


def note(words: Bound, **more: Any) -> Any:
    """A line of explanation in small grey letters."""
    from trame.widgets import html

    return html.P(words, **{"classes": "hxp-note", **more})


def picture(expression: str, alternative: str, test_id: str, **more: Any) -> Any:
    """An image from a data address in the state; nothing is shown while it is empty."""
    from trame.widgets import html

    return html.Img(
        v_if=expression,
        src=(expression,),
        classes="hxp-picture",
        **{**marked(test_id, alt=alternative), **more},
    )
