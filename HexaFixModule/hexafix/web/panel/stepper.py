"""The eight steps one below the other: sign, title, state, one line; the open one in full."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from hexafix.web.panel.context import PanelContext
from hexafix.web.panel.widgets import marked


class Stepper:
    """Eight steps, one of them open.

    Parameters
    ----------
    context : PanelContext
    builders : mapping of str to callable
        Makes each step's content.
    """

    def __init__(self, context: PanelContext, builders: Mapping[str, Callable[[], Any]]) -> None:
        self._context, self._builders = context, builders

    def build(self) -> None:
        """Make the steps."""
        from trame.widgets import html

        name = self._context.name
        with html.Div(classes="hxp-steps", **marked("steps", label="Steps of the workflow")):
            for index, (step, build) in enumerate(self._builders.items()):
                view = f"({name.steps}[{index}] || {{}})"
                opened = f"{name.current} === '{step}'"
                with html.Section(
                    classes=(f"['hxp-step', {opened} ? 'hxp-open' : '']",),
                    **marked(f"step-{step}", data_state=(f"{view}.state",)),
                ):
                    self._head(step, index, view, opened)
                    with html.Div(v_if=opened, classes="hxp-body", **marked(f"body-{step}")):
                        self._faults(view)
                        build()

    def _head(self, step: str, index: int, view: str, opened: str) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        with html.Button(
            type="button",
            classes="hxp-head",
            click=(self._go, f"['{step}']"),
            **marked(f"open-{step}", aria_expanded=(opened,)),
        ):
            html.Span(str(index + 1), classes=(f"'hxp-no hxp-no-' + {view}.state",))
            with html.Span(classes="hxp-head-words"):
                html.Span(f"{{{{ {view}.title }}}}", classes="hxp-head-title")
                html.Span(
                    f"{{{{ {view}.summary }}}}",
                    v_if=f"{view}.summary !== {view}.word",
                    classes="hxp-summary",
                    title=(f"{view}.summary",),
                    **marked(f"summary-{step}"),
                )
            with html.Span(
                classes=(f"'hxp-chip hxp-chip-' + {view}.state",), **marked(f"state-{step}")
            ):
                v.VIcon(icon=(f"{view}.icon",), size="x-small")
                html.Span(f"{{{{ {view}.word }}}}")

    def _faults(self, view: str) -> None:
        from trame.widgets import html

        with html.Ul(
            v_if=f"{view}.state === 'waiting' && ({view}.faults || []).length",
            classes="hxp-faults",
            **marked("step-faults"),
        ):
            html.Li(f"{{{{ fault }}}}", v_for=f"(fault, i) in {view}.faults", key="i")  # noqa: F541

    def _go(self, step: str) -> None:
        from hexafix.presenter import Step

        self._context.presenter.go_to(Step(step))
