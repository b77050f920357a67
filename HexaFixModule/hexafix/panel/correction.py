"""The page of the correction: four kinds, one of which stands in the case."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from hexafix.errors import Fault, InputError
from hexafix.panel.binding import Binding, Fill, button, shown, switch, table
from hexafix.panel.load import CHOOSE
from hexafix.panel.markers import AXES, typed_place
from hexafix.panel.rows import RowsTable
from hexafix.panel.text import at, maybe_number_of, number_of, rounded, text_of
from hexafix.presenter import Step

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

KINDS = ("target-pose", "fragment-motion", "landmarks", "deformity")
MOVING = (CHOOSE, "proximal", "distal")
POSITION, ANGLES = ("X", "Y", "Z"), ("Alpha", "Beta", "Gamma")
TARGET = tuple(f"target{name}LineEdit" for name in (*POSITION, *ANGLES))
MOTION = tuple(f"motion{name}LineEdit" for name in (*POSITION, *ANGLES))
ORIGIN = tuple(f"origin{axis}LineEdit" for axis in AXES)
NAMES = ("x", "y", "z", "α", "β", "γ")

MOVING_BOXES = {
    "fragment-motion": "motionMovingComboBox",
    "landmarks": "landmarksMovingComboBox",
    "deformity": "deformityMovingComboBox",
}

WORDS = {
    "ap_angulation": ("apAngulation", "deg", ("–", "varus", "valgus")),
    "lateral_angulation": ("lateralAngulation", "deg", ("–", "apex-anterior", "apex-posterior")),
    "axial_rotation": ("axialRotation", "deg", ("–", "internal", "external")),
    "ap_translation": ("apTranslation", "mm", ("–", "medial", "lateral")),
    "lateral_translation": ("lateralTranslation", "mm", ("–", "anterior", "posterior")),
    "axial_translation": ("axialTranslation", "mm", ("–", "short", "long")),
}
"""The clinical parameters: their widgets, unit and words; every sign stands in its word."""


def kind_in_case(snapshot: Snapshot) -> str:
    """The kind of correction that stands in the case, or an empty text."""
    return str(at(snapshot.document, "correction", "kind") or "")


def kind_in_form(panel: Panel) -> str:
    """The kind whose form is open."""
    return KINDS[panel.correction_form or 0]


def _in_use(panel: Panel, snapshot: Snapshot, kind: str) -> Mapping[str, Any] | None:
    """The case's correction where it is of this kind."""
    return at(snapshot.document, "correction") if kind_in_case(snapshot) == kind else None


def form(panel: Panel) -> dict[str, Any]:
    """The correction that the open form holds, as the case file has it.

    Raises
    ------
    InputError
        Naming every field that is missing or no number.
    """
    return _FORMS[kind_in_form(panel)](panel)


def _target(panel: Panel) -> dict[str, Any]:
    values = [
        number_of(panel.widgets.get(name, "text"), f"the target's {axis}")
        for name, axis in zip(TARGET, NAMES, strict=True)
    ]
    return {"kind": "target-pose", "position_mm": values[:3], "angles_deg": values[3:]}


def center(panel: Panel) -> list[float]:
    """The point about which the fragment's motion is given: midway between the rings."""
    from hexafix.pipeline import split_point

    recognised = panel.presenter.value(Step.POSES)
    if recognised is None:
        raise InputError.of(
            "no-poses",
            "the motion is given about the middle between the rings, which are not found yet",
            next_step="find the rings' poses first",
        )
    return split_point(recognised, panel.presenter.split_fraction)


def _motion(panel: Panel) -> dict[str, Any]:
    from hexafix.pipeline import motion_matrix

    exact = panel.motion_numbers
    values = []
    for place, (name, axis) in enumerate(zip(MOTION, NAMES, strict=True)):
        text = panel.widgets.get(name, "text")
        # A field that was not touched keeps the exact number behind its rounded text.
        same = exact is not None and text == rounded(exact[place], 4)
        values.append(exact[place] if same and exact else number_of(text, f"the motion's {axis}"))
    matrix = motion_matrix(
        translation_mm=values[:3], angles_deg=values[3:], center_lps_mm=center(panel)
    )
    return {"kind": "fragment-motion", "moving": moving(panel), "matrix_lps": matrix}


def moving(panel: Panel) -> str:
    """The fragment that moves, chosen in the open form."""
    box = MOVING_BOXES[kind_in_form(panel)]
    index = panel.widgets.get(box, "index")
    if index <= 0:
        raise InputError.of(
            "moving-not-chosen",
            "the fragment that moves is not chosen",
            next_step="choose proximal or distal",
        )
    return MOVING[index]


def _landmarks(panel: Panel) -> dict[str, Any]:
    rows = LANDMARKS.complete(panel)
    return {
        "kind": "landmarks",
        "moving": moving(panel),
        "moving_points_lps_mm": [row[:3] for row in rows],
        "fixed_points_lps_mm": [row[3:] for row in rows],
    }


def _deformity(panel: Panel) -> dict[str, Any]:
    found: dict[str, Any] = {
        "kind": "deformity",
        "moving": moving(panel),
        "origin_lps_mm": typed_place(panel, ORIGIN, "the origin"),
    }
    for key, (prefix, unit, words) in WORDS.items():
        name = key.replace("_", " ")
        size = maybe_number_of(panel.widgets.get(f"{prefix}LineEdit", "text"), f"the {name}")
        index = panel.widgets.get(f"{prefix}ComboBox", "index")
        if size is not None:
            found[f"{key}_{unit}"] = size
        if index > 0:
            found[key] = words[index]
            if size is None:
                raise InputError(_size_missing(name, words[index]))
    return found


def _size_missing(name: str, word: str) -> Fault:
    return Fault(
        "size-missing",
        f"the {name} is {word} without a size",
        next_step="type how much, or take the word back",
    )


_FORMS = {
    "target-pose": _target,
    "fragment-motion": _motion,
    "landmarks": _landmarks,
    "deformity": _deformity,
}


def use(panel: Panel, _: Any = None) -> None:
    """Put the open form's correction into the case."""
    if panel.presenter.set_correction(form(panel)):
        panel.correction_typed = False
        LANDMARKS.settle(panel)


def live(panel: Panel, _: Any = None) -> None:
    """Follow the open form, once its kind stands in the case."""
    if kind_in_form(panel) == kind_in_case(panel.snapshot):
        use(panel)
    else:
        panel.correction_typed = True


def _numbers_field(names: Sequence[str], kind: str, texts: Any) -> tuple[Binding, ...]:
    def one(place: int) -> Fill:
        def fill(panel: Panel, snapshot: Snapshot) -> str | None:
            held = _in_use(panel, snapshot, kind)
            return texts(panel, held)[place] if held else None

        return fill

    return tuple(
        Binding(name, "edited", live, (("text", one(place)),)) for place, name in enumerate(names)
    )


def _target_texts(_: Panel, held: Mapping[str, Any]) -> list[str]:
    values = [*(held.get("position_mm") or ()), *(held.get("angles_deg") or ()), *[None] * 6]
    return [text_of(value) for value in values[:6]]


def _motion_texts(panel: Panel, held: Mapping[str, Any]) -> list[str | None]:
    from hexafix.pipeline import motion_numbers

    if panel.presenter.value(Step.POSES) is None:
        return [None] * 6
    try:
        found = motion_numbers(held["matrix_lps"], center_lps_mm=center(panel))
    except InputError:
        panel.motion_numbers = None
        return [""] * 6  # numbers that stood there before would seem to be this motion's
    panel.motion_numbers = [*found["translation_mm"], *found["angles_deg"]]
    return [rounded(value, 4) for value in panel.motion_numbers]


def _moving_box(kind: str) -> Binding:
    def index(panel: Panel, snapshot: Snapshot) -> int | None:
        held = _in_use(panel, snapshot, kind)
        given = str(held.get("moving") or "") if held else ""
        return MOVING.index(given) if given in MOVING else None

    def chosen(panel: Panel, index: int) -> None:
        if index > 0:
            live(panel)

    return Binding(MOVING_BOXES[kind], "picked", chosen, (("index", index),))


def _held_pairs(panel: Panel, snapshot: Snapshot) -> list[list[str]]:
    held = _in_use(panel, snapshot, "landmarks")
    if held is None:
        return []
    moving, goals = (
        list(held.get(f"{which}_points_lps_mm") or ()) for which in ("moving", "fixed")
    )
    pairs: Any = zip(moving, goals, strict=False)
    return [[text_of(value) for point in pair for value in point] for pair in pairs]


def _store_pairs(panel: Panel, rows: list[list[float]]) -> None:
    held = _in_use(panel, panel.snapshot, "landmarks")
    if held is not None:
        points = {
            "moving_points_lps_mm": [row[:3] for row in rows],
            "fixed_points_lps_mm": [row[3:] for row in rows],
        }
        panel.presenter.set_correction({**held, **points})
    else:
        panel.correction_typed = True


LANDMARKS = RowsTable(
    "landmarksTable",
    tuple(f"{what} {axis}" for what in ("Moving", "Goal") for axis in AXES),
    _held_pairs,
    _store_pairs,
)


def _deformity_bindings() -> tuple[Binding, ...]:
    found = []
    for key, (prefix, unit, words) in WORDS.items():

        def size(panel: Panel, snapshot: Snapshot, name: str = f"{key}_{unit}") -> str | None:
            held = _in_use(panel, snapshot, "deformity")
            return text_of(held.get(name)) if held else None

        def word(
            panel: Panel, snapshot: Snapshot, key: str = key, words: tuple[str, ...] = words
        ) -> int | None:
            held = _in_use(panel, snapshot, "deformity")
            given = held.get(key) if held else None
            return None if held is None else words.index(given) if given in words else 0

        found.append(Binding(f"{prefix}LineEdit", "edited", live, (("text", size),)))
        found.append(Binding(f"{prefix}ComboBox", "picked", live, (("index", word),)))
    return tuple(found)


def _origin_texts(_: Panel, held: Mapping[str, Any]) -> list[str]:
    values = [*(held.get("origin_lps_mm") or ()), None, None, None]
    return [text_of(value) for value in values[:3]]


def _choose_kind(panel: Panel, index: int) -> None:
    panel.correction_form = index


def _no_motion(panel: Panel, _: Any) -> None:
    for name in MOTION:
        panel.put(name, "0")
    live(panel)


def state(panel: Panel, snapshot: Snapshot) -> str:
    """Which correction stands in the case, and whether the open form is another."""
    held = kind_in_case(snapshot)
    if not held:
        return (
            "⚠ No correction stands in the case. Fill the form, then press “Use this correction”."
        )
    if held != kind_in_form(panel):
        return f"⚠ The case still holds: {held}. The form below the kind is not in use."
    return f"✓ In use: {held}. What you change here goes into the case at once."


BINDINGS: tuple[Binding, ...] = (
    Binding(
        "correctionKindComboBox",
        "picked",
        _choose_kind,
        (("index", lambda panel, _: KINDS.index(kind_in_form(panel))),),
    ),
    shown("correctionStack", "index", lambda panel, _: KINDS.index(kind_in_form(panel))),
    *_numbers_field(TARGET, "target-pose", _target_texts),
    *(_moving_box(kind) for kind in MOVING_BOXES),
    *_numbers_field(MOTION, "fragment-motion", _motion_texts),
    switch(
        "dragBoneButton",
        lambda panel, on: panel.drag(on),
        lambda panel, _: panel.dragging,
        enabled=lambda panel, _: panel.presenter.value(Step.POSES) is not None,
    ),
    button("resetMotionButton", _no_motion),
    *LANDMARKS.bindings("addLandmarkButton", "removeLandmarkButton"),
    *(
        switch(
            name,
            lambda panel, on, name=name: panel.pick(name if on else ""),
            lambda panel, _, name=name: panel.picking == name,
        )
        for name in ("pickLandmarkButton", "pickOriginButton")
    ),
    *_numbers_field(ORIGIN, "deformity", _origin_texts),
    *_deformity_bindings(),
    button("useCorrectionButton", use),
    button(
        "clearCorrectionButton",
        lambda panel, _: panel.presenter.set_correction(None),
        enabled=lambda _, snapshot: bool(kind_in_case(snapshot)),
    ),
    shown("correctionStateLabel", "text", state),
    table("targetTable", "target"),
)
