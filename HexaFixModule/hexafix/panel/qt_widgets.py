"""The adapter for any Qt: PySide6 and the PythonQt of desktop Slicer alike.

It imports no Qt: the classes come from `kit`, ``qtpy.QtCore``, ``QtGui`` and ``QtWidgets`` in one
namespace, or Slicer's ``qt``. In PythonQt properties are attributes, not methods, and enumerations
and flags are the same; signals are connected by `attach`, the one place where both worlds differ.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import contextmanager
from typing import Any

from hexafix.presenter import Table

SIGNALS = {
    "clicked": "clicked(bool)",
    "checked": "clicked(bool)",
    "edited": "editingFinished()",
    "picked": "activated(int)",
    "cell": "cellChanged(int,int)",
    "moved": "valueChanged(int)",
    "dated": "dateChanged(QDate)",
    "link": "anchorClicked(QUrl)",
}
"""The signal of each event; ``row`` depends on the widget."""

ALERT = "⚠ "
"""Before the first cell of a row that needs attention."""

WIDEST_COLUMN = 140
"""Pixels; a longer text is cut and stands whole in the cell's tip."""

BANNER_HEIGHT = 150
"""Messages higher than this, in pixels, are scrolled."""

ISO = "yyyy-MM-dd"


def read(widget: Any, name: str) -> Any:
    """A property: called in PySide6, an attribute in PythonQt."""
    value = getattr(widget, name)
    return value() if callable(value) else value


@contextmanager
def silenced(widget: Any) -> Any:
    """No signal of the widget within."""
    before = widget.blockSignals(True)
    try:
        yield
    finally:
        widget.blockSignals(before)


class QtWidgets:
    """`hexafix.panel.Widgets` over the widgets of the loaded .ui.

    Parameters
    ----------
    root : QWidget
        What the .ui file gave.
    kit : namespace
        Qt's classes by name.
    find : callable
        Gives a child of `root` by its object name.
    """

    def __init__(self, root: Any, kit: Any, find: Callable[[str], Any]) -> None:
        self.root, self.kit, self.widget = root, kit, find
        self._tips: dict[str, str] = {}
        self._timer: Any = None

    # ------------------------------------------------------------ the one difference

    def attach(self, widget: Any, signal: str, slot: Callable[..., Any]) -> None:
        """Connect a signal, given as ``name(types)``."""
        getattr(widget, signal.partition("(")[0]).connect(slot)

    # ------------------------------------------------------------ events

    def connect(self, name: str, event: str, callback: Callable[[Any], None]) -> None:
        """Call back at an event of a widget."""
        widget = self.widget(name)
        if event == "row":
            listed = hasattr(widget, "currentRowChanged")
            signal = "currentRowChanged(int)" if listed else "itemSelectionChanged()"
        else:
            signal = SIGNALS[event]
        values: dict[str, Callable[..., Any]] = {
            "clicked": lambda *_: None,
            "checked": lambda *_: self.get(name, "checked"),
            "picked": lambda *_: self.get(name, "index"),
            "moved": lambda *_: self.get(name, "value"),
            "edited": lambda *_: self.get(name, "text"),
            "row": lambda *_: self.get(name, "index"),
            "cell": lambda *_: None,
            "dated": lambda *_: self.get(name, "date"),
            "link": lambda url: str(url.toString()),
        }
        value = values[event]
        self.attach(widget, signal, lambda *given: callback(value(*given)))

    def every(self, seconds: float, callback: Callable[[], None] | None) -> None:
        """Call back again and again from now on; None ends it."""
        if self._timer is not None:
            self._timer.stop()
            self._timer = None
        if callback is not None:
            self._timer = self.kit.QTimer(self.root)
            self.attach(self._timer, "timeout()", callback)
            self._timer.start(round(1000 * seconds))

    def finish(self) -> None:
        """End what is being typed, so that an open cell editor hands over its text."""
        focus = self.kit.QApplication.focusWidget()
        if focus is not None and self.root.isAncestorOf(focus):
            focus.clearFocus()

    # ------------------------------------------------------------ properties

    def get(self, name: str, what: str) -> Any:
        """A property of a widget; see `hexafix.panel.Widgets`."""
        widget = self.widget(name)
        if what == "text":
            return str(read(widget, "currentText" if hasattr(widget, "currentText") else "text"))
        if what == "index":
            if hasattr(widget, "rowCount"):
                return self._chosen_row(widget)
            return int(read(widget, _index_of(widget)))
        if what == "table":
            return _cells(widget)
        if what == "date":
            return str(read(widget, "date").toString(ISO))
        names = {"enabled": "enabled" if hasattr(widget, "enabled") else "isEnabled"}
        names |= {"visible": "visible" if hasattr(widget, "visible") else "isVisible"}
        names |= {"checked": "checked" if hasattr(widget, "checked") else "isChecked"}
        names |= {"tip": "toolTip", "html": "toHtml"}
        return read(widget, names.get(what, what))

    def set(self, name: str, what: str, value: Any) -> None:
        """Set a property of a widget without causing an event."""
        widget = self.widget(name)
        with silenced(widget):
            special = getattr(self, f"_set_{what}", None)
            if special is not None:
                special(widget, value)
            else:
                getattr(widget, f"set{what.capitalize()}")(value)

    def _set_items(self, widget: Any, items: Sequence[str]) -> None:
        if hasattr(widget, "setItemText"):
            kept = int(read(widget, "currentIndex"))
            widget.clear()
            widget.addItems(list(items))
            widget.setCurrentIndex(min(max(kept, 0), len(items) - 1))
            return
        while int(read(widget, "count")) > len(items):
            widget.takeItem(len(items))
        for place, text in enumerate(items):
            if place >= int(read(widget, "count")):
                widget.addItem(text)
            item = widget.item(place)
            item.setText(text)
            item.setToolTip(text)

    def _set_index(self, widget: Any, index: int) -> None:
        if hasattr(widget, "rowCount"):
            widget.selectRow(index) if index >= 0 else widget.clearSelection()
        elif hasattr(widget, "setCurrentRow"):
            widget.setCurrentRow(index)
        else:
            widget.setCurrentIndex(index)

    def _chosen_row(self, widget: Any) -> int:
        indexes = list(read(widget.selectionModel(), "selectedIndexes"))
        if indexes:
            return int(read(indexes[0], "row"))
        return -1

    def _set_table(self, widget: Any, table: Table) -> None:
        kept = self._chosen_row(widget)
        widget.setColumnCount(len(table.columns))
        widget.setHorizontalHeaderLabels([_head(column) for column in table.columns])
        widget.setRowCount(len(table.rows))
        for row, cells in enumerate(table.rows):
            alert = table.alerts[row] if row < len(table.alerts) else ""
            for column, text in enumerate(cells):
                item = self.kit.QTableWidgetItem((ALERT if alert and not column else "") + text)
                item.setToolTip(alert or text)
                self._paint(item, alert=bool(alert), stale=table.stale)
                widget.setItem(row, column, item)
        widget.resizeColumnsToContents()
        widest = WIDEST_COLUMN if len(table.columns) > 3 else 2 * WIDEST_COLUMN
        for column in range(len(table.columns) - 1):
            if int(widget.columnWidth(column)) > widest:
                widget.setColumnWidth(column, widest)
        if 0 <= kept < len(table.rows):
            widget.selectRow(kept)

    def _paint(self, item: Any, *, alert: bool, stale: bool) -> None:
        if alert:
            item.setBackground(self.kit.QBrush(self.kit.QColor("#fff3cf")))
            item.setForeground(self.kit.QBrush(self.kit.QColor("#5a4200")))
        if stale:
            item.setForeground(self.kit.QBrush(self.kit.QColor("#808080")))
            font = self.kit.QFont(read(item, "font"))
            font.setItalic(True)
            item.setFont(font)

    def _set_html(self, widget: Any, html: str) -> None:
        widget.setHtml(html)
        # As high as the messages, up to the height that the .ui allows.
        document = read(widget, "document")
        document.setTextWidth(max(300, int(read(self.root, "width")) - 40))
        wanted = int(read(document, "size").height()) + 8
        widget.setFixedHeight(max(40, min(wanted, BANNER_HEIGHT)))

    def _set_date(self, widget: Any, iso: str) -> None:
        widget.setDate(self.kit.QDate.fromString(iso, ISO))

    def _set_tip(self, widget: Any, text: str) -> None:
        widget.setToolTip(text)

    def _set_mark(self, widget: Any, message: str) -> None:
        name = str(read(widget, "objectName"))
        tip = self._tips.setdefault(name, str(read(widget, "toolTip")))
        widget.setToolTip(message or tip)
        widget.setStyleSheet(f"#{name} {{ border: 2px solid #b3151c; }}" if message else "")

    def _set_picture(self, widget: Any, content: bytes) -> None:
        pixmap = self.kit.QPixmap()
        if content:
            pixmap.loadFromData(self.kit.QByteArray(content))
        if not pixmap.isNull():
            # A label on a page that was never shown has no width yet, but the least one.
            room = max(int(read(widget, "minimumWidth")), int(read(widget, "width"))) - 4
            width = min(room, int(read(pixmap, "width")))
            pixmap = pixmap.scaledToWidth(width, self.kit.Qt.SmoothTransformation)
        widget.setPixmap(pixmap)

    # ------------------------------------------------------------ dialogs

    def ask_file(self, title: str, kinds: str) -> str:
        """A file that exists, or an empty text."""
        return _path(self.kit.QFileDialog.getOpenFileName(self.root, title, "", kinds))

    def ask_folder(self, title: str) -> str:
        """A folder that exists, or an empty text."""
        return _path(self.kit.QFileDialog.getExistingDirectory(self.root, title))

    def ask_new_file(self, title: str, name: str, kinds: str) -> str:
        """Where to save, or an empty text."""
        return _path(self.kit.QFileDialog.getSaveFileName(self.root, title, name, kinds))

    def ask(self, title: str, question: str, answers: Sequence[str]) -> int:
        """Which of the answers; the last one where the question was closed."""
        box = self.kit.QMessageBox(self.root)
        box.setWindowTitle(title)
        box.setText(question)
        roles = self.kit.QMessageBox
        buttons = [box.addButton(text, roles.ActionRole) for text in answers[:-1]]
        buttons.append(box.addButton(answers[-1], roles.RejectRole))
        box.exec_() if hasattr(box, "exec_") else box.exec()
        clicked = read(box, "clickedButton")
        return buttons.index(clicked) if clicked in buttons else len(answers) - 1


def _head(column: str) -> str:
    """A column's head with its unit below it."""
    for unit in (" mm", " deg", " °"):
        if column.endswith(unit):
            return f"{column.removesuffix(unit)}\n{unit.strip()}"
    return column


def _index_of(widget: Any) -> str:
    return "currentRow" if hasattr(widget, "currentRow") else "currentIndex"


def _path(given: Any) -> str:
    """PySide6 gives the path and the filter, PythonQt the path."""
    return str(given[0] if isinstance(given, tuple) else given or "")


def _cells(widget: Any) -> list[list[str]]:
    rows, columns = int(read(widget, "rowCount")), int(read(widget, "columnCount"))
    found = []
    for row in range(rows):
        items = [widget.item(row, column) for column in range(columns)]
        cells = ["" if item is None else str(read(item, "text")) for item in items]
        found.append([cell.removeprefix(ALERT) for cell in cells])
    return found
