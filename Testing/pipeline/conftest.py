"""Cases with their parts changed."""

import json

import pytest


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
