import csv
import io
import json

import numpy as np
import pytest
from hexafix.errors import HexaFixError
from hexafix.report.format import (
    format_margin,
    format_measure,
    format_number,
    format_reading,
    format_setting,
    step_decimals,
)
from hexafix.report.tables import markers_mrk_json, schedule_csv


def test_the_schedule_file_is_exact_and_ends_its_lines_with_lf(a_plan):
    text = schedule_csv(a_plan)
    lines = text.decode("ascii").split("\n")
    assert b"\r" not in text
    assert lines[0] == (
        "day,date,adjustment,strut_1_mm,strut_2_mm,strut_3_mm,strut_4_mm,strut_5_mm,strut_6_mm"
    )
    assert lines[1] == "0,2026-12-01,0,176.7,166.0,158.0,156.3,150.4,174.5"
    assert lines[2].startswith("1,2026-12-01,1,")
    assert lines[6].startswith("2,2026-12-02,1,")
    assert lines[-1] == ""
    assert len(lines) == 1 + 1 + 48 + 1


def test_the_schedule_file_reads_back_to_the_plan(a_plan):
    rows = list(csv.DictReader(io.StringIO(schedule_csv(a_plan).decode())))
    for row, wanted in zip(rows, a_plan["schedule"]["rows"], strict=True):
        assert (int(row["day"]), row["date"]) == (wanted["day"], wanted["date"])
        assert [float(row[f"strut_{n}_mm"]) for n in range(1, 7)] == wanted["strut_mm"]


def test_the_turns_of_every_strut_add_up_to_its_whole_change(a_plan):
    rows = list(csv.reader(io.StringIO(schedule_csv(a_plan).decode())))[1:]
    table = np.array([row[3:] for row in rows], float)
    wanted = np.array(a_plan["schedule"]["rows"][-1]["strut_mm"]) - table[0]
    np.testing.assert_allclose(np.diff(table, axis=0).sum(0), wanted, atol=1e-9)


def test_a_reading_keeps_all_its_decimals_and_a_setting_those_of_the_step():
    assert format_reading(190.25, 0.5) == "190.25"
    assert format_reading(190.0, 0.5) == "190.0"
    assert format_reading(190.0, 1.0) == "190"
    assert format_setting(190.0, 0.25) == "190.00"
    assert format_setting(0.1 * 1903, 0.1) == "190.3"


@pytest.mark.parametrize(("step", "decimals"), [(1.0, 0), (0.5, 1), (0.25, 2), (0.1, 1), (10, 0)])
def test_the_step_decides_the_decimals(step, decimals):
    assert step_decimals(step) == decimals


def test_a_setting_off_the_step_is_refused():
    with pytest.raises(HexaFixError, match="multiple"):
        format_setting(190.2, 0.5)


def test_numbers_never_show_a_negative_zero_and_keep_their_zeros():
    assert format_number(-0.0004, 3) == "0.000"
    assert format_number(-0.0006, 3) == "-0.001"
    assert format_number(162.0, 1) == "162.0"
    assert format_measure(2.2e-16) == "2.2e-16"
    assert format_measure(0.0) == "0"
    assert format_measure(None) == "-"


@pytest.mark.parametrize(
    ("margin", "text"), [(17.78, "17.8"), (25.926, "25.9"), (4.96, "4.960"), (0.0, "0.000")]
)
def test_a_margin_has_hundredths_only_where_a_limit_is_near(margin, text):
    assert format_margin(margin) == text


def test_the_markups_hold_every_ball_with_number_place_and_ring(a_plan):
    file = json.loads(markers_mrk_json(a_plan))
    assert file["@schema"].endswith("markups-schema-v1.0.3.json#")
    (markup,) = file["markups"]
    assert markup["type"] == "Fiducial"
    assert markup["coordinateSystem"] == "LPS"
    assert markup["coordinateUnits"] == "mm"
    assert len(markup["controlPoints"]) == len(a_plan["balls"]) == 7
    for point, ball in zip(markup["controlPoints"], a_plan["balls"], strict=True):
        assert point["label"] == point["id"] == str(ball["number"])
        assert point["position"] == ball["center_mm"]
        assert ball["ring"] in point["description"]
        assert point["positionStatus"] == "defined"
        assert len(point["orientation"]) == 9


def test_the_markups_come_by_number_whatever_the_order_of_the_balls(a_plan):
    forward = markers_mrk_json(a_plan)
    a_plan["balls"].reverse()
    assert markers_mrk_json(a_plan) == forward
