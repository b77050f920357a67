"""The .ui file and the table of bindings agree, widget by widget."""

from collections import Counter

import pytest
from hexafix.panel import BINDINGS

INTERACTIVE = {
    *("QPushButton", "QLineEdit", "QComboBox", "QCheckBox", "QSlider", "QSpinBox"),
    *("QDateEdit", "QTableWidget", "QListWidget", "QTextBrowser"),
}

STOCK = INTERACTIVE | {
    *("QWidget", "QLabel", "QGroupBox", "QTabWidget", "QStackedWidget", "QScrollArea"),
    "QProgressBar",
}

EVENTS = {
    "QPushButton": {"clicked", "checked"},
    "QLineEdit": {"edited"},
    "QComboBox": {"picked"},
    "QCheckBox": {"checked"},
    "QSlider": {"moved"},
    "QSpinBox": {"moved"},
    "QDateEdit": {"dated"},
    "QTableWidget": {"", "row", "cell"},
    "QListWidget": {"row"},
    "QTextBrowser": {"link"},
    "QLabel": {""},
    "QProgressBar": {""},
    "QStackedWidget": {""},
}


def test_every_bound_widget_stands_in_the_ui(ui_classes):
    assert {binding.widget for binding in BINDINGS} <= set(ui_classes)


def test_every_widget_that_a_user_can_touch_is_bound(ui_classes):
    bound = {binding.widget for binding in BINDINGS}
    touched = {name for name, kind in ui_classes.items() if kind in INTERACTIVE}
    assert touched - bound == set()


def test_no_widget_is_bound_twice():
    counted = Counter(binding.widget for binding in BINDINGS)
    assert [name for name, count in counted.items() if count > 1] == []


@pytest.mark.parametrize("binding", BINDINGS, ids=lambda binding: binding.widget)
def test_a_widget_is_bound_to_an_event_that_its_class_has(binding, ui_classes):
    assert binding.event in EVENTS[ui_classes[binding.widget]]
    assert bool(binding.event) == (binding.action is not None)


def test_the_ui_has_stock_qt_widgets_only(ui_classes):
    assert set(ui_classes.values()) <= STOCK


def test_object_names_are_unique(ui_tree):
    names = Counter(w.get("name") for w in ui_tree.iter("widget"))
    assert [name for name, count in names.items() if count > 1] == []


def test_every_widget_that_a_user_can_touch_has_a_name_for_screen_readers(ui_tree):
    for widget in ui_tree.iter("widget"):
        if widget.get("class") in INTERACTIVE:
            names = [p for p in widget.findall("property") if p.get("name") == "accessibleName"]
            assert names, widget.get("name")
            assert names[0].findtext("string")


def test_numbers_are_read_in_no_locale_but_c(ui_tree):
    (locale,) = [
        p.find("locale")
        for p in ui_tree.find("widget").findall("property")
        if p.get("name") == "locale"
    ]
    assert locale.get("language") == "C"


def test_a_checkable_button_is_bound_to_being_checked(ui_tree):
    bound = {binding.widget: binding.event for binding in BINDINGS}
    for widget in ui_tree.iter("widget"):
        if widget.get("class") == "QPushButton":
            held = any(p.get("name") == "checkable" for p in widget.findall("property"))
            assert bound[widget.get("name")] == ("checked" if held else "clicked")
