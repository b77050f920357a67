"""What the tables of every door say of numbers."""

import pytest
from hexafix.presenter import tables


def ring(uniqueness_mm):
    return {
        "included_angles_deg": [60.0, 100.0, 110.0, 90.0],
        "rule": "preferred",
        "uniqueness_mm": uniqueness_mm,
        "predicted_error_mm": 0.0466,
        "predicted_error_deg": 0.012345,
    }


@pytest.mark.parametrize(("far", "words"), [(17.7804, "17.8"), (4.9604, "4.960")])
def test_how_far_the_next_numbering_is_has_no_idle_decimals(far, words):
    table = tables.layout({"proximal": ring(far), "distal": ring(far)})
    column = table.columns.index("Next numbering mm")
    assert [row[column] for row in table.rows] == [words, words]
    error = table.columns.index("Predicted error mm")
    assert table.rows[0][error] == "0.047"
