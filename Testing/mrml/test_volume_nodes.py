import dataclasses
import json

import numpy as np
import pytest
import SimpleITK
from hexafix.errors import ImageRefused
from hexafix.imaging.fingerprint import fingerprint
from hexafix.imaging.volume import Acquisition, ImageSource, Volume
from hexafix.mrml import volume as volumes
from hexafix.mrml.geometry import vtk4
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st


def _source(volume, **more):
    sha = fingerprint(volume.voxels, volume.ijk_to_lps)
    return dataclasses.replace(volume, source=ImageSource(sha256=sha, **more))


@pytest.mark.parametrize("dtype", [np.int16, np.float32, np.uint8, np.int32])
@pytest.mark.parametrize("mirrored", [False, True])
def test_a_volume_comes_back_to_the_last_bit(logic, oblique_volume, dtype, mirrored):
    volume = oblique_volume(dtype, mirrored=mirrored)
    assert (np.linalg.det(volume.ijk_to_lps[:3, :3]) < 0) == mirrored
    back = logic.volume_of(logic.add_volume(volume))
    assert back.voxels.dtype == volume.voxels.dtype
    np.testing.assert_array_equal(back.voxels, volume.voxels)
    np.testing.assert_array_equal(back.ijk_to_lps, volume.ijk_to_lps)


@settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    angles=st.tuples(*[st.floats(-3.1, 3.1)] * 3),
    spacing=st.tuples(*[st.floats(0.05, 9.0)] * 3),
    origin=st.tuples(*[st.floats(-3000, 3000)] * 3),
    hand=st.sampled_from([1.0, -1.0]),
)
def test_any_grid_comes_back_to_the_last_bit(logic, angles, spacing, origin, hand):
    from scipy.spatial.transform import Rotation

    affine = np.eye(4)
    turn = Rotation.from_euler("xyz", angles).as_matrix()
    affine[:3, :3] = turn * np.array(spacing) * [1, 1, hand]
    affine[:3, 3] = origin
    volume = Volume(np.arange(24, dtype=np.int16).reshape(2, 3, 4), affine)
    back = logic.volume_of(logic.add_volume(volume))
    np.testing.assert_array_equal(back.ijk_to_lps, affine)


@pytest.mark.parametrize("mirrored", [False, True])
def test_the_node_stands_where_simpleitk_sees_it_in_its_file(
    logic, oblique_volume, tmp_path, mirrored
):
    volume = oblique_volume(np.float32, mirrored=mirrored)
    node = logic.add_volume(volume)
    node.AddDefaultStorageNode()
    storage = node.GetStorageNode()
    storage.SetFileName(str(tmp_path / "ct.nrrd"))
    assert storage.WriteData(node)
    image = SimpleITK.ReadImage(str(tmp_path / "ct.nrrd"))
    np.testing.assert_array_equal(SimpleITK.GetArrayFromImage(image), volume.voxels)
    for ijk in [(0, 0, 0), (8, 0, 0), (0, 7, 0), (0, 0, 6), (8, 7, 6)]:
        np.testing.assert_allclose(
            image.TransformIndexToPhysicalPoint(ijk), volume.lps_from_ijk(ijk), atol=1e-9
        )


def test_the_source_and_its_hash_stay_with_the_node(logic, oblique_volume):
    acquired = np.diag([0.6, 0.8, 1.2, 1.0])
    acquired[1, 2] = 0.3
    volume = _source(
        oblique_volume(),
        kind="dicom",
        slice_thickness_mm=1.25,
        laterality="L",
        body_part="LEG",
        patient_position="HFS",
        warnings=("slices overlap",),
        acquisition=Acquisition(acquired, (9, 8, 6), 14.0),
    )
    source = logic.volume_of(logic.add_volume(volume)).source
    np.testing.assert_array_equal(source.acquisition.ijk_to_lps, acquired)
    assert (source.acquisition.size_ijk, source.acquisition.tilt_deg) == ((9, 8, 6), 14.0)
    assert dataclasses.replace(source, acquisition=None) == dataclasses.replace(
        volume.source, acquisition=None
    )


def _change_a_voxel(node):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    vtk_to_numpy(node.GetImageData().GetPointData().GetScalars())[17] += 1


def _move(node):
    x, y, z = node.GetOrigin()
    node.SetOrigin(x + 0.01, y, z)


def _stretch(node):
    i, j, k = node.GetSpacing()
    node.SetSpacing(i, j, k * 1.0001)


def _forge_the_source(node):
    document = json.loads(node.GetAttribute(volumes.SOURCE))
    node.SetAttribute(volumes.SOURCE, json.dumps({**document, "warnings": 7}))


@pytest.mark.parametrize("change", [_change_a_voxel, _move, _stretch, _forge_the_source])
def test_what_the_reader_said_is_not_believed_of_a_changed_volume(logic, oblique_volume, change):
    volume = _source(oblique_volume(), kind="dicom", laterality="L")
    node = logic.add_volume(volume)
    assert logic.volume_of(node).source.kind == "dicom"
    change(node)
    back = logic.volume_of(node)
    assert back.source.kind == "memory"
    assert back.source.laterality is None
    assert back.source.warnings == (volumes.CHANGED,)
    assert back.source.sha256 == fingerprint(back.voxels, back.ijk_to_lps)


def test_a_volume_of_somebody_else_carries_a_warning_and_a_hash(app, logic, oblique_volume):
    volume = oblique_volume()
    node = logic.add_volume(volume)
    for name in (volumes.SOURCE, volumes.CONTENT, volumes.AFFINE):
        node.RemoveAttribute(name)
    back = logic.volume_of(node)
    assert back.source.warnings == (volumes.FOREIGN,)
    assert back.source.sha256 == fingerprint(back.voxels, back.ijk_to_lps)
    np.testing.assert_allclose(back.ijk_to_lps, volume.ijk_to_lps, atol=1e-9)


def test_a_volume_under_a_transform_is_refused(app, logic, oblique_volume):
    node = logic.add_volume(oblique_volume())
    transform = app.scene.AddNewNodeByClass("vtkMRMLLinearTransformNode")
    node.SetAndObserveTransformNodeID(transform.GetID())
    with pytest.raises(ImageRefused) as refused:
        logic.volume_of(node)
    assert [(f.code, f.hazard) for f in refused.value.faults] == [("volume-transformed", "H36")]


def _shear(node):
    matrix = volumes._index_matrix(node)
    matrix[0, 1] += 0.1
    node.SetIJKToRASMatrix(vtk4(matrix))


def _twice(node):
    node.GetImageData().SetSpacing(2.0, 2.0, 2.0)


def _no_image(node):
    node.SetAndObserveImageData(None)


def _two_components(node):
    from vtkmodules.vtkCommonDataModel import vtkImageData

    image = vtkImageData()
    image.SetDimensions(9, 8, 7)
    image.AllocateScalars(4, 2)
    node.SetAndObserveImageData(image)


def _not_a_number(node):
    from vtkmodules.util.numpy_support import vtk_to_numpy

    vtk_to_numpy(node.GetImageData().GetPointData().GetScalars())[3] = np.nan


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (_shear, "sheared"),
        (_twice, "no-geometry"),
        (_no_image, "not-a-volume"),
        (_two_components, "not-a-volume"),
        (_not_a_number, "values-not-finite"),
    ],
)
def test_a_node_that_is_no_ct_on_a_grid_is_refused(logic, oblique_volume, change, code):
    node = logic.add_volume(oblique_volume(np.float32))
    change(node)
    with pytest.raises(ImageRefused) as refused:
        logic.volume_of(node)
    assert [fault.code for fault in refused.value.faults] == [code]


def test_the_nodes_voxels_are_its_own(logic, oblique_volume):
    volume = oblique_volume()
    before = volume.voxels.copy()
    node = logic.add_volume(volume)
    back = logic.volume_of(node)
    _change_a_voxel(node)
    np.testing.assert_array_equal(volume.voxels, before)
    np.testing.assert_array_equal(back.voxels, before)


def test_a_new_volume_takes_the_place_of_the_older_one(app, logic, oblique_volume):
    logic.add_volume(oblique_volume())
    second = logic.add_volume(oblique_volume(np.float32))
    assert app.scene.GetNumberOfNodesByClass("vtkMRMLScalarVolumeNode") == 1
    assert app.scene.GetNumberOfNodesByClass("vtkMRMLScalarVolumeDisplayNode") == 1
    assert logic.volume_node() is second
    assert app.app_logic.GetSelectionNode().GetActiveVolumeID() == second.GetID()
