"""Step 6: the correction in one of its four forms, and what it asks of the struts."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hexafix.errors import InputError
from hexafix.web.panel import draft as drafts
from hexafix.web.panel.context import PanelContext, typed_state
from hexafix.web.panel.landmarks import Landmarks
from hexafix.web.panel.widgets import button, icon_button, marked, note, table

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot

LPS = ("L", "P", "S")
XYZ = ("x", "y", "z")
ANGLES = ("α (x)", "β (y)", "γ (z)")


@dataclass
class CorrectionState:
    """The correction being written.

    Attributes
    ----------
    draft : dict
        See `hexafix.web.panel.draft`.
    dragging : bool
        Whether the handles of the bone fragment are shown.
    pending : str
        Says that the fields are not what the case holds; empty where they are.
    picking : bool
        Whether the next click in a view gives the centre or origin.
    """

    draft: dict = field(default_factory=drafts.empty)
    pending: str = ""
    dragging: bool = False
    picking: bool = False


class CorrectionStep:
    """Four forms of a correction, its end strut lengths live."""

    def __init__(self, context: PanelContext) -> None:
        self._context = context
        self._data, self._name = typed_state(context.server, CorrectionState)
        self._landmarks = Landmarks(context, self._judge_draft)
        self._shown: Any = None
        self._set: Any = None
        self._centered = False
        self._center: Sequence[float] | None = None
        self.typed = False
        context.before_planning.append(self.require_set)
        context.server.state.change(self._name.draft)(self._judge_draft)

    def build(self) -> None:
        """Make the four forms and the table of the end strut lengths."""
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        draft = self._name.draft
        with (
            v.VBtnToggle(
                v_model=(f"{draft}.kind",),
                update_modelValue=f"flushState('{draft}')",
                mandatory=True,
                density="compact",
                color="primary",
                variant="outlined",
                divided=True,
                classes="hxp-kinds",
                **marked("correction-kind", label="Kind of correction"),
            ),
        ):
            for kind, words in drafts.KINDS.items():
                v.VBtn(
                    words, value=kind, size="small", classes="text-none", **marked(f"kind-{kind}")
                )
        self._moving()
        with html.Div(
            v_if=f"{draft}.kind === 'fragment-motion'", classes="hxp-form", **marked("form-motion")
        ):
            self._motion()
        with html.Div(
            v_if=f"{draft}.kind === 'landmarks'", classes="hxp-form", **marked("form-landmarks")
        ):
            self._landmarks.build(f"({draft}.moving || 'moving')")
        with html.Div(
            v_if=f"{draft}.kind === 'deformity'", classes="hxp-form", **marked("form-deformity")
        ):
            self._deformity()
        with html.Div(
            v_if=f"{draft}.kind === 'target-pose'", classes="hxp-form", **marked("form-target")
        ):
            note("Where the proximal ring stands in the distal ring at the end.")
            self._three("position", XYZ, "mm")
            self._three("target_angles", ANGLES, "deg")
        self._setting()

    def _setting(self) -> None:
        """What is not set yet, the button that sets it, and what it comes to."""
        from trame.widgets import html

        name, context = self._name, self._context
        html.Div(
            f"{{{{ {name.pending} }}}}",
            v_if=name.pending,
            classes="hxp-pending",
            **marked("correction-pending", role="status"),
        )
        button(
            "Set the correction",
            "set-correction",
            self._apply,
            icon="mdi-check",
            primary=True,
            disabled=(context.name.busy,),
        )
        button(
            "Back to the case's values",
            "discard-correction",
            self._discard,
            icon="mdi-restore",
            v_if=name.pending,
        )
        table(
            context,
            "target",
            "What the correction asks for",
            empty="Shown as soon as ring poses and correction are known.",
        )

    def _moving(self) -> None:
        from trame.widgets import vuetify3 as v

        draft = self._name.draft
        v.VSelect(
            v_if=f"{draft}.kind !== 'target-pose'",
            label="Fragment that moves",
            v_model=(f"{draft}.moving",),
            update_modelValue=f"flushState('{draft}')",
            items=([*drafts.FRAGMENTS],),
            density="compact",
            variant="outlined",
            hide_details=True,
            style="max-width: 220px",
            **marked("moving", label="Fragment that moves"),
        )

    def _motion(self) -> None:
        from trame.widgets import html

        note("Turn about the centre (about x, then y, then z, fixed axes), then shift. LPS axes.")
        self._three("translation", LPS, "mm", label="Shift")
        self._three("angles", LPS, "deg", label="Turn about")
        with html.Div(classes="hxp-row"):
            self._three("center", LPS, "mm", label="Centre")
            self._pick_button("center")
        button(
            (f"{self._name.dragging} ? 'Stop dragging' : 'Drag the bone in the 3D view'",),
            "drag-fragment",
            self._toggle_drag,
            icon="mdi-rotate-3d",
            active=(self._name.dragging,),
        )

    def _deformity(self) -> None:
        from trame.widgets import html
        from trame.widgets import vuetify3 as v

        draft = self._name.draft
        note("What is wrong now; the correction undoes it. The direction stands in the word.")
        for key, label, unit, words in drafts.DEFORMITY:
            with html.Div(classes="hxp-row"):
                self._text(f"{draft}.{key}", label, f"draft-{key}", suffix=unit)
                v.VSelect(
                    label="Direction",
                    v_model=(f"{draft}.{key}_word",),
                    update_modelValue=f"flushState('{draft}')",
                    items=([*words],),
                    clearable=True,
                    density="compact",
                    variant="outlined",
                    hide_details=True,
                    style="max-width: 190px",
                    **marked(f"draft-{key}-word", label=f"{label}, direction"),
                )
        with html.Div(classes="hxp-row"):
            self._three("origin", LPS, "mm", label="Origin")
            self._pick_button("origin")

    def _three(self, key: str, axes: Sequence[str], unit: str, *, label: str = "") -> None:
        from trame.widgets import html

        with html.Div(classes="hxp-grid-3"):
            for i, axis in enumerate(axes):
                self._text(
                    f"{self._name.draft}.{key}[{i}]",
                    f"{label} {axis}".strip(),
                    f"draft-{key}-{i}",
                    suffix=unit,
                )

    def _text(self, value: str, label: str, name: str, **more: Any) -> None:
        from trame.widgets import vuetify3 as v

        v.VTextField(
            label=label,
            v_model=(value,),
            update_modelValue=f"flushState('{self._name.draft}')",
            density="compact",
            variant="outlined",
            hide_details=True,
            autocomplete="off",
            **marked(name, label=label),
            **more,
        )

    def _pick_button(self, key: str) -> None:
        icon_button(
            "mdi-crosshairs-gps",
            (f"{self._name.picking} ? 'Click the point in a view' : 'Pick the point by a click'",),
            f"pick-{key}",
            (self._pick, f"['{key}']"),
            active=(self._name.picking,),
        )

    def update(self, snapshot: Snapshot, center: Sequence[float] | None) -> None:
        """Show the document's correction where it has changed.

        Parameters
        ----------
        snapshot : Snapshot
        center : sequence of float or None
            LPS, mm: the point between the fragments, taken as centre until another is written.
        """
        self._center = center
        correction = snapshot.document.get("correction")
        new = dict(self._data.draft)
        if center is None and self._centered:
            # another image: no point of the old one stays
            self._centered, self._shown = False, None
            new["center"], new["origin"] = ["", "", ""], ["", "", ""]
        if center is not None and not self._centered:
            self._centered = True
            words = point_words(center)
            new["center"] = words if not all(new["center"]) else new["center"]
            new["origin"] = words if not all(new["origin"]) else new["origin"]
            self._shown = None
        if correction != self._shown:
            self._shown = correction
            new = drafts.of_document(correction, new) if correction else new
            self._landmarks.take(correction)
            self._set = new if correction else None
        self._data.draft = new
        self._judge_draft()

    def _judge_draft(self, **_: Any) -> None:
        """Say so where the fields hold something that the case does not."""
        held, draft = self._set, self._data.draft
        self.typed = held is not None and self._differs(held, draft)
        if held is None:
            self._data.pending = ""
        elif draft["kind"] != held["kind"]:
            kind = drafts.KINDS[held["kind"]].lower()
            self._data.pending = f"Not set: the case holds a correction by {kind}."
        elif self.typed:
            self._data.pending = "Not set: these values differ from those of the case."
        else:
            self._data.pending = ""

    def stop(self) -> None:
        """Leave picking; dragging stays."""
        if self._data.picking or self._landmarks.picking:
            self._data.picking = False
            self._landmarks.stop()
            self._context.controls.pick_point(None)

    def _differs(self, held: Mapping[str, Any], draft: Mapping[str, Any]) -> bool:
        """Whether something was typed that is not in the case; a look at another kind is not."""
        return {**draft, "kind": held["kind"]} != held or self._landmarks.changed

    def require_set(self) -> None:
        """Plan nothing while the screen shows a correction that the case does not hold (H40).

        Raises
        ------
        InputError
            While something was typed that is not set.
        """
        if self.typed:
            raise InputError.of(
                "correction-not-in-use",
                "a correction was typed that does not stand in the case",
                where="correction",
                next_step="press “Set the correction”, or “Back to the case's values”",
                hazard="H40",
            )

    def _discard(self) -> None:
        """Show the case's correction again."""
        kept = {key: self._data.draft[key] for key in ("center", "origin")}
        self._data.draft = {**drafts.empty(), **kept}
        self._landmarks.clear()
        self._shown = None
        self.update(self._context.presenter.snapshot, self._center)

    def _apply(self) -> None:
        draft = self._data.draft
        make: Callable[[], Mapping[str, Any]] = lambda: drafts.to_document(draft)  # noqa: E731
        if draft["kind"] == "landmarks":
            make = lambda: self._landmarks.to_document(drafts.moving_of(draft))  # noqa: E731
        if self._context.act(lambda: self._context.presenter.set_correction(dict(make()))):
            self._landmarks.hold()
            self._set = dict(self._data.draft)
            self._judge_draft()

    def _toggle_drag(self) -> None:
        on = not self._data.dragging

        def drag() -> None:
            moving = drafts.moving_of(self._data.draft) if on else ""
            self._data.dragging = on
            self._context.controls.drag_fragment(on, moving)

        self._context.act(drag)

    def _pick(self, key: str) -> None:
        if self._data.picking:
            self.stop()
            return
        self._data.picking = True

        def picked(lps: Sequence[float]) -> None:
            self._data.draft = {**self._data.draft, key: point_words(lps)}
            self.stop()

        self._context.ask_point(picked)


def point_words(point: Sequence[float]) -> list[str]:
    """A point for fields; a tenth of a millimetre is finer than a click."""
    from hexafix.pipeline.text import format_number

    return [format_number(value, 1) for value in point]
