"""Step 4: ring poses, gates and the layout's verdict, with what the surgeon confirms."""

from __future__ import annotations

from hexafix.web.panel.context import PanelContext
from hexafix.web.panel.widgets import button, marked, note, picture, table, title


class PosesStep:
    """Ring poses, gates, layout rose, confirmation of the rings' front."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context

    def build(self) -> None:
        """Make the step's tables and switches."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        context, name = self._context, self._context.name
        button(
            "Recognise the ring poses",
            "run-poses",
            self._run,
            icon="mdi-axis-arrow",
            primary=True,
            disabled=(name.busy,),
        )
        table(context, "poses", "Ring poses", empty="The poses are not computed yet.")
        v.VCheckbox(
            label="In the picture, the front of both rings (notch) is where their x axis points",
            model_value=(f"{name.confirmed}.ring_front",),
            update_modelValue=(self._front, "[$event]"),
            density="compact",
            hide_details=True,
            **marked("confirm-ring-front"),
        )
        note("The answer is printed in the prescription.")
        with html.Details(
            v_if=f"{name.table_gates}.rows.length",
            classes="hxp-details",
            open=(f"{name.gates_red}",),
            **marked("gates", data_red=(name.gates_red,)),
        ):
            html.Summary(f"{{{{ {name.gates_words} }}}}", **marked("gates-summary"))
            table(context, "gates", "Each gate with its limit")
        title("Marker layout")
        with html.Div(classes="hxp-grid-2"):
            for ring in ("proximal", "distal"):
                picture(
                    f"{name.pictures}.layout_{ring}",
                    f"Rose of the {ring} ring's markers with their included angles",
                    f"rose-{ring}",
                )
        table(context, "layout", "Verdict on the layout", hidden=("Included angles deg",))
        v.VSwitch(
            label="Accept a layout that meets only the relaxed rule (recorded in the plan)",
            model_value=(f"{name.confirmed}.relaxed_layout",),
            update_modelValue=(self._relaxed, "[$event]"),
            color="warning",
            density="compact",
            hide_details=True,
            **marked("accept-relaxed"),
        )

    def _run(self) -> None:
        from hexafix.presenter import Step

        self._context.act(lambda: self._context.presenter.run(Step.POSES))

    def _front(self, confirmed: bool) -> None:
        self._context.act(lambda: self._context.presenter.confirm_ring_front(bool(confirmed)))

    def _relaxed(self, accepted: bool) -> None:
        self._context.act(lambda: self._context.presenter.accept_relaxed_layout(bool(accepted)))
