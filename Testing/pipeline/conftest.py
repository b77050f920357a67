"""The phantom's plan, made once, and cases with their parts changed."""

import json
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def a_plan(a_phantom, a_recognised):
    """The plan of the phantom's case; do not change it."""
    from hexafix.case import case_from_document
    from hexafix.pipeline import plan_recognised

    raw = json.dumps(a_phantom.case).encode()
    case = case_from_document(raw, folder=Path(), needs_image=False)
    return plan_recognised(case, a_recognised)


@pytest.fixture
def a_draft_case(a_phantom, tmp_path):
    """Reads the phantom's case without some of its keys: `a_draft_case("schedule", limb={…})`."""
    from hexafix.case import case_from_document

    def read(*without, **changes):
        document = {**a_phantom.case, **changes}
        document = {key: value for key, value in document.items() if key not in without}
        raw = json.dumps(document).encode()
        return case_from_document(raw, folder=tmp_path, needs_image=False, plannable=False)

    return read
