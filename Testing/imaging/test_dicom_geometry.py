"""Where a DICOM voxel lies, whatever the orientation and the order of the files."""

from __future__ import annotations

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.imaging import list_series, read_volume
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

ORIENTATIONS = {
    "axial": ((1, 0, 0), (0, 1, 0)),
    "axial-feet-first": ((-1, 0, 0), (0, 1, 0)),
    "axial-prone": ((-1, 0, 0), (0, -1, 0)),
    "normal-downwards": ((1, 0, 0), (0, -1, 0)),
    "coronal": ((1, 0, 0), (0, 0, -1)),
    "sagittal": ((0, 1, 0), (0, 0, -1)),
    "oblique": ((0.8, 0.6, 0.0), (-0.48, 0.64, -0.6)),
}


@pytest.mark.parametrize("name", ORIENTATIONS)
@pytest.mark.parametrize("backwards", [False, True])
def test_every_voxel_lies_where_its_own_slice_header_puts_it(
    name, backwards, tmp_path, writer, assert_coded
):
    row, column = ORIENTATIONS[name]
    normal = np.cross(row, column)
    grid = writer.grid(
        row=row, column=column, step_direction=tuple(-normal if backwards else normal)
    )
    volume = read_volume(writer.save(tmp_path, writer.slices(grid)))
    assert_coded(volume, grid)
    # The order follows the normal, so the stack is right-handed and nothing is mirrored.
    assert np.linalg.det(volume.direction) == pytest.approx(1.0)
    np.testing.assert_allclose(volume.spacing_mm, [0.45, 0.7, 1.25], atol=1e-9)


@pytest.mark.parametrize("order", ["reversed", "shuffled"])
def test_file_names_and_instance_numbers_do_not_decide_the_order(
    order, tmp_path, writer, grid, assert_coded
):
    items = writer.slices(grid)
    turn = range(len(items))[::-1] if order == "reversed" else [3, 0, 4, 1, 2]
    items = [items[k] for k in turn]
    for number, item in enumerate(items):
        item.InstanceNumber = number + 1
        item.SliceLocation = str(number)
    assert_coded(read_volume(writer.save(tmp_path, items)), grid)


@pytest.mark.parametrize("stated", ["-1.25", "0", "7"])
def test_spacing_between_slices_is_not_believed(stated, tmp_path, writer, grid, assert_coded):
    items = writer.slices(grid)
    for item in items:
        item.SpacingBetweenSlices = stated
        item.GantryDetectorTilt = "18.5"
    assert_coded(read_volume(writer.save(tmp_path, items)), grid)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    turn=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
    spacing=st.tuples(*[st.floats(0.2, 3.0).map(lambda v: round(v, 4))] * 3),
    origin=st.tuples(*[st.floats(-900, 900).map(lambda v: round(v, 3))] * 3),
    data=st.data(),
)
def test_any_orientation_and_file_order_gives_the_same_places(
    turn, spacing, origin, data, tmp_path_factory, writer, assert_coded
):
    frame = Rotation.from_quat(turn).as_matrix()
    grid = writer.grid(
        row=tuple(frame[:, 0]),
        column=tuple(frame[:, 1]),
        origin=origin,
        between_rows=spacing[0],
        between_columns=spacing[1],
        step=spacing[2],
        size=(4, 3, 4),
    )
    order = data.draw(st.permutations(range(4)))
    items = writer.slices(grid)
    folder = writer.save(tmp_path_factory.mktemp("series"), [items[k] for k in order])
    volume = read_volume(folder)
    assert_coded(volume, grid)
    np.testing.assert_allclose(volume.ijk_to_lps[:3, 2], frame[:, 2] * spacing[2], atol=1e-6)


def test_simpleitk_sees_the_same_grid_where_it_is_right(tmp_path, writer):
    row, column = ORIENTATIONS["oblique"]
    grid = writer.grid(row=row, column=column)
    folder = writer.save(tmp_path, writer.slices(grid))
    volume = read_volume(folder)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    image = reader.Execute()
    np.testing.assert_array_equal(volume.voxels, sitk.GetArrayFromImage(image))
    for index in [(0, 0, 0), (6, 0, 2), (3, 5, 4)]:
        np.testing.assert_allclose(
            volume.lps_from_ijk(index), image.TransformIndexToPhysicalPoint(index), atol=1e-6
        )


def test_row_spacing_and_column_spacing_are_not_swapped(tmp_path, writer, grid):
    volume = read_volume(writer.save(tmp_path, writer.slices(grid)))
    step_j = volume.lps_from_ijk([0, 1, 0]) - volume.lps_from_ijk([0, 0, 0])
    np.testing.assert_allclose(step_j, [0, grid.between_rows, 0], atol=1e-12)


@pytest.mark.parametrize("row", [(1, 0, 0), (-1, 0, 0)])
@pytest.mark.parametrize("backwards", [False, True])
def test_enhanced_multi_frame_keeps_its_places(row, backwards, tmp_path, writer, assert_coded):
    normal = np.cross(row, (0, 1, 0))
    grid = writer.grid(row=row, step_direction=tuple(-normal if backwards else normal))
    folder = writer.save(tmp_path, [writer.enhanced(grid)])
    assert_coded(read_volume(folder), grid)
    assert_coded(read_volume(folder / "0000.dcm"), grid)


def test_a_tilt_within_tolerance_stays_in_the_affine(tmp_path, writer, assert_coded):
    angle = np.radians(0.03)
    grid = writer.grid(step=5.0, step_direction=(0.0, np.sin(angle), np.cos(angle)))
    volume = read_volume(writer.save(tmp_path, writer.slices(grid)))
    assert_coded(volume, grid)
    np.testing.assert_allclose(volume.lps_from_ijk([0, 0, 4]), grid.place(0, 0, 4), atol=1e-6)


def test_slices_in_subfolders_are_one_series(tmp_path, writer, grid, assert_coded):
    items = writer.slices(grid)
    writer.save(tmp_path / "a", items[:2])
    writer.save(tmp_path / "b" / "c", items[2:])
    assert_coded(read_volume(tmp_path), grid)


@pytest.mark.parametrize(
    ("name", "word"),
    [("axial", "axial"), ("coronal", "coronal"), ("sagittal", "sagittal"), ("oblique", "oblique")],
)
def test_the_summary_names_size_spacing_and_orientation(name, word, tmp_path, writer):
    row, column = ORIENTATIONS[name]
    folder = writer.save(tmp_path, writer.slices(writer.grid(row=row, column=column)))
    (summary,) = list_series(folder)
    assert (summary.slices, summary.size_ij, summary.orientation) == (5, (7, 6), word)
    assert summary.spacing_mm == pytest.approx((0.45, 0.7, 1.25))
    assert summary.faults == ()
    assert summary.excluded is None
