"""A uniformly tilted stack: every voxel keeps its place and its value, and the tilt is told."""

from __future__ import annotations

import numpy as np
import pytest
import SimpleITK as sitk  # noqa: N813
from hexafix.errors import ImageRefused, InputError
from hexafix.imaging import list_series, pixel_data, read_volume
from hexafix.imaging.gantry_tilt import GantryTilt
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pydicom.uid import generate_uid
from scipy.ndimage import gaussian_filter, map_coordinates
from scipy.spatial.transform import Rotation

AIR = -1024
OBLIQUE = ((0.8, 0.6, 0.0), (-0.48, 0.64, -0.6))
TILTS = {
    "about the rows": (-18.5, 0.0),
    "the other way": (16.5, 0.0),
    "about the columns": (0.0, 12.0),
    "about both": (20.0, -9.0),
    "just beyond the tolerance": (0.06, 0.0),
}
"""Lean towards the columns and towards the rows, deg."""


def leaning(writer, lean_deg, *, sign=1.0, **given_grid):
    """A grid whose slice origins lean: towards the column and towards the row direction."""
    grid = writer.grid(**given_grid)
    normal = np.cross(grid.row, grid.column)
    towards_column, towards_row = np.tan(np.radians(lean_deg))
    step = normal + towards_column * np.array(grid.column) + towards_row * np.array(grid.row)
    return writer.grid(**given_grid, step_direction=tuple(sign * step))


def acquired_index(grid, points):
    """Fractional voxel indices of the slices as their headers place them, by matrix inverse."""
    origin, step = grid.slice_origin(0), grid.slice_origin(1) - grid.slice_origin(0)
    columns = [
        np.array(grid.row) * grid.between_columns,
        np.array(grid.column) * grid.between_rows,
        step,
    ]
    return (points - origin) @ np.linalg.inv(np.column_stack(columns)).T


def places(volume):
    """LPS of every voxel by the plain formula, shape (K, J, I, 3)."""
    k, j, i = np.meshgrid(*(np.arange(n) for n in volume.voxels.shape), indexing="ij")
    return np.stack([i, j, k], -1) @ volume.ijk_to_lps[:3, :3].T + volume.ijk_to_lps[:3, 3]


def in_halves(items):
    """Half a grey value a HU, so that the volume is of floats and nothing is rounded away."""
    for item in items:
        item.RescaleSlope, item.RescaleIntercept = "0.5", "-1024"
    return items


def assert_ramp(volume, grid, *, tolerance=2e-3):
    """Inside what was acquired every voxel is what its own place predicts; outside it is air."""
    index = acquired_index(grid, places(volume))
    nearest = np.rint(index[..., 2])
    np.testing.assert_allclose(index[..., 2], nearest, atol=1e-6)
    beyond = np.maximum(-index[..., :2], index[..., :2] - (np.array(grid.size[:2]) - 1)).max(-1)
    inside = beyond < 1e-5
    expected = 0.5 * (1000 * index[..., 2] + 10 * index[..., 1] + index[..., 0]) - 1024
    np.testing.assert_allclose(volume.voxels[inside], expected[inside], atol=tolerance)
    # A ten-thousandth of a voxel is moved to the whole voxel.
    assert np.all(volume.voxels[beyond > 2e-4] == AIR)
    # Along an axis that was moved between voxels the grid holds one voxel fewer, never more.
    count = inside.sum(axis=(1, 2))
    i, j, _ = grid.size
    assert np.all((count >= (i - 1) * (j - 1)) & (count <= i * j))
    assert count.max() == i * j


def assert_orthogonal(volume, grid):
    np.testing.assert_allclose(volume.direction[:, 0], grid.row, atol=1e-7)
    np.testing.assert_allclose(volume.direction[:, 1], grid.column, atol=1e-7)
    np.testing.assert_allclose(volume.direction[:, 2], np.cross(grid.row, grid.column), atol=1e-7)
    np.testing.assert_allclose(
        volume.spacing_mm, [grid.between_columns, grid.between_rows, grid.step], atol=1e-6
    )


def assert_corners(volume, grid):
    """The acquired affine has all four corners of every slice where its header has them."""
    acquisition = volume.source.acquisition
    i, j, k = grid.size
    assert acquisition.size_ijk == grid.size
    first = (
        0 if np.allclose(acquisition.ijk_to_lps[:3, 3], grid.place(0, 0, 0), atol=0.1) else k - 1
    )
    for index in np.ndindex(2, 2, k):
        a, b = index[0] * (i - 1), index[1] * (j - 1)
        at = acquisition.ijk_to_lps @ (a, b, abs(first - index[2]), 1)
        np.testing.assert_allclose(at[:3], grid.place(a, b, index[2]), atol=1e-3)


@pytest.mark.parametrize("lean", TILTS.values(), ids=TILTS.keys())
@pytest.mark.parametrize("frame", [((1, 0, 0), (0, 1, 0)), ((-1, 0, 0), (0, 1, 0)), OBLIQUE])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_every_voxel_of_a_tilted_stack_has_the_value_that_its_place_predicts(
    lean, frame, sign, tmp_path, writer
):
    grid = leaning(writer, lean, sign=sign, row=frame[0], column=frame[1], size=(9, 8, 5))
    volume = read_volume(writer.save(tmp_path, in_halves(writer.slices(grid))))
    assert_orthogonal(volume, grid)
    assert_corners(volume, grid)
    assert_ramp(volume, grid)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    turn=st.tuples(*[st.floats(-1, 1)] * 4).filter(lambda q: np.linalg.norm(q) > 0.1),
    lean=st.tuples(st.floats(-24, 24), st.floats(-24, 24)).filter(lambda p: np.hypot(*p) > 0.1),
    spacing=st.tuples(*[st.floats(0.3, 3.0).map(lambda v: round(v, 4))] * 3),
    origin=st.tuples(*[st.floats(-400, 400).map(lambda v: round(v, 3))] * 3),
    sign=st.sampled_from([1.0, -1.0]),
    data=st.data(),
)
def test_any_tilt_orientation_and_file_order_keeps_values_and_places(
    turn, lean, spacing, origin, sign, data, tmp_path_factory, writer
):
    frame = Rotation.from_quat(turn).as_matrix()
    grid = leaning(
        writer,
        lean,
        sign=sign,
        row=tuple(frame[:, 0]),
        column=tuple(frame[:, 1]),
        origin=origin,
        between_rows=spacing[0],
        between_columns=spacing[1],
        step=spacing[2],
        size=(6, 5, 4),
    )
    order = data.draw(st.permutations(range(4)))
    items = in_halves(writer.slices(grid))
    folder = writer.save(tmp_path_factory.mktemp("series"), [items[k] for k in order])
    volume = read_volume(folder)
    assert_orthogonal(volume, grid)
    assert_corners(volume, grid)
    # Positions in a header have 16 characters: an index is right to about 1e-5 of a voxel.
    assert_ramp(volume, grid, tolerance=0.02)


def test_whole_hounsfield_units_stay_whole_and_are_rounded_to_the_nearest(tmp_path, writer):
    grid = leaning(writer, (-18.5, 0.0))
    volume = read_volume(writer.save(tmp_path, writer.slices(grid)))
    assert volume.voxels.dtype == np.int16
    index = acquired_index(grid, places(volume))
    expected = 1000 * index[..., 2] + 10 * index[..., 1] + index[..., 0] - 1024
    moved = volume.voxels[volume.voxels > AIR] - expected[volume.voxels > AIR]
    assert np.abs(moved).max() <= 0.5 + 1e-3


def smooth_slices(writer, grid, seed=3):
    """Slices of smooth noise, and the values as an array (K, J, I)."""
    noise = np.random.default_rng(seed).normal(size=grid.size[::-1])
    values = np.rint(60_000 * gaussian_filter(noise, 3.0) + 20_000).astype(np.uint16)
    items = writer.slices(grid)
    for item, pixels in zip(items, values, strict=True):
        writer.set_pixels(item, pixels)
        item.RescaleIntercept = "-20000"
    return items, values.astype(float) - 20_000


def test_a_general_spline_through_the_sheared_lattice_agrees(tmp_path, writer):
    grid = leaning(writer, (14.0, 8.0), row=OBLIQUE[0], column=OBLIQUE[1], size=(60, 50, 24))
    items, values = smooth_slices(writer, grid)
    volume = read_volume(writer.save(tmp_path, items))
    index = acquired_index(grid, places(volume))
    expected = map_coordinates(values, index[..., ::-1].reshape(-1, 3).T, order=3, mode="mirror")
    deep = np.all((index > 8) & (index < np.array(grid.size) - 9), axis=-1)
    assert deep.sum() > 5_000
    apart = volume.voxels[deep] - expected.reshape(deep.shape)[deep]
    # Whole HU, and at the tops no value above its neighbours: nothing else differs.
    assert np.median(np.abs(apart)) < 0.5
    assert np.sqrt(np.mean(apart**2)) < 0.01 * np.std(values)


def test_simpleitk_agrees_when_it_is_told_not_to_force_right_angles(tmp_path, writer):
    grid = leaning(writer, (-18.5, 0.0), size=(60, 50, 24))
    items, values = smooth_slices(writer, grid)
    folder = writer.save(tmp_path, items)
    volume = read_volume(folder)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    reader.ForceOrthogonalDirectionOff()
    sheared = reader.Execute()
    target = sitk.GetImageFromArray(volume.voxels.astype(np.float32))
    target.SetOrigin(volume.lps_from_ijk([0, 0, 0]).tolist())
    target.SetSpacing(volume.spacing_mm.tolist())
    target.SetDirection(volume.direction.ravel().tolist())
    moved = sitk.Resample(
        sitk.Cast(sheared, sitk.sitkFloat32), target, sitk.Transform(), sitk.sitkBSpline, -9e9
    )
    expected = sitk.GetArrayFromImage(moved)
    index = acquired_index(grid, places(volume))
    deep = np.all((index > 8) & (index < np.array(grid.size) - 9), axis=-1)
    apart = volume.voxels[deep] - expected[deep]
    assert np.median(np.abs(apart)) < 0.5
    assert np.sqrt(np.mean(apart**2)) < 0.01 * np.std(values)


def test_clipped_metal_stays_flat_and_nothing_overshoots(tmp_path, writer):
    grid = leaning(writer, (17.0, 0.0), size=(40, 40, 6))
    items = writer.slices(grid)
    for item in items:
        pixels = np.zeros((40, 40), np.uint16)
        pixels[10:30, 12:28] = 4095
        writer.set_pixels(item, pixels)
    voxels = read_volume(writer.save(tmp_path, items)).voxels
    assert (voxels.min(), voxels.max()) == (-1024, 3071)
    for plane in voxels:
        # Of 20 rows 19 lie wholly between clipped ones; one more on each side is a mixture.
        flat = (plane[:, 14:26] == 3071).all(axis=1).sum()
        mixed = ((plane[:, 20] > -1024) & (plane[:, 20] < 3071)).sum()
        assert (flat, mixed) in {(20, 0), (19, 2)}


def test_the_hash_is_of_what_was_acquired(tmp_path, writer, syntaxes):
    grid = leaning(writer, (-18.5, 0.0))
    uid = generate_uid()
    items = writer.slices(grid, series_uid=uid)
    reverse = read_volume(writer.save(tmp_path / "r", items[::-1])).source.sha256
    for name, syntax in syntaxes.items():
        again = writer.slices(grid, series_uid=uid)
        for item in again:
            if name == "big-endian":
                item.PixelData = np.frombuffer(item.PixelData, "<u2").astype(">u2").tobytes()
        folder = writer.save(tmp_path / name, again, syntax=syntax)
        assert read_volume(folder).source.sha256 == reverse
    straight = read_volume(writer.save(tmp_path / "s", writer.slices(writer.grid()))).source
    other = read_volume(writer.save(tmp_path / "o", writer.slices(leaning(writer, (-18.4, 0.0)))))
    assert len({reverse, straight.sha256, other.source.sha256}) == 3


@pytest.mark.parametrize("row", [(1, 0, 0), (-1, 0, 0)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_tilted_multi_frame_is_moved_too(row, sign, tmp_path, writer):
    grid = leaning(writer, (11.0, 0.0), sign=sign, row=row)
    item = writer.enhanced(grid)
    measures = item.SharedFunctionalGroupsSequence[0].PixelValueTransformationSequence[0]
    measures.RescaleSlope, measures.RescaleIntercept = 0.5, -1024
    volume = read_volume(writer.save(tmp_path, [item]))
    assert_corners(volume, grid)
    assert_ramp(volume, grid)


@pytest.mark.parametrize("stated", ["0", "18.5", "-18.5"])
def test_the_tilt_is_told_and_comes_from_positions_only(stated, tmp_path, writer):
    items = writer.slices(leaning(writer, (-18.5, 0.0)))
    for item in items:
        item.GantryDetectorTilt = stated
    folder = writer.save(tmp_path, items)
    volume = read_volume(folder)
    assert volume.source.acquisition.tilt_deg == pytest.approx(-18.5, abs=1e-6)
    (sentence,) = [text for text in volume.source.warnings if "gantry tilt" in text]
    assert sentence.startswith("gantry tilt (H02): ")
    assert "-18.50 deg about the row direction" in sentence
    assert "resampled from per-slice geometry" in sentence
    (summary,) = list_series(folder)
    assert summary.faults == ()
    assert summary.tilt_deg == pytest.approx(-18.5, abs=1e-6)
    assert "tilted by -18.50 deg" in summary.description
    assert summary.spacing_mm == pytest.approx((0.45, 0.7, 1.25))


def test_a_straight_stack_is_not_touched_whatever_the_tag_says(tmp_path, writer, grid):
    items = writer.slices(grid)
    for item in items:
        item.GantryDetectorTilt = "18.5"
    volume = read_volume(writer.save(tmp_path, items))
    assert volume.source.acquisition is None
    assert volume.size_ijk == grid.size
    assert not any("tilt" in text for text in volume.source.warnings)


@pytest.mark.parametrize(
    ("step", "deg", "axis_deg", "words"),
    [
        ((0, -0.3345953, 1), -18.5, 0.0, "-18.50 deg about the row direction"),
        ((0, 0.2962134, 1), 16.5, 0.0, "+16.50 deg about the row direction"),
        ((0.2, 0, 1), 11.3099, -90.0, "+11.31 deg about the column direction"),
        ((-0.2, 0, 1), -11.3099, -90.0, "-11.31 deg about the column direction"),
        ((0.1, 0.2, 1), 12.6044, -26.565, "+12.60 deg about an axis -27 deg from the row"),
        ((-0.1, -0.2, 1), -12.6044, -26.565, "-12.60 deg about an axis -27 deg from the row"),
    ],
)
def test_sign_and_axis_of_a_tilt_follow_the_lean(step, deg, axis_deg, words):
    tilt = GantryTilt.of(np.array(step, float), np.eye(3))
    assert tilt.deg == pytest.approx(deg, abs=1e-3)
    assert tilt.axis_deg == pytest.approx(axis_deg, abs=1e-3)
    assert tilt.words.startswith(words)


@pytest.mark.parametrize(
    ("spoil", "code"),
    [
        (lambda items: items.pop(2), "missing-slice"),
        (lambda items: _shift(items[-1], 2, 0.5), "uneven-spacing"),
        (lambda items: _shift(items[2], 0, 0.3), "shifted-slice"),
        (lambda items: _set(items[1], "PixelSpacing", [0.8, 0.45]), "mixed-spacing"),
    ],
)
def test_a_tilt_that_is_not_all_is_refused_with_both_faults(spoil, code, tmp_path, writer):
    items = writer.slices(leaning(writer, (-18.5, 0.0)))
    spoil(items)
    with pytest.raises(ImageRefused) as caught:
        read_volume(writer.save(tmp_path, items))
    codes = {fault.code: fault for fault in caught.value.faults}
    assert {code, "gantry-tilt"} <= set(codes)
    assert codes["gantry-tilt"].hazard == "H02"
    assert "-1" in codes["gantry-tilt"].value


def _shift(item, axis, by):
    item.ImagePositionPatient[axis] = float(item.ImagePositionPatient[axis]) + by


def _set(item, keyword, value):
    setattr(item, keyword, value)


def test_slices_that_do_not_lean_alike_are_refused(tmp_path, writer):
    straight, bent = writer.grid(), leaning(writer, (10.0, 0.0))
    uid = generate_uid()
    items = [writer.one(bent if k > 2 else straight, k, uid) for k in range(5)]
    with pytest.raises(ImageRefused) as caught:
        read_volume(writer.save(tmp_path, items))
    assert {fault.code for fault in caught.value.faults} == {"shifted-slice", "gantry-tilt"}


def test_a_widened_grid_beyond_any_ct_is_not_allocated(tmp_path, writer, monkeypatch):
    grid = leaning(writer, (20.0, 0.0))
    folder = writer.save(tmp_path, writer.slices(grid))
    monkeypatch.setattr(pixel_data, "MAX_VOXELS", int(np.prod(grid.size)))
    with pytest.raises(InputError) as caught:
        read_volume(folder)
    assert [fault.code for fault in caught.value.faults] == ["volume-too-large"]
