"""No screen shows a key of the case file: places are told in plain words."""

import json
import re
import types
import typing

import pytest
from hexafix.case.schema import EditedCaseFile
from hexafix.errors import Fault, InputError
from hexafix.presenter import Presenter, Step, notices
from hexafix.presenter.places import place_words, plain_text
from pydantic import BaseModel

KEY = re.compile(r"[a-z]_[a-z]|\[[0-9]+\]|[a-z]\.[a-z]|“")
"""What only an internal name has: underscores, indices, dotted names."""

TABLES = ("fixator", "limb", "image", "markers", "numbering", "correction", "schedule")


def paths(kind, path):
    """Every path of the case file's schema, one row of each list."""
    yield path
    origin, given = typing.get_origin(kind), typing.get_args(kind)
    if origin is typing.Annotated:
        yield from paths(given[0], path)
    elif origin in (typing.Union, types.UnionType):
        for one in given:
            yield from paths(one, path)
    elif origin is list:
        yield from paths(given[0], f"{path}[1]")
    elif origin is dict and path == "numbering":
        yield from paths(given[1], f"{path}.3")
    elif isinstance(kind, type) and issubclass(kind, BaseModel):
        for name, field in kind.model_fields.items():
            yield from paths(field.annotation, f"{path}.{name}" if path else name)


ALL = sorted(set(paths(EditedCaseFile, "")) - {"", "schema_version"})


def test_every_place_of_the_case_file_has_plain_words():
    assert len(ALL) > 60
    told = {path: place_words(path) for path in ALL}
    assert [path for path, words in told.items() if not words or KEY.search(words)] == []
    assert len(set(told.values())) > 50


@pytest.mark.parametrize(
    ("where", "words"),
    [
        ("limb.side", "side of the limb"),
        ("strut_readings_mm[2]", "strut readings, strut 3"),
        ("numbering.7", "numbering, number 7"),
        # a row's place is not the number of its marker, and must not read like one (H19)
        ("markers.distal[0].sweep_deg", "layout of the distal ring, row 1, sweep"),
        ("distal[0].number", "layout of the distal ring, row 1, number"),
        ("correction.origin_lps_mm[1]", "origin of the deformity, P"),
        ("correction.position_mm[1]", "target pose, position, y"),
        ("schedule.structures_at_risk_lps_mm[0][2]", "structures at risk, point 1, S"),
        ("fixator.distal.joints_mm[3]", "fixator, distal ring, joints, joint 4"),
        ("frame.json.strut.min_mm", "frame.json, fixator, struts, shortest length"),
        ("frame.json", "frame.json"),
        ("case.json", "case file"),
        ("NRRD header", "NRRD header"),
        ("strut 3", "strut 3"),
        # what the user has written himself is told by its name
        ("markers.proximal[1].colour", "layout of the proximal ring, row 2, entry “colour”"),
        ("colour", "entry “colour”"),
        ("--token", ""),
        (None, ""),
    ],
)
def test_a_place_is_told_in_the_words_of_the_screen(where, words):
    assert place_words(where) == words


def test_keys_inside_a_text_are_told_in_words_and_ordinary_words_stay():
    text = "the marker number stands at markers.proximal[1].number too"
    assert plain_text(text) == (
        "the marker number stands at layout of the proximal ring, row 2, number too"
    )
    for words in ("the image. Numbering the markers", "limb side", "/data/limb.side.nrrd", "1.2.3"):
        assert plain_text(words) == words


def test_a_banner_tells_its_place_once_and_keeps_its_hazard():
    shown = notices.banner(notices.SIDE_ASKED, kind="info", step=Step.EXPORT)
    assert shown.message == "say the side of the limb a second time"
    shown = notices.banner(notices.side_conflict("left", "right"), kind="refused", step=Step.LOAD)
    assert shown.message.endswith("in the case (value left, limit right), at: side of the limb")
    assert shown.hazard == "H37"
    fault = Fault("too-fast", "it is too fast", "3", "2", "slower", "H35", "schedule")
    assert notices.banner(fault, kind="error", step=Step.SCHEDULE).message == (
        "it is too fast (value 3, limit 2)"
    )
    assert notices.banner(fault, kind="error").message.endswith(", at: schedule")
    assert notices.line_of(fault).endswith("at: schedule. Next step: slower")


def test_two_places_with_one_message_are_two_banners():
    faults = [Fault("wrong", "it is wrong", where=f"markers.{ring}") for ring in ("distal", "x")]
    assert len({notices.banner(fault, kind="error").id for fault in faults}) == 2


WRONG = {
    "case_id": "a/b",
    "limb": {"side": "middle", "bone": "femur"},
    "image": {"path": "ct.txt", "series": 1},
    "numbering": {"99": [0.0, 0.0, 0.0]},
    "strut_readings_mm": [180.0, 175.0, 167.0, 168.0, 157.0, 999.0],
    "correction": {"kind": "deformity", "ap_angulation_deg": 5.0},
    "schedule": {"start_date": "soon", "strut_step_mm": -1.0},
    "marker_edits": {"added_lps_mm": [[0.0, 0.0]]},
    "fixator": "no-such-frame",
}


@pytest.mark.parametrize("key", [*WRONG, "markers"])
def test_no_key_of_the_case_file_is_on_screen_whatever_is_wrong(tmp_path, a_case, an_engine, key):
    (tmp_path / "ct.txt").write_text("one image")
    a_case["schema_version"] = 2
    if key == "markers":
        a_case["markers"]["proximal"][1] |= {"number": 1, "sweep_deg": "far"}
        a_case["markers"]["distal"][0]["number"] = 1
    else:
        a_case[key] = WRONG[key]
    file = tmp_path / "case.json"
    file.write_text(json.dumps(a_case))
    presenter = Presenter(engine=an_engine, threaded=False)
    presenter.open_case(file)
    presenter.run_all()
    snapshot = presenter.snapshot
    presenter.close()
    told = [text for b in snapshot.banners for text in (b.title, b.message, b.next_step)]
    told += [view.summary for view in snapshot.steps] + [snapshot.export_blocked_by]
    assert any(banner.kind == "error" for banner in snapshot.banners)
    own = {"series": "“series”"}.get({"image": "series"}.get(key, ""), "")
    assert [text for text in told if KEY.search(text.replace(own, ""))] == []


def test_an_error_of_a_field_is_an_error_with_words(a_presenter):
    error = InputError.of("not-a-number", "no number", where="strut_readings_mm[0]")
    assert notices.line_of(error.faults[0]) == "no number, at: strut readings, strut 1"
