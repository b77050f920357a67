"""A correction as it is being written: texts and choices, and the document they make."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from hexafix.errors import InputError
from hexafix.web.panel.context import number
from hexafix.web.state import number_words

KINDS = {
    "fragment-motion": "Fragment motion",
    "landmarks": "Landmarks",
    "deformity": "Deformity",
    "target-pose": "Target pose",
}
"""The four ways to say a correction."""

DEFORMITY = (
    ("ap_angulation", "Angulation, AP view", "deg", ("varus", "valgus")),
    ("lateral_angulation", "Angulation, lateral view", "deg", ("apex-anterior", "apex-posterior")),
    ("axial_rotation", "Axial rotation", "deg", ("internal", "external")),
    ("ap_translation", "Translation, AP view", "mm", ("medial", "lateral")),
    ("lateral_translation", "Translation, lateral view", "mm", ("anterior", "posterior")),
    ("axial_translation", "Axial translation", "mm", ("short", "long")),
)
"""The six clinical parameters: key, label, unit and the two words of their direction."""

FRAGMENTS = ("proximal", "distal")

ZEROS = ("0", "0", "0")


def empty() -> dict[str, Any]:
    """A draft of nothing: no motion, no deformity."""
    draft: dict[str, Any] = {
        "kind": "fragment-motion",
        "moving": None,
        "translation": [*ZEROS],
        "angles": [*ZEROS],
        "center": ["", "", ""],
        "origin": ["", "", ""],
        "position": ["", "", ""],
        "target_angles": [*ZEROS],
    }
    for key, _, _, _ in DEFORMITY:
        draft[key], draft[f"{key}_word"] = "0", None
    return draft


def of_document(correction: Mapping[str, Any], draft: Mapping[str, Any]) -> dict[str, Any]:
    """The draft that shows a correction of the document; the other kinds' fields stay.

    Parameters
    ----------
    correction : mapping
    draft : mapping
        The draft as it stands; its ``center`` is what a fragment motion is told about.
    """
    new = {**draft, "kind": correction["kind"]}
    # a deformity that does not say it is the distal fragment's
    other = "distal" if correction["kind"] == "deformity" else draft["moving"]
    new["moving"] = correction.get("moving", other)
    match correction["kind"]:
        case "target-pose":
            new["position"] = _words(correction["position_mm"])
            new["target_angles"] = _words(correction["angles_deg"])
        case "fragment-motion":
            new.update(motion_words(correction["matrix_lps"], draft["center"]))
        case "deformity":
            new["origin"] = _words(correction["origin_lps_mm"])
            for key, _, unit, _ in DEFORMITY:
                new[key] = number_words(correction.get(f"{key}_{unit}", 0))
                new[f"{key}_word"] = correction.get(key)
    return new


def motion_words(matrix: Any, center: Sequence[str]) -> dict[str, Any]:
    """A fragment's motion in numbers about the draft's centre; nothing without a centre.

    Where no numbers can tell it, their fields are empty: others would seem to be the case's.
    """
    from hexafix.pipeline import motion_numbers
    from hexafix.pipeline.text import format_number

    if not all(center):
        return {}
    try:
        about = [number(text, where="correction.center") for text in center]
        found = motion_numbers(matrix, center_lps_mm=about)
    except InputError:
        return {"translation": ["", "", ""], "angles": ["", "", ""]}
    return {
        "translation": [format_number(value, 3) for value in found["translation_mm"]],
        "angles": [format_number(value, 3) for value in found["angles_deg"]],
    }


def to_document(draft: Mapping[str, Any]) -> dict[str, Any]:
    """The correction that a draft says; landmarks have their own.

    Raises
    ------
    InputError
        For the first field that holds no number, or if the fragment that moves is not chosen.
    """
    from hexafix.pipeline import motion_matrix

    match draft["kind"]:
        case "target-pose":
            return {
                "kind": "target-pose",
                "position_mm": _numbers(draft, "position"),
                "angles_deg": _numbers(draft, "target_angles"),
            }
        case "fragment-motion":
            matrix = motion_matrix(
                translation_mm=_numbers(draft, "translation"),
                angles_deg=_numbers(draft, "angles"),
                center_lps_mm=_numbers(draft, "center"),
            )
            return {
                "kind": "fragment-motion",
                "moving": moving_of(draft),
                "matrix_lps": [[*row] for row in matrix],
            }
    made: dict[str, Any] = {"kind": "deformity", "moving": moving_of(draft)}
    made["origin_lps_mm"] = _numbers(draft, "origin")
    for key, _, unit, _ in DEFORMITY:
        value = number(draft[key], where=f"correction.{key}")
        made[f"{key}_{unit}"] = value
        if draft[f"{key}_word"]:
            made[key] = draft[f"{key}_word"]
    return made


def moving_of(draft: Mapping[str, Any]) -> str:
    """The fragment that moves: chosen by the user, never for him.

    Raises
    ------
    InputError
        If none is chosen.
    """
    if draft["moving"] not in FRAGMENTS:
        raise InputError.of(
            "moving-not-chosen",
            "the fragment that moves is not chosen",
            where="correction.moving",
            next_step="choose proximal or distal",
        )
    return draft["moving"]


def _words(values: Sequence[float]) -> list[str]:
    return [number_words(value) for value in values]


def _numbers(draft: Mapping[str, Any], key: str) -> list[float]:
    return [number(text, where=f"correction.{key}[{i}]") for i, text in enumerate(draft[key])]
