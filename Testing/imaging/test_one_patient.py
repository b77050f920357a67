"""One series is of one patient, and its grey values can be Hounsfield units."""

import pytest
from hexafix.errors import ImageRefused
from hexafix.imaging import read_volume


def refusals(folder):
    with pytest.raises(ImageRefused) as caught:
        read_volume(folder)
    return {(fault.code, fault.hazard) for fault in caught.value.faults}


@pytest.mark.parametrize(
    ("keyword", "value"),
    [
        ("PatientName", "Other^Name"),
        ("PatientID", "another"),
        ("PatientBirthDate", "19700101"),
    ],
)
def test_a_series_that_names_two_patients_is_refused_without_their_names(
    keyword, value, tmp_path, writer, grid, secret
):
    items = writer.slices(grid)
    for item in items:
        item.PatientBirthDate = "19600101"
    items[2][keyword].value = value
    folder = writer.save(tmp_path, items)
    with pytest.raises(ImageRefused) as caught:
        read_volume(folder)
    (fault,) = caught.value.faults
    assert (fault.code, fault.hazard) == ("mixed-patient", "H38")
    assert "1 of 5 slices" in fault.value
    assert secret not in str(caught.value)
    assert value not in str(caught.value)


def test_padding_and_case_do_not_make_another_patient(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[1].PatientName = str(items[0].PatientName).upper() + "^^"
    assert read_volume(writer.save(tmp_path, items)).size_ijk == (7, 6, 5)


def test_values_beyond_any_hounsfield_unit_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[3].RescaleSlope = "900"
    assert refusals(writer.save(tmp_path, items)) == {("impossible-values", "H10")}
