import copy
import io
import json
import shutil
import subprocess
import sys
from decimal import Decimal

import pypdf
import pytest
from hexafix.errors import HexaFixError, InputError
from hexafix.report.pdf import prescription_pdf
from hexafix.report.printed import (
    printed_rows,
    printed_schedule_rows,
    printed_table_rows,
    rows_missing,
)
from hexafix.report.surgeon import plan_fingerprint


def _pages(pdf):
    return [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(pdf)).pages]


@pytest.fixture(scope="module")
def printed(_short_plan):
    return prescription_pdf(_short_plan)


@pytest.fixture(scope="module")
def pages(printed):
    return _pages(printed)


@pytest.fixture(scope="module")
def long_pages(a_long_plan):
    return _pages(prescription_pdf(a_long_plan))


def test_every_row_of_the_plan_is_in_the_text_and_in_order(a_plan, pages):
    rows = printed_rows(a_plan)
    assert len(rows) > 48 + 12 + 60
    assert rows_missing("\n".join(pages), rows) == []


def test_a_long_plan_prints_every_one_of_its_240_adjustments_in_order(a_long_plan, long_pages):
    rows = printed_schedule_rows(a_long_plan)
    assert sum(len(row) == 16 and row[2] == "of" for row in rows) == 240
    assert rows_missing("\n".join(long_pages), rows) == []


@pytest.mark.parametrize("per_day", [1, 6])
def test_any_number_of_adjustments_a_day_can_be_printed(per_day, make_plan):
    plan = make_plan(days=5, per_day=per_day, step=1.0)
    text = "\n".join(_pages(prescription_pdf(plan)))
    assert rows_missing(text, printed_rows(plan)) == []


def test_the_values_of_schedule_rows_stand_in_the_text_beside_their_count(a_plan, pages):
    words = " ".join(pages).split()
    row = a_plan["schedule"]["rows"][30]
    values = [f"{value:.1f}" for value in row["strut_mm"]]
    starts = [
        k for k in range(len(words)) if words[k : k + 3] == [str(row["adjustment"]), "of", "4"]
    ]
    after = [[w for w in words[k + 3 : k + 15] if w[0].isdigit()] for k in starts]
    assert values in after


def test_a_changed_number_is_noticed(a_plan, pages):
    text = "\n".join(pages)
    for change in (
        lambda plan: plan["schedule"]["rows"][17]["strut_mm"].__setitem__(3, 100.5),
        lambda plan: plan["mechanism"]["position_mm"].__setitem__(2, 172.401),
        lambda plan: plan["balls"][4]["center_mm"].__setitem__(0, 1.0),
        lambda plan: plan["gates"][3].__setitem__("value", 9.0),
    ):
        other = copy.deepcopy(a_plan)
        change(other)
        assert rows_missing(text, printed_rows(other))


def test_rows_in_the_wrong_order_are_noticed(a_plan, pages):
    rows = printed_schedule_rows(a_plan)
    rows[10], rows[11] = rows[11], rows[10]
    assert rows_missing("\n".join(pages), rows)


def test_case_side_bone_and_approval_stand_on_every_page(a_plan, pages):
    for number, page in enumerate(pages, 1):
        words = " ".join(page.split())
        assert "LEFT TIBIA" in words
        assert "Case left-tibia-01" in words
        assert "NOT APPROVED" in words
        assert "Not a medical device" in words
        assert f"Page {number} of {len(pages)}" in words
        assert plan_fingerprint(a_plan)[:16] in words


def test_the_other_side_is_named_on_every_page(long_pages):
    for page in long_pages:
        assert "RIGHT FEMUR" in page
        assert "LEFT FEMUR" not in page


def test_the_table_head_repeats_on_every_page_of_the_table(long_pages):
    pages = [page for page in long_pages if "1 of 4" in page]
    assert len(pages) > 5
    heads = [" ".join(page.split()) for page in pages]
    assert all("1 shorter 2 longer 3 longer 4 longer 5 longer 6 shorter" in head for head in heads)


def test_a_restless_plan_keeps_the_phone_numbers_on_the_first_page(a_plan):
    for k, row in enumerate(a_plan["schedule"]["rows"][1:]):
        row["strut_mm"] = [160.0 + (8.0 if 10 < k < 30 else 0.5 * n) for n in range(6)]
    a_plan["limb"]["bone"] = "proximal tibia and fibula shaft"
    a_plan["case_id"] = "A" + "b-4_" * 15 + "xyz"
    a_plan["notice"] = "Research software. Not a medical device. " + "Long notice words. " * 4
    pages = _pages(prescription_pdf(a_plan))
    assert "Phone at night" in pages[0]
    for page in pages:
        assert a_plan["case_id"] in page
        assert "LEFT PROXIMAL TIBIA AND FIBULA SHAFT" in page


def test_the_six_parameters_of_a_deformity_are_printed_with_their_sense(a_plan):
    a_plan["case"]["correction"] = {
        "kind": "deformity",
        "moving": "distal",
        "origin_lps_mm": [1.0, 2.0, 3.0],
        "ap_angulation_deg": 8.5,
        "ap_angulation": "varus",
        "axial_translation_mm": 12.0,
        "axial_translation": "short",
    }
    text = " ".join(" ".join(_pages(prescription_pdf(a_plan))).split())
    assert "AP angulation 8.500 ° varus" in text
    assert "axial translation 12.00 mm short" in text
    assert "at the origin L, P, S = 1.000, 2.000, 3.000 mm" in text


def test_warnings_of_image_and_balls_are_printed(a_plan):
    a_plan["image"]["warnings"] = ["slices are 3.0 mm apart"]
    a_plan["balls"][2]["warnings"] = ["5 % of its voxels are clipped"]
    text = " ".join(" ".join(_pages(prescription_pdf(a_plan))).split())
    assert "slices are 3.0 mm apart" in text
    assert "Ball 3: 5 % of its voxels are clipped" in text


def test_no_day_is_torn_apart_by_a_page(long_pages):
    for page in long_pages:
        assert page.count("1 of 4") == page.count("4 of 4")


def test_the_same_plan_gives_the_same_bytes_also_in_another_process(a_plan, printed, tmp_path):
    assert prescription_pdf(a_plan) == printed
    (tmp_path / "plan.json").write_text(json.dumps(a_plan), "utf-8")
    script = (
        "import json,sys;from hexafix.report.pdf import prescription_pdf as p;"
        "sys.stdout.buffer.write(p(json.load(open(sys.argv[1],encoding='utf-8'))))"
    )
    command = [sys.executable, "-c", script, str(tmp_path / "plan.json")]
    assert subprocess.run(command, capture_output=True, check=True).stdout == printed


def test_the_file_is_dated_by_the_plan_and_names_the_case(printed):
    information = pypdf.PdfReader(io.BytesIO(printed)).metadata
    assert information is not None
    assert information.creation_date is not None
    assert information.creation_date.date().isoformat() == "2026-12-01"
    assert information.title == "Prescription left-tibia-01, LEFT TIBIA"


def test_the_pdf_claims_archive_and_accessibility_and_says_its_language(printed):
    reader = pypdf.PdfReader(io.BytesIO(printed))
    root = reader.trailer["/Root"]
    metadata = root["/Metadata"].get_data().decode("utf-8")
    assert "<pdfaid:part>3</pdfaid:part>" in metadata
    assert "<pdfaid:conformance>A</pdfaid:conformance>" in metadata
    assert "<pdfuaid:part>1</pdfuaid:part>" in metadata
    assert root["/Lang"] == "en"


def _figures(element, found):
    element = element.get_object()
    if isinstance(element, list):
        for child in element:
            _figures(child, found)
    elif isinstance(element, dict):
        if element.get("/S") == "/Figure":
            found.append(element.get("/Alt"))
        if "/K" in element:
            _figures(element["/K"], found)
    return found


def test_every_figure_has_an_alternative_text(printed):
    root = pypdf.PdfReader(io.BytesIO(printed)).trailer["/Root"]
    texts = _figures(root["/StructTreeRoot"]["/K"], [])
    assert len(texts) == 7
    assert all(isinstance(text, str) and len(text) > 30 for text in texts)


def test_a_character_without_a_glyph_is_refused_by_name(a_plan):
    a_plan["case_id"] = "左胫骨-01"
    with pytest.raises(InputError) as caught:
        prescription_pdf(a_plan)
    assert caught.value.faults[0].code == "character-not-printable"
    assert caught.value.faults[0].where == "case_id"


def test_letters_of_other_european_scripts_are_printed(a_plan):
    a_plan["case_id"] = "Łódź-Ελλάς-Київ-7"
    assert "Łódź-Ελλάς-Київ-7" in _pages(prescription_pdf(a_plan))[0]


def test_words_of_the_template_language_are_inert(a_plan):
    a_plan["case_id"] = "#panic() $x$ *b* _i_"
    assert "#panic() $x$ *b* _i_" in _pages(prescription_pdf(a_plan))[0]


def test_an_unknown_language_is_refused(a_plan):
    with pytest.raises(InputError, match="language"):
        prescription_pdf(a_plan, language="xx")


def test_a_value_off_the_strut_step_is_never_printed(a_plan):
    a_plan["schedule"]["rows"][5]["strut_mm"][2] += 0.1
    with pytest.raises(HexaFixError) as caught:
        prescription_pdf(a_plan)
    assert caught.value.faults[0].hazard == "H43"


def test_a_number_that_is_not_finite_is_never_printed(a_plan):
    a_plan["rings"]["distal"]["position_mm"][0] = float("nan")
    with pytest.raises(InputError) as caught:
        prescription_pdf(a_plan)
    assert caught.value.faults[0].hazard == "H55"


def test_the_final_values_and_the_whole_change_are_printed(a_plan, pages):
    text = " ".join(" ".join(pages).split())
    rows = a_plan["schedule"]["rows"]
    for number, (first, last) in enumerate(
        zip(rows[0]["strut_mm"], rows[-1]["strut_mm"], strict=True), 1
    ):
        change = abs(Decimal(str(last)) - Decimal(str(first)))
        word = "longer" if last > first else "shorter"
        assert f"{number} {first} {last} {change} {word}" in text


def test_gates_hashes_and_versions_are_among_the_printed_rows(a_plan):
    rows = printed_table_rows(a_plan)
    assert ("case", "a" * 64) in rows
    assert ("HexaFix", "0.1.0") in rows
    assert ("plan", plan_fingerprint(a_plan)) in rows
    assert any(row[:2] == ("G7", "uniqueness") and "9.400" in row for row in rows)


def test_no_field_outside_the_report_reaches_the_text(a_plan):
    a_plan["case"]["image"]["series_instance_uid"] = "1.2.840.99999.SECRET"
    a_plan["case"]["image"]["path"] = "/home/doejohn"
    text = "\n".join(_pages(prescription_pdf(a_plan)))
    assert "SECRET" not in text
    assert "doejohn" not in text


@pytest.mark.parametrize("tool", ["qpdf", "pdffonts"])
def test_other_pdf_programs_find_no_fault(tool, printed, tmp_path):
    program = shutil.which(tool)
    if program is None:
        pytest.skip(f"{tool} is not installed")
    path = tmp_path / "prescription.pdf"
    path.write_bytes(printed)
    command = [program, "--check", str(path)] if tool == "qpdf" else [program, str(path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    if tool == "pdffonts":
        fonts = [line.split() for line in done.stdout.splitlines()[2:]]
        assert len(fonts) >= 2
        # name, type (two words), encoding, emb, sub, uni: embedded and readable as text.
        assert all(font[-5:-2] == ["yes", "yes", "yes"] for font in fonts)
