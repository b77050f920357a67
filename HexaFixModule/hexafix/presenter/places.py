"""Where a fault stands, in the words of the screen: a surgeon reads no keys of a case file."""

from __future__ import annotations

import re

WORDS = {
    "case_id": "name of the case",
    "image": "CT",
    "image.path": "place of the CT",
    "image.series_instance_uid": "series of the CT",
    "limb": "limb",
    "limb.side": "side of the limb",
    "limb.bone": "bone of the limb",
    "fixator": "fixator",
    "fixator.proximal": "fixator, proximal ring",
    "fixator.distal": "fixator, distal ring",
    "fixator.strut": "fixator, struts",
    "markers": "marker layout",
    "markers.ball_diameter_mm": "diameter of the marker balls",
    "ball_diameter_mm": "diameter of the marker balls",
    "markers.proximal": "layout of the proximal ring",
    "markers.distal": "layout of the distal ring",
    "marker_edits": "balls added or removed",
    "marker_edits.added_lps_mm": "balls added",
    "marker_edits.removed_lps_mm": "balls removed",
    "numbering": "numbering",
    "strut_readings_mm": "strut readings",
    "ring_front_confirmed": "front of both rings",
    "readings_to_repeat": "second entry of the readings",
    "correction": "correction",
    "correction.position_mm": "target pose, position",
    "correction.position": "target pose, position",
    "correction.target_angles": "target pose, angles",
    "correction.angles_deg": "target pose, angles",
    "correction.matrix_lps": "motion of the fragment",
    "correction.translation": "motion of the fragment, shift",
    "correction.angles": "motion of the fragment, turn",
    "correction.center": "motion of the fragment, centre",
    "correction.moving": "fragment that moves",
    "correction.kind": "kind of correction",
    "correction.moving_points_lps_mm": "landmarks of the moving fragment",
    "correction.fixed_points_lps_mm": "landmarks of the resting fragment",
    "correction.origin_lps_mm": "origin of the deformity",
    "correction.origin": "origin of the deformity",
    "correction.ap_angulation": "angulation, AP view",
    "correction.lateral_angulation": "angulation, lateral view",
    "correction.axial_rotation": "axial rotation",
    "correction.ap_translation": "translation, AP view",
    "correction.lateral_translation": "translation, lateral view",
    "correction.axial_translation": "axial translation",
    "schedule": "schedule",
    "schedule.start_date": "first day of the schedule",
    "schedule.adjustments_per_day": "adjustments a day",
    "schedule.compensation": "compensation",
    "schedule.strut_step_mm": "smallest strut step",
    "schedule.max_rate_mm_per_day": "fastest motion",
    "schedule.max_rate_deg_per_day": "fastest rotation",
    "schedule.structures_at_risk_lps_mm": "structures at risk",
}
"""Place in the case document, without indices, and what the screen calls it; a value and the word
of its direction (``…_deg``, ``…_mm``) have one name."""

ROWS = {
    "markers.proximal": "row",
    "markers.distal": "row",
    "strut_readings_mm": "strut",
    "numbering": "number",
    "marker_edits.added_lps_mm": "row",
    "marker_edits.removed_lps_mm": "row",
    "correction.moving_points_lps_mm": "point",
    "correction.fixed_points_lps_mm": "point",
    "schedule.structures_at_risk_lps_mm": "point",
    "fixator.proximal.joints_mm": "joint",
    "fixator.distal.joints_mm": "joint",
}
"""Lists, and what one of their rows is called, counted from 1; never by the name of something that
has a number of its own on the frame, as markers and balls have (H19)."""

COLUMNS = {
    "number": "number",
    "radius_mm": "radius",
    "sweep_deg": "sweep",
    "height_mm": "height",
    "joints_mm": "joints",
    "holes": "holes",
    "thickness_mm": "thickness",
    "outer_radius_mm": "outer radius",
    "min_mm": "shortest length",
    "max_mm": "longest length",
    "scale_offset_mm": "offset of the scale",
}
"""Keys inside a row or a ring, and what the screen calls them."""

FILES = {"case.json": "case file", "plan.json": "plan"}
"""Names that stand for any file of their kind."""

_TOPS = tuple(sorted({key.partition(".")[0] for key in WORDS}, key=len, reverse=True))
_PART = re.compile(r"([A-Za-z0-9_]+)|\[([0-9]+)\]")
_PATH = re.compile(rf"(?:{'|'.join(_TOPS)})(?:\.[A-Za-z0-9_]+|\[[0-9]+\])*")
_RING_PATH = re.compile(r"(?:proximal|distal)\[[0-9]+\](?:\.[a-z_]+)?")
_IN_TEXT = re.compile(
    rf"(?<![\w.“/\[-])(?:{_RING_PATH.pattern}|(?:{'|'.join(_TOPS)})(?:\.[A-Za-z0-9_]+|\[[0-9]+\])+"
    rf"|(?:{'|'.join(top for top in _TOPS if '_' in top)})\b)"
)
_FRAME_FILE = re.compile(r"([^/\\]+\.json)\.(.+)")
_PLAIN = re.compile(r"[A-Za-z][A-Za-z0-9]*( [A-Za-z0-9()]+)+")
_FILE = re.compile(r".*[/\\].*|.+\.[A-Za-z][A-Za-z0-9]{1,5}")
_KEY = re.compile(r"[A-Za-z0-9_]+")


def place_words(where: str | None) -> str:
    """What the screen calls a place; empty where its name would tell nothing.

    Parameters
    ----------
    where : str or None
        `Fault.where`: a JSON path of the case, an option, a file or words.
    """
    if not where or where.startswith("-"):
        return ""
    if _RING_PATH.fullmatch(where):
        where = f"markers.{where}"
    if _PATH.fullmatch(where):
        return _case_words(where)
    frame = _FRAME_FILE.fullmatch(where)
    if frame:
        return f"{frame[1]}, {place_words(f'fixator.{frame[2]}')}".removesuffix(", ")
    if _PLAIN.fullmatch(where) or _FILE.fullmatch(where):
        return FILES.get(where, where)
    return f"entry “{where}”" if _KEY.fullmatch(where) else ""


def plain_text(text: str) -> str:
    """A text in which keys of the case are told in the words of the screen."""
    return _IN_TEXT.sub(lambda found: place_words(found[0]), text)


def _case_words(where: str) -> str:
    """Words of a path of the case: its longest known beginning, then part after part."""
    parts = _PART.findall(where)
    path = parts[0][0]
    words, listed = [WORDS[path]], ROWS.get(path)
    for name, index in parts[1:]:
        if listed and (index or name.isdigit()):
            words.append(f"{listed} {int(index) + 1 if index else name}")
            listed = None
            continue
        if index:
            words.append(_coordinate(path, int(index)))
            continue
        path = f"{path}.{name}"
        known = WORDS.get(path) or WORDS.get(path.removesuffix("_deg").removesuffix("_mm"))
        if known:
            words = [known]
        else:
            words.append(COLUMNS.get(name) or f"entry “{name}”")
        listed = ROWS.get(path)
    return ", ".join(words)


def _coordinate(path: str, index: int) -> str:
    """A coordinate of a point by its letter, else its place counted from 1."""
    if "matrix" in path or index > 2:
        return f"row {index + 1}"
    in_frame = ("position", "angles_deg", "target", "joints")
    return ("xyz" if any(word in path for word in in_frame) else "LPS")[index]
