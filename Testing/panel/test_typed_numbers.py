"""Typed numbers are read strictly, and shown so that they read back as they were."""

import math

import pytest
from hexafix.errors import InputError
from hexafix.panel.text import number_of, text_of, whole_of
from hypothesis import given
from hypothesis import strategies as st


@pytest.mark.parametrize(
    ("text", "value"),
    [("12.5", 12.5), (" 7 ", 7.0), ("-3", -3.0), ("\N{MINUS SIGN}3.25", -3.25), ("+0.5", 0.5)],
)
def test_plain_numbers_are_read(text, value):
    assert number_of(text, "x") == value


@pytest.mark.parametrize(
    "text",
    ["", " ", "12,5", "1.250,5", "12 5", "12.5 mm", "1e3", "nan", "inf", "0x10", ".5", "5.", "1_0",
     "١٢", "12½", "--3", "3-"],
)  # fmt: skip
def test_anything_else_is_refused(text):
    with pytest.raises(InputError) as caught:
        number_of(text, "the reading")
    assert caught.value.faults[0].hazard == "H26"
    assert "the reading" in caught.value.faults[0].what


@given(st.floats(-5000, 5000).map(lambda x: round(x, 12)))
def test_a_number_shown_reads_back_as_it_was(value):
    assert math.isclose(number_of(text_of(value), "x"), value, rel_tol=0, abs_tol=1e-14)


@pytest.mark.parametrize("text", ["1.5", "-1", "", "a", "12345"])
def test_a_balls_number_is_a_whole_one(text):
    with pytest.raises(InputError):
        whole_of(text, "Number")
