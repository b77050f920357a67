"""Tilted gantries, patients lying otherwise, reformatted and reversed stacks."""

import dataclasses
import json

import numpy as np
import pydicom
import pytest
from hexafix.errors import InputError
from hexafix.imaging import read_volume
from hexafix.phantom import PhantomSpec, make_phantom, write_phantom
from hexafix.phantom.limb import limb_solids
from hexafix.phantom.posture import PATIENT_POSITIONS, scanner_axes
from hexafix.phantom.scene import build_scene
from hexafix.phantom.truth import truth_document

LEFT, BACK, HEAD = np.eye(3)

TILTED = PhantomSpec(
    seed=8,
    size_ijk=(44, 40, 14),
    spacing_mm=(0.9, 1.0, 1.7),
    slice_thickness_mm=3.0,
    image_angles_rad=(0.05, -0.08, 0.06),
    gantry_tilt_rad=0.3,
    noise_hu=0.0,
    streak_hu=200.0,
    partial_frame=True,
)


def around_a_ball(spec: PhantomSpec) -> PhantomSpec:
    center = build_scene(spec).balls_mm[2] + np.array([1.3, -2.1, 0.8])
    return dataclasses.replace(spec, image_center_mm=tuple(center))


@pytest.fixture(scope="module")
def a_tilted_phantom():
    return make_phantom(around_a_ball(TILTED))


@pytest.mark.parametrize("reversed_", [False, True])
def test_every_slice_of_a_tilted_scan_is_the_slice_scanned_alone(reversed_: bool) -> None:
    spec = dataclasses.replace(around_a_ball(TILTED), slices_reversed=reversed_)
    tilted = make_phantom(spec).volume
    row, column = tilted.direction[:, 0], tilted.direction[:, 1]
    axes = np.column_stack([row, column, np.cross(row, column)])
    # X-Y-Z fixed angles of the tilted slices, written out
    angles = (
        float(np.arctan2(axes[2, 1], axes[2, 2])),
        float(np.arctan2(-axes[2, 0], np.hypot(axes[0, 0], axes[1, 0]))),
        float(np.arctan2(axes[1, 0], axes[0, 0])),
    )
    middle = (np.array(spec.size_ijk[:2]) - 1) / 2.0
    contrast = []
    for k in (4, 6, 9):
        alone = dataclasses.replace(
            spec,
            gantry_tilt_rad=0.0,
            slices_reversed=False,
            image_angles_rad=angles,
            size_ijk=(*spec.size_ijk[:2], 1),
            image_center_mm=tuple(tilted.lps_from_ijk([*middle, k])),
        )
        one = make_phantom(alone).volume.voxels[0].astype(int)
        # both origins are rounded to 1e-4 mm and both orientations to 1e-13
        assert np.abs(one - tilted.voxels[k]).max() <= 2
        contrast.append(np.ptp(one))
    assert max(contrast) > 3000


def test_a_tilted_scan_shifts_its_slices_and_keeps_the_table_straight(a_tilted_phantom) -> None:
    volume, spec = a_tilted_phantom.volume, a_tilted_phantom.spec
    upright = build_scene(dataclasses.replace(spec, gantry_tilt_rad=0.0)).grid
    step = volume.ijk_to_lps[:3, 2]
    normal = np.cross(volume.direction[:, 0], volume.direction[:, 1])
    assert step @ normal == pytest.approx(spec.spacing_mm[2], abs=1e-9)
    table = upright.ijk_to_lps[:3, 2] / spec.spacing_mm[2]
    np.testing.assert_allclose(step / np.linalg.norm(step), table, atol=1e-9)
    assert np.degrees(np.arccos(normal @ table)) == pytest.approx(np.degrees(0.3), abs=1e-6)


def test_the_header_holds_the_true_positions_and_a_tilt_tag_of_the_other_sign(
    a_tilted_phantom, tmp_path
) -> None:
    write_phantom(a_tilted_phantom, tmp_path / "one")
    volume = a_tilted_phantom.volume
    for path in (tmp_path / "one" / "ct").iterdir():
        header = pydicom.dcmread(path)
        k = int(header.InstanceNumber) - 1
        position = np.array(header.ImagePositionPatient, float)
        np.testing.assert_allclose(position, volume.lps_from_ijk([0, 0, k]), atol=1e-8)
        # a vendor with this orientation writes the opposite sign
        assert float(header.GantryDetectorTilt) == pytest.approx(17.2)
        assert float(header.ImageOrientationPatient[5]) > 0.2
    told = json.loads((tmp_path / "one" / "truth.json").read_text())["image"]
    assert told["gantry_tilt_deg"] == pytest.approx(np.degrees(0.3))
    assert told["spacing_mm"] == pytest.approx(TILTED.spacing_mm)


@pytest.mark.parametrize("image_format", ["nrrd", "nifti", "metaimage"])
def test_a_tilted_scan_cannot_be_written_as_one_file(
    a_tilted_phantom, tmp_path, image_format
) -> None:
    with pytest.raises(InputError, match="tilted"):
        write_phantom(a_tilted_phantom, tmp_path / "one", image_format=image_format)


def test_a_ball_of_a_tilted_scan_lies_where_the_truth_says() -> None:
    spec = dataclasses.replace(
        TILTED,
        streak_hu=0.0,
        limb=False,
        decoys=False,
        table=False,
        rod_diameter_mm=0.0,
        spacing_mm=(0.6, 0.6, 0.8),
        slice_thickness_mm=0.8,
        size_ijk=(36, 44, 30),
    )
    phantom = make_phantom(around_a_ball(spec))
    volume = phantom.volume
    index = np.stack(np.meshgrid(*[np.arange(n) for n in volume.size_ijk], indexing="ij"), -1)
    places = volume.lps_from_ijk(index).transpose(2, 1, 0, 3)
    true = next(b["center_mm"] for b in phantom.truth["balls"] if b["number"] == 2)
    near = np.linalg.norm(places - true, axis=-1) < 8.0
    weight = (volume.voxels.astype(float) + 1000.0) * near
    first_moment = np.einsum("kji,kjix->x", weight, places) / weight.sum()
    np.testing.assert_allclose(first_moment, true, atol=0.01)


@pytest.mark.parametrize("position", PATIENT_POSITIONS)
def test_patient_and_table_lie_as_the_position_says(position: str) -> None:
    spec = PhantomSpec(
        patient_position=position, image_angles_rad=(0.0, 0.0, 0.0), size_ijk=(3, 3, 3),
        partial_frame=True,
    )  # fmt: skip
    scene = build_scene(spec)
    row, column, normal = scene.grid.axes.T
    inwards = HEAD if position.startswith("HF") else -HEAD
    down = {"S": BACK, "P": -BACK, "DR": -LEFT, "DL": LEFT}[position[2:]]
    np.testing.assert_allclose(normal, inwards, atol=1e-12)
    np.testing.assert_allclose(column, down, atol=1e-12)
    np.testing.assert_allclose(row, np.cross(down, inwards), atol=1e-12)
    table = limb_solids(dataclasses.replace(spec, limb=False), scene)[0]
    middle = 0.5 * (scene.ring_a.position_mm + scene.ring_b.position_mm)
    np.testing.assert_allclose(table.pose.position_mm - middle, 138.0 * down, atol=1e-9)


@pytest.mark.parametrize(
    ("knobs", "determinant", "image_type"),
    [
        ({"patient_position": "FFP"}, 1, "AXIAL"),
        ({"slices_reversed": True}, -1, "AXIAL"),
        ({"slice_plane": "coronal"}, 1, "REFORMATTED"),
        ({"slice_plane": "sagittal", "slices_reversed": True}, -1, "REFORMATTED"),
    ],
)
def test_a_reader_finds_each_voxel_where_the_phantom_has_it(
    tmp_path, knobs, determinant, image_type
) -> None:
    plain = dataclasses.replace(TILTED, gantry_tilt_rad=0.0, streak_hu=0.0, noise_hu=20.0)
    phantom = make_phantom(around_a_ball(dataclasses.replace(plain, **knobs)))
    made = phantom.volume
    assert np.sign(np.linalg.det(made.ijk_to_lps)) == determinant
    for image_format in ("dicom", "nrrd"):
        case = write_phantom(phantom, tmp_path / image_format, image_format=image_format)
        image = json.loads(case.read_text())["image"]["path"]
        read = read_volume(case.parent / image)
        index = np.array([[3, 5, 2], [40, 8, 11], [20, 33, 7]])
        there = np.rint(read.ijk_from_lps(made.lps_from_ijk(index))).astype(int)
        np.testing.assert_allclose(read.lps_from_ijk(there), made.lps_from_ijk(index), atol=2e-4)
        np.testing.assert_array_equal(
            read.voxels[tuple(there.T[::-1])], made.voxels[tuple(index.T[::-1])]
        )
    header = pydicom.dcmread(next((tmp_path / "dicom" / "ct").iterdir()))
    assert header.ImageType[2] == image_type
    assert header.PatientPosition == phantom.spec.patient_position


def test_a_plain_scan_is_written_as_before(tmp_path) -> None:
    spec = dataclasses.replace(TILTED, gantry_tilt_rad=0.0)
    scene = build_scene(spec)
    assert set(truth_document(spec, scene, [])["image"]) == {
        "size_ijk", "spacing_mm", "slice_thickness_mm", "ijk_to_lps", "psf_sigma_mm", "noise_hu",
    }  # fmt: skip
    np.testing.assert_array_equal(scanner_axes("HFS"), np.eye(3))
    write_phantom(make_phantom(spec), tmp_path / "one")
    header = pydicom.dcmread(next((tmp_path / "one" / "ct").iterdir()))
    assert str(header.GantryDetectorTilt) == "0"
    assert header.PatientPosition == "HFS"
    assert list(header.ImageType) == ["ORIGINAL", "PRIMARY", "AXIAL"]


def test_impossible_scans_are_refused() -> None:
    with pytest.raises(InputError) as error:
        PhantomSpec(patient_position="HFX", slice_plane="coronal", gantry_tilt_rad=0.7)
    assert len(error.value.faults) == 3
