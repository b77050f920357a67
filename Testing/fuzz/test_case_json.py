"""Any JSON at all in place of a case, a layout or a fixator is refused as such or read soundly."""

from __future__ import annotations

import copy
import json
import runpy
from pathlib import Path

import pytest
from hexafix.case import case_from_document
from hexafix.errors import InputError
from hexafix.hardware.definition import fixator_from_document
from hexafix.strict_json import parse_json_object
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

FUZZ = runpy.run_path(str(Path(__file__).with_name("json_fuzz.py")))
SEEDS = FUZZ["json_seeds"]()
CASES = sorted(name for name, (kind, _) in SEEDS.items() if kind == "case")

scalars = st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20)
values = st.recursive(
    scalars,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=8), inner),
    max_leaves=8,
)
relaxed = settings(
    max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)


def places(node, path=()):
    """Paths to everything within a document."""
    keys = node if isinstance(node, dict) else range(len(node)) if isinstance(node, list) else ()
    for key in keys:
        yield (*path, key)
        yield from places(node[key], (*path, key))


def with_value(content, path, value):
    content = copy.deepcopy(content)
    node = content
    for key in path[:-1]:
        node = node[key]
    node[path[-1]] = value
    return content


@pytest.mark.parametrize("name", sorted(SEEDS))
def test_the_seeds_themselves_are_read(name, tmp_path):
    kind, content = SEEDS[name]
    assert FUZZ["read"](kind, json.dumps(content).encode(), tmp_path) is None


@relaxed
@given(st.binary(max_size=200))
def test_bytes_are_refused_or_an_object(raw):
    try:
        assert isinstance(parse_json_object(raw, what="case file", where="case.json"), dict)
    except InputError:
        return


@relaxed
@given(name=st.sampled_from(CASES), value=values, data=st.data())
def test_any_value_anywhere_in_a_case_is_refused_or_read_soundly(name, value, data, tmp_path):
    content = SEEDS[name][1]
    path = data.draw(st.sampled_from(list(places(content))))
    raw = json.dumps(with_value(content, path, value)).encode()
    try:
        assert FUZZ["read"]("case", raw, tmp_path) is None
    except InputError:
        return


@relaxed
@given(value=values, data=st.data())
def test_any_value_anywhere_in_a_fixator_is_refused_or_read_soundly(value, data):
    content = SEEDS["fixator"][1]
    path = data.draw(st.sampled_from(list(places(content))))
    try:
        fixator = fixator_from_document(with_value(content, path, value))
        assert FUZZ["_why_fixator_wrong"](fixator) is None
    except InputError:
        return


@relaxed
@given(st.lists(st.floats(allow_nan=False) | st.integers() | st.text(max_size=8), max_size=8))
def test_strut_readings_are_six_numbers_within_the_stroke_or_refused(readings):
    content = with_value(SEEDS["target-pose"][1], ("strut_readings_mm",), readings)
    raw = json.dumps(content).encode()
    try:
        case = case_from_document(raw, folder=Path(), needs_image=False)
    except InputError:
        return
    strut = case.fixator.strut
    assert case.strut_readings_mm.shape == (6,)
    lengths = case.strut_readings_mm + strut.scale_offset_mm
    assert lengths.min() >= strut.min_mm - 1e-9
    assert lengths.max() <= strut.max_mm + 1e-9


@pytest.mark.parametrize("number", [1e154, -1e300, 1.0000001e5, 10**400])
def test_a_joint_beyond_all_sense_is_refused_without_a_warning(number):
    content = with_value(SEEDS["fixator"][1], ("proximal", "joints_mm", 0, 0), number)
    with pytest.raises(InputError, match="sensible size"):
        fixator_from_document(content)
