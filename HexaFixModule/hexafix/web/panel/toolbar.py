"""The bar on top: the case, undo and redo with their words, progress and cancel."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hexafix.web.files import CASE_SUFFIXES, SCENE_SUFFIXES
from hexafix.web.panel.chooser import Chooser
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.scene import SceneFile
from hexafix.web.panel.widgets import button, icon_button, marked

NOTICE = "Research software. Not a medical device. Plans are not approved."
"""Always on screen."""


@dataclass
class ToolbarState:
    """Whether the user is asked before unsaved edits are lost."""

    asking: bool = False


class Toolbar:
    """Case file, undo and redo, progress."""

    def __init__(self, context: PanelContext, chooser: Chooser, scene: SceneFile) -> None:
        self._context, self._chooser, self._scene = context, chooser, scene
        self._then: Callable[[], Any] = lambda: None
        self._data, self._name = typed_state(context.server, ToolbarState)
        context.server.trigger("hx_undo")(self.undo)
        context.server.trigger("hx_redo")(self.redo)

    def build(self) -> None:
        """Make the bar's content, inside a VAppBar."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._context.name
        with html.Div(classes="hxp-brand", **marked("brand")):
            html.Span("HexaFix", classes="hxp-logo")
            with html.Span(classes="hxp-case", **marked("case-name")):
                html.Span(f"{{{{ {name.case_id} || 'no case' }}}}")
                html.Span("not saved", v_if=name.edited, classes="hxp-unsaved", **marked("unsaved"))
        with html.Div(classes="hxp-row", role="group"):
            icon_button("mdi-file-plus-outline", "New case", "new-case", self.new_case)
            icon_button(
                "mdi-folder-open-outline", "Open a case or a scene", "open-case", self.open_case
            )
            save = f"{name.case_path} ? 'Save the case' : 'Save the case as a file'"
            icon_button("mdi-content-save-outline", (save,), "save-case", self.save)
            icon_button(
                "mdi-content-save-edit-outline", "Save the case as", "save-as", self.save_as
            )
            self._scene.build()
        v.VDivider(vertical=True, inset=True, classes="mx-1")
        for word, icon in (("undo", "mdi-undo"), ("redo", "mdi-redo")):
            can, label = getattr(name, f"can_{word}"), getattr(name, f"{word}_label")
            says = f"{can} ? '{word.capitalize()}: ' + {label} : 'Nothing to {word}'"
            click = self.undo if word == "undo" else self.redo
            icon_button(icon, (says,), word, click, disabled=(f"!{can} || {name.busy}",))
        html.Span(
            f"{{{{ {name.undo_label} }}}}",
            v_if=name.can_undo,
            classes="hxp-undo-label",
            **marked("undo-label"),
        )
        v.VSpacer()
        self._progress()
        button(
            "Plan all steps",
            "run-all",
            self._run_all,
            icon="mdi-play",
            primary=True,
            v_if=f"!{name.busy}",
        )
        html.Span(NOTICE, classes="hxp-notice", **marked("notice", role="note"))

    def _progress(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        name = self._context.name
        with html.Div(v_if=name.busy, classes="hxp-progress", **marked("progress", role="status")):
            html.Span(f"{{{{ {name.progress_text} || 'working' }}}}", classes="hxp-progress-text")
            v.VProgressLinear(
                model_value=(name.progress_percent,),
                color="primary",
                height=6,
                rounded=True,
                **marked("progress-bar", label="Progress of the step"),
            )
        button(
            "Cancel",
            "cancel",
            self._context.presenter.cancel,
            icon="mdi-stop",
            v_if=name.busy,
        )

    def _run_all(self) -> None:
        self._context.plan(self._context.presenter.run_all)

    def undo(self) -> None:
        """Take the last edit back."""
        context = self._context
        if context.presenter.snapshot.can_undo:
            context.restore()
            context.act(context.presenter.undo)

    def redo(self) -> None:
        """Make the edit again that was taken back."""
        context = self._context
        if context.presenter.snapshot.can_redo:
            context.restore()
            context.act(context.presenter.redo)

    def open_case(self) -> None:
        """Ask for a case file, and before that whether unsaved edits may be lost."""
        self._unless_unsaved(self._choose_case)

    def new_case(self) -> None:
        """Start with an empty case, and before that ask whether unsaved edits may be lost."""
        self._unless_unsaved(self._new)

    def _new(self) -> None:
        self._context.restore()
        self._context.act(self._context.presenter.new_case)

    def _unless_unsaved(self, work: Callable[[], Any]) -> None:
        self._then = work
        if self._context.presenter.snapshot.edited:
            self._data.asking = True
        else:
            work()

    def _go_on(self) -> None:
        self._data.asking = False
        self._then()

    def _choose_case(self) -> None:
        self._chooser.ask(
            "Open a case or a scene",
            "Open",
            self._open,
            suffixes=(*CASE_SUFFIXES, *SCENE_SUFFIXES),
            hint="A case file (case.json), or a scene (.mrb) that HexaFix saved, with its CT.",
        )

    def _open(self, path: Path) -> None:
        """Open a case file, and read its image if it names one; or a scene with both."""
        from hexafix.presenter import Step, StepState

        context = self._context
        context.restore()
        if context.act(lambda: context.presenter.open_case(path)):
            view = context.presenter.snapshot.view(Step.LOAD)
            if view.state == StepState.READY:
                context.act(lambda: context.presenter.run(Step.LOAD))

    def save(self) -> None:
        """Save where the case came from, else ask."""
        context, path = self._context, self._context.presenter.snapshot.case_path
        if path:
            context.act(lambda: context.presenter.save_case(Path(path)))
        else:
            self.save_as()

    def save_as(self) -> None:
        """Ask where to save."""
        context = self._context
        self._chooser.ask(
            "Save the case as",
            "Save",
            lambda path: context.act(lambda: context.presenter.save_case(path)),
            suffixes=CASE_SUFFIXES,
            name="case.json",
            hint="The case is saved as a draft or complete, with the image's place beside it.",
        )

    def build_dialog(self) -> None:
        """Make the question before unsaved edits are lost."""
        from trame.widgets import vuetify3 as v

        with (
            v.VDialog(v_model=(self._name.asking,), max_width=440),
            v.VCard(**marked("ask-unsaved", label="Edits are not saved")),
        ):
            v.VCardTitle("Edits are not saved", classes="text-subtitle-1 font-weight-bold")
            v.VCardText("If you go on, the edits of this case since it was saved are lost.")
            with v.VCardActions():
                v.VSpacer()
                button("Keep this case", "ask-keep", self._keep)
                button("Go on", "ask-go-on", self._go_on, primary=True)

    def _keep(self) -> None:
        self._data.asking = False
