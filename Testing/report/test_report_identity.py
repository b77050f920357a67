"""The identified prescription: by choice, on each page, inert, reproducible."""

import datetime
import io
import re

import pypdf
import pytest
from hexafix.errors import InputError
from hexafix.imaging.patient_identity import PatientIdentity, PatientName
from hexafix.report.identity import identity_content, visible, written
from hexafix.report.pdf import prescription_pdf
from hexafix.report.printed import printed_rows, rows_missing

ERIKA = PatientIdentity(
    names=(PatientName("Müller", "Erika", "Maria", "Dr.", "PhD"),),
    patient_id="4711-XYZ",
    birth_date=datetime.date(1963, 2, 8),
    study_date=datetime.date(2026, 11, 5),
)
LONGEST = PatientIdentity(
    (PatientName("W" * 64),), "M" * 64, datetime.date(1963, 9, 28), datetime.date(2026, 11, 25)
)


def named(*names, patient_id="7"):
    return PatientIdentity(tuple(names), patient_id, None, None)


def pages_of(pdf):
    return [page.extract_text() for page in pypdf.PdfReader(io.BytesIO(pdf)).pages]


@pytest.fixture(scope="module")
def plan(_short_plan):
    return _short_plan


@pytest.fixture(scope="module")
def identified(plan):
    return prescription_pdf(plan, identity=ERIKA)


def test_name_id_birth_date_and_date_of_the_ct_stand_on_every_page(identified):
    for page in pages_of(identified):
        words = " ".join(page.split())
        assert "Patient Müller, Dr. Erika Maria, PhD" in words
        assert "born 8 February 1963" in words
        assert "ID 4711-XYZ" in words
        assert "CT of 5 November 2026" in words
        assert "IDENTIFIED" in words


def test_a_pseudonymous_prescription_says_so_and_has_a_line_for_the_name(plan):
    pages = pages_of(prescription_pdf(plan))
    assert all("Pseudonymous" in page and "IDENTIFIED" not in page for page in pages)
    assert re.search(r"Patient\s+Date of birth", pages[0])


def test_title_and_metadata_stay_pseudonymous(identified):
    reader = pypdf.PdfReader(io.BytesIO(identified))
    everywhere = str(reader.metadata) + reader.trailer["/Root"]["/Metadata"].get_data().decode()
    for word in ("Müller", "Erika", "4711", "1963"):
        assert word not in everywhere
    assert reader.metadata.title == "Prescription left-tibia-01, LEFT TIBIA"


def test_the_same_identity_gives_the_same_bytes(plan, identified):
    assert prescription_pdf(plan, identity=ERIKA) == identified
    assert prescription_pdf(plan) != identified


def test_every_row_is_still_printed_and_no_day_is_torn_apart(a_long_plan):
    pages = pages_of(prescription_pdf(a_long_plan, identity=LONGEST))
    assert rows_missing("\n".join(pages), printed_rows(a_long_plan)) == []
    assert "Phone at night" in pages[0]
    for page in pages:
        assert page.count("1 of 4") == page.count("4 of 4")


def test_the_longest_name_and_id_stay_inside_the_page(plan):
    page = pypdf.PdfReader(io.BytesIO(prescription_pdf(plan, identity=LONGEST))).pages[1]
    lines = page.extract_text().splitlines()
    assert any("W" * 64 in line for line in lines)
    assert any("M" * 64 in line and "25 November 2026" in line for line in lines)


def test_words_of_the_template_language_stay_words(plan):
    hostile = named(
        PatientName('#read("/etc/passwd")', "$x^2$ *b* _i_", "\\u{41} // /* `"),
        patient_id="#panic() <label> @ref ]}",
    )
    page = " ".join(pages_of(prescription_pdf(plan, identity=hostile))[0].split())
    assert '#read("/etc/passwd"), $x^2$ *b* _i_ \\u{41} // /* `' in page
    assert "ID #panic() <label> @ref ]}" in page


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("Erika\u202eretsuM", "Erika[U+202E]retsuM"),
        ("a\u2066b\u2069", "a[U+2066]b[U+2069]"),
        ("a\x00\x1b[31mb", "a[U+0000][U+001B][31mb"),
        ("zero\u200bwidth", "zero[U+200B]width"),
        ("line\nand\u2028line", "line[U+000A]and[U+2028]line"),
        ("  many   spaces\u00a0here ", "many spaces here"),
        ("e\u0301\u0302\u0303\u0304", "e\u0301\u0302\u0303[U+0304]"),
        ("\ue000\ud800", "[U+E000][U+D800]"),
    ],
)
def test_what_hides_or_reorders_letters_is_shown_by_its_number(text, shown):
    assert visible(text) == shown


@pytest.mark.parametrize(
    ("name", "text"),
    [
        (PatientName("Müller", "Erika"), "Müller, Erika"),
        (PatientName("Müller"), "Müller"),
        (PatientName("", "Erika"), "Erika"),
        (PatientName("de la Cruz", "Ana", "", "Dra.", "MD"), "de la Cruz, Dra. Ana, MD"),
    ],
)
def test_a_name_is_written_family_first(name, text):
    assert written(name) == text


def test_a_script_without_a_font_is_told_where_another_can_be_printed():
    content = identity_content(named(PatientName("Yamada", "Tarou"), PatientName("山田", "太郎")))
    assert content["name"] == "Yamada, Tarou (and in another script)"


def test_names_in_several_scripts_with_fonts_are_all_printed():
    greek = PatientName("Παπαδοπούλου", "Ελένη")
    content = identity_content(named(PatientName("Papadopoulos", "Eleni"), greek))
    assert content["name"] == "Papadopoulos, Eleni / Παπαδοπούλου, Ελένη"


@pytest.mark.parametrize(
    "identity",
    [
        named(PatientName("山田", "太郎")),
        named(PatientName("Yamada"), patient_id="山田-1"),
        named(PatientName("W" * 97)),
        named(PatientName("a" + "\u200b" * 20)),
        named(PatientName("1 of 4 160.0")),
        named(PatientName("Erika"), patient_id="1 of 4"),
    ],
    ids=["no font", "no font for the id", "long", "long when shown", "row", "row as id"],
)
def test_an_identity_that_cannot_be_printed_truly_is_refused_without_naming_it(identity):
    with pytest.raises(InputError) as caught:
        identity_content(identity)
    (fault,) = caught.value.faults
    assert fault.code == "identity-not-printable"
    assert fault.hazard == "H38"
    for name in identity.names:
        assert name.family not in fault.message
    assert "Erika" not in repr(identity)


def test_nothing_known_is_said_to_be_not_stated():
    content = identity_content(PatientIdentity((), "7", None, None))
    assert content == {"name": "not stated", "id": "7", "born": "not stated", "ct": "not stated"}


ACTIVE = {"/JS", "/JavaScript", "/URI", "/Launch", "/GoToR", "/GoToE", "/SubmitForm", "/ImportData",
          "/AA", "/OpenAction", "/EmbeddedFile", "/EmbeddedFiles", "/RichMedia", "/AcroForm",
          "/XFA", "/Movie", "/Sound", "/Rendition"}  # fmt: skip
"""Names by which a PDF acts, leads elsewhere or carries another file."""


def _names(value, seen):
    value = value.get_object() if hasattr(value, "get_object") else value
    if id(value) in seen:
        return set()
    seen[id(value)] = value
    if isinstance(value, dict):
        inner = [_names(item, seen) for item in value.values()]
        words = {str(item) for item in value.values() if isinstance(item, pypdf.generic.NameObject)}
        return set(map(str, value)) | words | set().union(*inner)
    if isinstance(value, list):
        return set().union(*[_names(item, seen) for item in value])
    return set()


def test_the_prescription_neither_acts_nor_leads_elsewhere(identified):
    names = _names(pypdf.PdfReader(io.BytesIO(identified)).trailer, {})
    assert {"/Type", "/Page", "/Font"} <= names
    assert not names & ACTIVE


def test_a_link_or_a_script_in_a_pdf_would_be_found(identified):
    writer = pypdf.PdfWriter(clone_from=pypdf.PdfReader(io.BytesIO(identified)))
    name, word = pypdf.generic.NameObject, pypdf.generic.TextStringObject
    action = {name("/S"): name("/URI"), name("/JS"): word("app.alert(1)")}
    writer.root_object[name("/OpenAction")] = pypdf.generic.DictionaryObject(action)
    buffer = io.BytesIO()
    writer.write(buffer)
    names = _names(pypdf.PdfReader(io.BytesIO(buffer.getvalue())).trailer, {})
    assert {"/JS", "/URI", "/OpenAction"} <= names
