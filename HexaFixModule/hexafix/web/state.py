"""The presenter's snapshot as the few ready words that the browser shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from hexafix.panel.text import text_of
from hexafix.presenter.notices import message_of, next_step_of

if TYPE_CHECKING:
    from hexafix.presenter import Snapshot, Table

NAMESPACE = "hx"
"""Prefix of all state names of the side panel."""

TABLES = (
    *("series", "image", "balls", "rejected", "numbering", "poses", "gates", "layout"),
    *("struts", "target", "schedule", "strut_plan"),
)
"""The snapshot's tables, each under its own state name, so that only what changed is sent."""

EMPTY_TABLE: Mapping[str, Any] = {"columns": [], "rows": [], "alerts": [], "stale": False}

CHIPS = {
    "waiting": ("waiting", "grey-lighten-1", "mdi-circle-outline"),
    "ready": ("ready", "primary", "mdi-play-circle-outline"),
    "running": ("running", "primary", "mdi-progress-clock"),
    "done": ("done", "success", "mdi-check-circle"),
    "stale": ("out of date", "grey-darken-1", "mdi-history"),
    "refused": ("refused", "error", "mdi-close-octagon"),
}
"""Word, colour and sign of each state of a step: no state is told by colour alone."""

BANNERS = {
    "refused": ("error", "mdi-close-octagon", "Refused"),
    "error": ("error", "mdi-alert-circle", "Error"),
    "warning": ("warning", "mdi-alert", "Warning"),
    "info": ("info", "mdi-information", "Note"),
}
"""Colour, sign and word of each kind of banner."""


def table_name(name: str) -> str:
    """State name of a table, e.g. ``table_balls``."""
    return f"table_{name}"


def _table() -> dict[str, Any]:
    return dict(EMPTY_TABLE)


@dataclass
class PanelState:
    """Everything that the side panel shows; the server fills it with ready words.

    Attributes
    ----------
    steps : list of dict
        id, title, state, word, color, icon, summary, faults.
    form : dict
        The case document's values as the fields show them.
    field_errors, field_keys : dict
        Per field: why its text was not taken; and a count that rebuilds the field with the
        document's value.
    """

    case_id: str = ""
    case_path: str = ""
    edited: bool = False
    can_undo: bool = False
    undo_label: str = ""
    can_redo: bool = False
    redo_label: str = ""
    steps: list = field(default_factory=list)
    current: str = "load"
    busy: bool = False
    progress_text: str = ""
    progress_percent: int = 0
    banners: list = field(default_factory=list)
    notice: dict = field(default_factory=dict)
    form: dict = field(default_factory=dict)
    field_errors: dict = field(default_factory=dict)
    field_keys: dict = field(default_factory=dict)
    table_series: dict = field(default_factory=_table)
    table_image: dict = field(default_factory=_table)
    table_balls: dict = field(default_factory=_table)
    table_rejected: dict = field(default_factory=_table)
    table_numbering: dict = field(default_factory=_table)
    table_poses: dict = field(default_factory=_table)
    table_gates: dict = field(default_factory=_table)
    table_layout: dict = field(default_factory=_table)
    table_struts: dict = field(default_factory=_table)
    table_target: dict = field(default_factory=_table)
    table_schedule: dict = field(default_factory=_table)
    table_strut_plan: dict = field(default_factory=_table)
    gates_words: str = ""
    gates_red: bool = False
    can_export: bool = False
    export_blocked_by: str = ""
    export_folder: str = ""
    confirmed: dict = field(default_factory=dict)
    pictures: dict = field(default_factory=dict)


def table_words(table: Table | None) -> dict[str, Any]:
    """A table of the snapshot as plain lists."""
    if table is None:
        return dict(EMPTY_TABLE)
    return {
        "columns": list(table.columns),
        "rows": [list(row) for row in table.rows],
        "alerts": [str(alert or "") for alert in table.alerts],
        "stale": table.stale,
    }


def snapshot_words(snapshot: Snapshot) -> dict[str, Any]:
    """What a snapshot gives the fields of `PanelState`, by name."""
    text, fraction = snapshot.progress or ("", 0.0)
    words: dict[str, Any] = {
        "case_id": snapshot.case_id or "",
        "case_path": str(snapshot.case_path or ""),
        "edited": snapshot.edited,
        "can_undo": snapshot.can_undo,
        "undo_label": snapshot.undo_label or "",
        "can_redo": snapshot.can_redo,
        "redo_label": snapshot.redo_label or "",
        "steps": [_step_words(view) for view in snapshot.steps],
        "current": snapshot.current.value,
        "busy": snapshot.busy,
        "progress_text": text,
        "progress_percent": round(100 * fraction),
        "banners": [_banner_words(banner) for banner in snapshot.banners],
        "can_export": snapshot.can_export,
        "export_blocked_by": snapshot.export_blocked_by or "",
        "export_folder": str(snapshot.export_folder or ""),
        "confirmed": dict(snapshot.confirmed),
    }
    words |= gate_words(snapshot.tables.get("gates"))
    for name in TABLES:
        words[table_name(name)] = table_words(snapshot.tables.get(name))
    return words


def gate_words(table: Table | None) -> dict[str, Any]:
    """How many gates there are and whether one is red, in one line."""
    red = [alert for alert in table.alerts if alert] if table else []
    count = len(table.rows) if table else 0
    told = f"{len(red)} of {count} RED" if red else f"all {count} pass"
    return {"gates_words": f"Safety gates: {told}", "gates_red": bool(red)}


def _step_words(view: Any) -> dict[str, Any]:
    word, color, icon = CHIPS[view.state.value]
    return {
        "id": view.step.value,
        "title": view.title,
        "state": view.state.value,
        "word": word,
        "color": color,
        "icon": icon,
        "summary": view.summary,
        "faults": [next_step_of(fault) or message_of(fault) for fault in view.faults],
    }


def _banner_words(banner: Any) -> dict[str, Any]:
    color, icon, word = BANNERS[banner.kind]
    return {
        "id": banner.id,
        "kind": banner.kind,
        "color": color,
        "icon": icon,
        "word": word,
        "code": banner.code,
        "title": banner.title,
        "message": banner.message,
        "next_step": banner.next_step or "",
        "hazard": banner.hazard or "",
        "step": banner.step.value if banner.step else "",
    }


def number_words(value: float | None) -> str:
    """A number of the document as a field shows it: every digit, a point, nothing rounded."""
    return text_of(value)


NUMBERS_OF_SCHEDULE = (
    "adjustments_per_day",
    "strut_step_mm",
    "max_rate_mm_per_day",
    "max_rate_deg_per_day",
)
"""Keys of the schedule's rules that hold a number."""


def form_words(document: Mapping[str, Any]) -> dict[str, Any]:
    """The case document's values as the fields show them."""
    limb = document.get("limb") or {}
    image = document.get("image") or {}
    fixator = document.get("fixator") or ""
    schedule = document.get("schedule") or {}
    readings = document.get("strut_readings_mm") or [None] * 6
    return {
        "case_id": document.get("case_id") or "",
        "side": limb.get("side"),
        "bone": limb.get("bone"),
        "image": image.get("path") or "",
        "fixator": fixator if isinstance(fixator, str) else fixator.get("id", ""),
        "ball_diameter": number_words((document.get("markers") or {}).get("ball_diameter_mm")),
        "readings": [number_words(reading) for reading in readings],
        "schedule": {
            "start_date": schedule.get("start_date") or "",
            "compensation": schedule.get("compensation"),
            **{key: number_words(schedule.get(key)) for key in NUMBERS_OF_SCHEDULE},
        },
    }
