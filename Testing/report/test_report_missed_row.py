"""The patient is told what to do about a missed or doubled row, and dates are dates."""

import io

import pypdfium2
import pytest
from hexafix.errors import InputError
from hexafix.report import words
from hexafix.report.format import parse_date
from hexafix.report.pdf import prescription_pdf


def test_the_prescription_says_what_to_do_after_a_missed_or_double_row(a_plan):
    with pypdfium2.PdfDocument(io.BytesIO(prescription_pdf(a_plan))) as pdf:
        text = " ".join(page.get_textpage().get_text_range() for page in pdf)
    text = " ".join(text.split())
    assert len(words.MISSED) >= 3
    for sentence in (*words.MISSED, words.DONE_TWICE):
        assert " ".join(sentence.split()) in text


@pytest.mark.parametrize("text", ["1.12.2026", "2026-02-29", "2026-12-01T08:00", "", None])
def test_a_date_that_is_none_is_refused(text):
    with pytest.raises(InputError) as error:
        parse_date(text)
    assert error.value.faults[0].hazard == "H45"
