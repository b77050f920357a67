import numpy as np
import pytest
from hexafix.report import words
from hexafix.report.patient import (
    day_blocks,
    direction,
    long_date,
    paginate,
    patient_content,
    strut_summary,
    whole_direction,
)


def test_the_direction_word_follows_the_sign(a_plan):
    rows = a_plan["schedule"]["rows"]
    change = np.subtract(rows[-1]["strut_mm"], rows[0]["strut_mm"])
    assert np.any(change > 0)
    assert np.any(change < 0)
    for entry, value in zip(strut_summary(a_plan), change, strict=True):
        assert entry["overall"] == ("longer" if value > 0 else "shorter")
        assert entry["arrow"] == ("▲" if value > 0 else "▼")
        assert entry["change"] == f"{abs(value):.1f}"


def test_every_single_arrow_follows_the_sign_of_its_own_turn(a_plan):
    rows = a_plan["schedule"]["rows"]
    cells = [row["cells"] for block in day_blocks(a_plan) for row in block["rows"]]
    signs = {"▲": 1, "▼": -1, "=": 0}
    for before, after, printed in zip(rows, rows[1:], cells, strict=False):
        wanted = np.sign(np.subtract(after["strut_mm"], before["strut_mm"]))
        assert [signs[arrow] for _, arrow in printed] == wanted.tolist()
    assert len(cells) == 48


@pytest.mark.parametrize(
    ("values", "word"),
    [
        (["1.0", "1.5", "1.5", "2.0"], "longer"),
        (["2.0", "1.5"], "shorter"),
        (["2.0", "2.0"], "no change"),
        (["1.0", "2.0", "1.0"], "first longer, then shorter"),
        (["1.0", "3.0", "1.0", "3.0"], "both ways, see arrows"),
        (["1.0", "2.0", "1.5", "3.0", "2.5", "4.0"], "mostly longer"),
        (["4.0", "3.0", "3.5", "2.0"], "mostly shorter"),
        (["4.0", "3.0", "4.0", "2.0", "3.0"], "both ways, see arrows"),
        (["9.5", "11.0", "9.5", "9.0"], "first longer, then shorter"),
    ],
)
def test_the_whole_direction_names_a_turning_point(values, word):
    assert whole_direction(values, 0.5) == word


def test_values_are_compared_as_numbers_not_as_words():
    assert direction("99.5", "100.0") == words.LONGER
    assert direction("100.0", "99.5") == words.SHORTER


def test_the_times_of_day_fit_the_number_of_adjustments():
    assert [words.time_of_day(n, 4) for n in (1, 2, 3, 4)] == [
        "morning",
        "noon",
        "evening",
        "night",
    ]
    assert [words.time_of_day(n, 2) for n in (1, 2)] == ["morning", "evening"]
    assert words.time_of_day(5, 6) == "turn"


def test_days_stay_whole_on_a_page_and_none_is_lost(a_long_plan):
    blocks = day_blocks(a_long_plan)
    pages = paginate(blocks)
    assert [block for page in pages for block in page] == blocks
    assert all(sum(len(block["rows"]) + 1 for block in page) <= 32 for page in pages)
    assert [block["day"] for block in blocks] == [str(n) for n in range(1, 61)]


def test_the_date_is_english_over_new_year_and_leap_day():
    from datetime import date

    assert long_date(date(2028, 2, 29)) == "Tuesday 29 February 2028"
    assert long_date(date(2027, 1, 1)) == "Friday 1 January 2027"


def test_the_facts_count_the_plan(a_plan):
    facts = dict(patient_content(a_plan)["facts"])
    assert facts["First day"] == "Tuesday 1 December 2026"
    assert facts["Last day"] == "Saturday 12 December 2026"
    assert facts["In all"] == "12 days, 48 adjustments"
    assert facts["Each day"] == "4 adjustments: morning, noon, evening, night"


@pytest.mark.parametrize(
    ("bone", "word"), [("tibia", "toes"), ("humerus", "fingers"), ("pelvis", "fingers or toes")]
)
def test_the_warning_signs_speak_of_the_right_limb(bone, word):
    assert word in words.warning_signs(bone)[0]


def test_no_instruction_uses_a_bare_sign_for_a_direction():
    lines = [*words.adjustment_steps(4), *words.MISSED, words.DONE_TWICE]
    assert not any("+" in line or "−" in line for line in lines)


def test_a_strut_that_goes_both_ways_has_no_single_direction_in_its_head(a_plan):
    for k, row in enumerate(a_plan["schedule"]["rows"]):
        row["strut_mm"][1] = 166.0 + (10.0 if 10 < k < 20 else 0.0)
        row["strut_mm"][2] = 160.0 + 0.5 * (k % 2) + 0.5 * (k // 2)
    entries = strut_summary(a_plan)
    assert (entries[1]["head"], entries[1]["arrow"]) == ("see arrows", "▲▼")
    assert entries[1]["direction"] == "first longer, then shorter"
    assert entries[0]["head"] == "shorter"
    assert entries[2]["head"] == "longer"
