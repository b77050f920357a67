"""Banners: what was refused or failed, in words, with the next step and the hazard."""

from __future__ import annotations

from hexafix.web.panel.context import PanelContext
from hexafix.web.panel.widgets import icon_button, marked


class Banners:
    """Those of the open step in full, the others as one line that leads there."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context

    def build(self) -> None:
        """Make the banners, above the steps."""
        from trame.widgets import html

        name = self._context.name
        with html.Div(classes="hxp-banners", **marked("banners", role="alert", label="Messages")):
            self._notice()
            with html.Template(v_for=f"banner in {name.banners}", key="banner.id"):
                self._full(f"!banner.step || banner.step === {name.current}")
                self._line()

    def _full(self, shown: str) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        with html.Div(
            v_if=shown,
            classes=("['hxp-banner', 'hxp-banner-' + banner.kind]",),
            **marked("banner", data_kind=("banner.kind",), data_code=("banner.code",)),
        ):
            v.VIcon(
                icon=("banner.icon",),
                size="small",
                color=("banner.color",),
                **marked("banner-icon", label=("banner.word",)),
            )
            with html.Div(classes="hxp-banner-text"):
                with html.Div(classes="hxp-banner-title"):
                    html.Span("{{ banner.title }}")
                    html.Span("{{ banner.hazard }}", v_if="banner.hazard", classes="hxp-hazard")
                html.Div("{{ banner.message }}", **marked("banner-message"))
                with html.Div(
                    v_if="banner.next_step", classes="hxp-next", **marked("banner-next-step")
                ):
                    html.B("Next step: ")
                    html.Span("{{ banner.next_step }}")

    def _line(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        with html.Div(
            v_else=True,
            classes=("['hxp-banner', 'hxp-banner-line', 'hxp-banner-' + banner.kind]",),
            tabindex="0",
            role="link",
            click=(self._go, "[banner.step]"),
            keydown_enter=(self._go, "[banner.step]"),
            **marked("banner-line", data_kind=("banner.kind",), data_code=("banner.code",)),
        ):
            v.VIcon(icon=("banner.icon",), size="x-small", color=("banner.color",))
            html.Span("{{ banner.title }}: {{ banner.message }}")

    def _notice(self) -> None:
        """What could not be done just now, apart from the steps."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        notice = self._context.name.notice
        with html.Div(
            v_if=f"{notice}.message",
            classes="hxp-banner hxp-banner-error",
            **marked("notice-error", data_code=(f"{notice}.code",)),
        ):
            v.VIcon(icon="mdi-alert-circle", size="small", color="error")
            with html.Div(classes="hxp-banner-text"):
                with html.Div(classes="hxp-banner-title"):
                    html.Span("Not taken")
                    html.Span(
                        f"{{{{ {notice}.hazard }}}}", v_if=f"{notice}.hazard", classes="hxp-hazard"
                    )
                html.Div(f"{{{{ {notice}.message }}}}")
                with html.Div(v_if=f"{notice}.next_step", classes="hxp-next"):
                    html.B("Next step: ")
                    html.Span(f"{{{{ {notice}.next_step }}}}")
            icon_button("mdi-close", "Close this message", "close-notice", self._context.forgive)

    def _go(self, step: str) -> None:
        from hexafix.presenter import Step

        if step:
            self._context.presenter.go_to(Step(step))
