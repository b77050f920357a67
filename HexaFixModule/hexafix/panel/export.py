"""The page of the export: the side asked again, the sheets, the files."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from hexafix.panel.binding import Binding, button, choice, shown
from hexafix.panel.load import SIDES
from hexafix.panel.text import at
from hexafix.presenter import Step, Table

if TYPE_CHECKING:
    from hexafix.panel.panel import Panel
    from hexafix.presenter import Snapshot

PDF = "prescription.pdf"


def _side(_: Panel, snapshot: Snapshot) -> int:
    given = str(at(snapshot.document, "limb", "side") or "")
    return SIDES.index(given) if snapshot.confirmed.get("side") and given in SIDES else 0


def _confirm(panel: Panel, index: int) -> None:
    if index > 0:
        panel.presenter.confirm_side(SIDES[index])


def _export(panel: Panel, _: Any) -> None:
    folder = panel.widgets.ask_new_file("A new folder for the export", "prescription", "")
    if folder:
        panel.presenter.export(folder)


def _state(_: Panel, snapshot: Snapshot) -> str:
    if snapshot.export_folder:
        return f"✓ Exported to {snapshot.export_folder}"
    if snapshot.can_export:
        return "✓ Everything is in place for the export."
    return f"⚠ No export yet: {snapshot.export_blocked_by}."


def pages(panel: Panel) -> list[bytes]:
    """The pages of the prescription as PNG, while it belongs to what the case holds."""
    files = panel.presenter.prescription_files()
    pdf = (files or {}).get(PDF)
    if pdf is None:
        return []
    if panel.shown_pdf != pdf:
        from hexafix.pipeline import prescription_pages

        panel.shown_pdf, panel.shown_pages = pdf, prescription_pages(pdf, dpi=80)
        panel.page = 0
    return panel.shown_pages


def _page(panel: Panel, snapshot: Snapshot) -> bytes | None:
    if snapshot.current != Step.EXPORT:
        return None
    found = pages(panel)
    return found[min(panel.page, len(found) - 1)] if found else b""


def _page_text(panel: Panel, snapshot: Snapshot) -> str:
    if snapshot.current != Step.EXPORT:
        return ""
    count = len(pages(panel))
    return f"{panel.page + 1} of {count}" if count else "Compute the prescription to see it."


def _turn(panel: Panel, pages_on: int) -> None:
    panel.page = min(max(0, panel.page + pages_on), max(0, len(pages(panel)) - 1))


def _files(panel: Panel, snapshot: Snapshot) -> Table | None:
    if snapshot.current != Step.EXPORT:
        return None
    files = panel.presenter.prescription_files() or {}
    rows = tuple((name, f"{len(content)} bytes") for name, content in sorted(files.items()))
    return Table(("File", "Size"), rows, ("",) * len(rows))


BINDINGS: tuple[Binding, ...] = (
    choice("confirmSideComboBox", _confirm, _side, items=lambda *_: SIDES),
    button("exportButton", _export, enabled=lambda _, snapshot: snapshot.can_export),
    shown("exportStateLabel", "text", _state),
    button(
        "previousPageButton",
        lambda panel, _: _turn(panel, -1),
        enabled=lambda panel, _: panel.page > 0,
    ),
    shown("pageLabel", "text", _page_text),
    button(
        "nextPageButton",
        lambda panel, _: _turn(panel, 1),
        enabled=lambda panel, _: panel.page + 1 < len(panel.shown_pages),
    ),
    shown("prescriptionPicture", "picture", _page),
    shown("filesTable", "table", _files),
)
