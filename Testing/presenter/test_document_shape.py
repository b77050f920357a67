"""What doors read of a case that holds odd values: they stumble over none, and none gets right."""

import json

from hexafix.case import draft_faults
from hexafix.presenter.shape import shaped


def test_a_right_document_is_read_as_it_is(whole_documents, a_case):
    for document in (*whole_documents, a_case, {"schema_version": 2}):
        assert shaped(document) == document


def test_no_fault_is_gone_from_what_doors_read(odd_documents, tmp_path):
    (tmp_path / "ct").mkdir()
    faulty = 0
    for document in odd_documents:
        if draft_faults(json.dumps(document).encode(), folder=tmp_path):
            faulty += 1
            read = json.dumps(shaped(document)).encode()
            assert draft_faults(read, folder=tmp_path), document
    assert faulty > 0.8 * len(odd_documents)


def test_what_is_read_once_is_read_the_same_again(odd_documents):
    for document in odd_documents:
        once = shaped(document)
        assert shaped(once) == once


def test_an_odd_case_file_is_opened_and_its_fault_told(
    make_presenter, an_engine, a_case, tmp_path, codes
):
    presenter = make_presenter(engine=an_engine, threaded=False)
    a_case["markers"]["proximal"] = "x"
    a_case["correction"] = {"kind": "fragment-motion"}
    (tmp_path / "case.json").write_text(json.dumps(a_case))
    assert presenter.open_case(tmp_path / "case.json")
    assert codes(presenter).count("case-value") >= 1
    assert presenter.snapshot.document["correction"] is None
    presenter.set_case_id("other")
    assert presenter.version.content["correction"] == {"kind": "fragment-motion"}
