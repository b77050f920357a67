"""The benchmark page in the repository is the one its document makes."""

import json
from pathlib import Path

import pytest
from hexafix.comparison.page import document_text, page

DOCUMENTS = Path(__file__).resolve().parents[2] / "Resources" / "Documents"


@pytest.fixture(scope="module")
def the_text():
    return (DOCUMENTS / "benchmark.json").read_text(encoding="utf-8")


def test_the_shipped_page_is_what_its_document_says(the_text):
    document = json.loads(the_text)
    assert document_text(document) == the_text
    assert page(document) == (DOCUMENTS / "benchmark.md").read_text(encoding="utf-8")


def test_the_shipped_document_is_a_full_run_that_told_tools_apart(the_text, check_schema):
    document = json.loads(the_text)
    check_schema(document)
    assert not document["quick"]
    assert [group["name"] for group in document["groups"]] == [
        "balls", "pose", "kinematics", "reading"
    ]  # fmt: skip
    assert document["controls"]
    assert all(control["told_apart"] for control in document["controls"])


def test_the_shipped_page_names_no_folder(the_text):
    both = the_text + (DOCUMENTS / "benchmark.md").read_text(encoding="utf-8")
    for word in ("/home", "/root", "/tmp", "/work", "site-packages"):
        assert word not in both
