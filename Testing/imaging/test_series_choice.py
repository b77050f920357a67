"""Several series in one folder: listed, chosen, never merged."""

from __future__ import annotations

import pytest
from hexafix.errors import ImageRefused, InputError
from hexafix.imaging import list_series, read_volume
from pydicom.uid import generate_uid


def faults_of(folder, error=ImageRefused, **choice):
    with pytest.raises(error) as caught:
        read_volume(folder, **choice)
    return {fault.code: fault for fault in caught.value.faults}


def only(faults, code, hazard):
    assert set(faults) == {code}
    assert faults[code].hazard == hazard
    assert faults[code].next_step
    return faults[code]


def test_two_series_are_refused_with_their_properties(tmp_path, writer, grid, secret):
    first, second = writer.slices(grid), writer.slices(writer.grid(size=(7, 6, 4), step=3.0))
    second[0].SeriesDescription = secret
    writer.save(tmp_path / "1", first)
    writer.save(tmp_path / "2", second)
    fault = only(faults_of(tmp_path), "several-series", "H05")
    assert "5 slices of 7 x 6, 0.450 x 0.700 x 1.250 mm, axial" in fault.value
    assert "4 slices of 7 x 6, 0.450 x 0.700 x 3.000 mm, axial" in fault.value
    assert secret not in fault.message


def test_the_series_asked_for_is_read_alone(tmp_path, writer, grid, assert_coded):
    first, second = writer.slices(grid), writer.slices(writer.grid(size=(7, 6, 4), step=3.0))
    writer.save(tmp_path / "1", first)
    writer.save(tmp_path / "2", second)
    volume = read_volume(tmp_path, series_instance_uid=first[0].SeriesInstanceUID)
    assert_coded(volume, grid)
    assert "left out (H05): 4 x other series" in volume.source.warnings


def test_a_series_that_is_not_there_is_an_input_error(tmp_path, writer, grid):
    folder = writer.save(tmp_path, writer.slices(grid))
    assert "series-not-found" in faults_of(folder, InputError, series_instance_uid=generate_uid())


@pytest.mark.parametrize("kind", ["localizer", "secondary capture"])
@pytest.mark.parametrize("own_series", [False, True])
def test_localizers_and_captures_are_left_out_with_their_reason(
    kind, own_series, tmp_path, writer, grid, assert_coded
):
    items = writer.slices(grid)
    uid = generate_uid() if own_series else items[0].SeriesInstanceUID
    extra = writer.one(writer.grid(size=(9, 9, 5), row=(0, 1, 0), column=(0, 0, -1)), 0, uid)
    if kind == "localizer":
        extra.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
    else:
        extra.SOPClassUID = "1.2.840.10008.5.1.4.1.1.7"
    volume = read_volume(writer.save(tmp_path, [*items, extra]))
    assert_coded(volume, grid)
    assert f"left out (H05): 1 x {kind}" in volume.source.warnings


def test_a_folder_of_localizers_only_is_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        item.ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
    only(faults_of(writer.save(tmp_path, items)), "no-usable-series", "H05")


def test_a_series_left_out_is_listed_with_its_reason(tmp_path, writer, grid, secret):
    scout = writer.slices(grid)[:1]
    scout[0].ImageType = ["ORIGINAL", "PRIMARY", "LOCALIZER"]
    scout[0].SeriesInstanceUID = generate_uid()
    writer.save(tmp_path / "scout", scout)
    writer.save(tmp_path / "ct", writer.slices(grid))
    usable, left_out = list_series(tmp_path)
    assert (usable.slices, usable.excluded) == (5, None)
    assert (left_out.slices, left_out.excluded) == (1, "localizer")
    assert secret not in usable.description + left_out.description


def test_the_list_tells_what_would_be_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    del items[2]
    (summary,) = list_series(writer.save(tmp_path, items))
    assert [fault.code for fault in summary.faults] == ["missing-slice"]


def test_a_folder_that_is_not_there_cannot_be_listed(tmp_path):
    with pytest.raises(InputError):
        list_series(tmp_path / "nowhere")
