"""Decoded pixels have the size that the header says and values that can be Hounsfield units."""

import numpy as np
import pytest
from hexafix.errors import ImageRefused
from hexafix.imaging import pixel_data, read_volume
from pydicom.uid import RLELossless


def test_a_frame_decoded_to_another_size_is_refused(tmp_path, writer, grid, monkeypatch):
    items = writer.slices(grid)
    writer.save(tmp_path, items)
    for item in items:
        item.compress(RLELossless)
    folder = writer.save(tmp_path, items, syntax=RLELossless)
    right = read_volume(folder).voxels.shape[1:]
    given = (right[0], 1)  # could be spread over the whole slice unseen

    def other_size(slices):
        yield from (np.zeros(given, np.uint16) for _ in slices)

    monkeypatch.setattr(pixel_data, "decode_frames", other_size)
    with pytest.raises(ImageRefused) as caught:
        read_volume(folder)
    assert {(f.code, f.hazard) for f in caught.value.faults} == {("corrupt-pixel-data", "H09")}


def test_values_beyond_any_hounsfield_unit_are_refused(tmp_path, writer, grid):
    items = writer.slices(grid)
    items[3].RescaleSlope = "900"
    with pytest.raises(ImageRefused) as caught:
        read_volume(writer.save(tmp_path, items))
    assert {(f.code, f.hazard) for f in caught.value.faults} == {("impossible-values", "H10")}
