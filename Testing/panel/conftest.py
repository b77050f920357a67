"""A panel on widgets that are plain values."""

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

UI = Path(__file__).resolve().parents[2] / "Resources" / "UI" / "HexaFixModule.ui"


class PlainWidgets:
    """What a user sees and does, without a toolkit."""

    def __init__(self):
        self.values = {}
        self.callbacks = {}
        self.answers = []
        self.asked = []
        self.paths = []
        self.timer = None

    def get(self, name, what):
        if what == "table":
            table = self.values.get((name, "table"))
            return [] if table is None else [list(row) for row in table.rows]
        defaults = {"text": "", "index": -1 if name.endswith("Table") else 0, "checked": False}
        return self.values.get((name, what), defaults.get(what))

    def set(self, name, what, value):
        self.values[name, what] = value

    def connect(self, name, event, callback):
        assert name not in self.callbacks
        self.callbacks[name] = (event, callback)

    def finish(self):
        pass

    def every(self, seconds, callback):
        self.timer = callback

    def ask_file(self, title, kinds):
        return self.paths.pop(0)

    def ask_folder(self, title):
        return self.paths.pop(0)

    def ask_new_file(self, title, name, kinds):
        return self.paths.pop(0)

    def ask(self, title, question, answers):
        self.asked.append(question)
        return self.answers.pop(0)

    # ------------------------------------------------------------ the user

    def type(self, name, text):
        """Type a text and leave the field."""
        self.values[name, "text"] = text
        self._happen(name, "edited", text)

    def begin_typing(self, name, text):
        """Type a text; the field is not left yet."""
        self.values[name, "text"] = text

    def click(self, name):
        assert self.values.get((name, "enabled"), True), f"{name} is greyed"
        self._happen(name, "clicked", None)

    def tick(self, name, on=True):
        self.values[name, "checked"] = on
        self._happen(name, "checked", on)

    def choose(self, name, index):
        self.values[name, "index"] = index
        self._happen(name, "picked", index)

    def fill(self, name, rows):
        """Type rows into a table."""
        from dataclasses import replace

        before = self.values[name, "table"]
        self.values[name, "table"] = replace(before, rows=tuple(tuple(row) for row in rows))
        self._happen(name, "cell", None)

    def choose_row(self, name, index):
        self.values[name, "index"] = index
        event, callback = self.callbacks[name]
        if event == "row":
            callback(index)

    def _happen(self, name, event, value):
        bound, callback = self.callbacks[name]
        assert bound == event, f"{name} is bound to {bound}"
        callback(value)


@pytest.fixture
def widgets():
    return PlainWidgets()


@pytest.fixture
def presenter():
    from hexafix.presenter import Presenter

    made = Presenter(threaded=False)
    yield made
    made.close()


@pytest.fixture
def panel(widgets, presenter):
    from hexafix.panel import Panel

    return Panel(widgets, presenter)


@pytest.fixture
def document(presenter):
    """`document(*keys)`: a value of the case document."""

    def read(*keys):
        value = presenter.snapshot.document
        for key in keys:
            value = value[key]
        return value

    return read


@pytest.fixture(scope="session")
def ui_classes():
    """Class of each widget of the .ui by object name."""
    return {w.get("name"): w.get("class") for w in ET.parse(UI).iter("widget")}


@pytest.fixture(scope="session")
def ui_tree():
    return ET.parse(UI)
