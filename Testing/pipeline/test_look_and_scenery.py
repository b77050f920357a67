"""Image, balls and scene of the first steps; the bone parted for the picture."""

from dataclasses import replace

import numpy as np
import pytest
from hexafix import pipeline
from hexafix.errors import InputError
from hexafix.imaging import Volume
from hexafix.imaging.golden_image_files import golden_image_file
from hexafix.imaging.reading import read_volume
from hexafix.markers import find_balls
from hexafix.report.scene import sample_bone


def test_the_image_is_described_and_a_window_shows_bone_and_balls(a_phantom, a_recognised):
    volume = a_phantom.volume
    document = pipeline.image_document(volume)
    assert document["size_ijk"] == [280, 300, 220]
    assert document["slices"] == 220
    assert document["spacing_mm"] == pytest.approx([1.0, 0.95, 1.3])
    assert document["extent_mm"] == pytest.approx([280.0, 285.0, 286.0])
    assert document["sha256"] == volume.source.sha256
    low = document["level_hu"] - document["window_hu"] / 2
    high = document["level_hu"] + document["window_hu"] / 2
    assert -500.0 < low < 0.0
    cores = [ball.core_hu for ball in a_recognised.balls.balls]
    assert 1000.0 < high < min(cores) + 1200.0


def test_an_image_without_metal_gets_a_window_for_bone():
    voxels = np.full((20, 20, 20), -1000, np.int16)
    voxels[5:15, 5:15, 5:15] = 900
    document = pipeline.image_document(Volume(voxels, np.eye(4)))
    assert document["level_hu"] + document["window_hu"] / 2 == 1500
    assert document["gantry_tilt_deg"] is None
    assert document["warnings"] == []


def test_an_image_is_read_by_the_same_reader(tmp_path):
    suffix, content = golden_image_file("NrrdImageIO")
    path = tmp_path / f"image.{suffix}"
    path.write_bytes(content)
    mine, theirs = pipeline.read_image(path), read_volume(path)
    np.testing.assert_array_equal(mine.voxels, theirs.voxels)
    assert mine.source == theirs.source


def test_a_folder_without_images_has_no_series(tmp_path):
    with pytest.raises(InputError) as error:
        pipeline.image_series(tmp_path)
    assert error.value.faults[0].code == "no-dicom-image"


def test_edits_of_balls_that_were_found_before_need_no_second_search(
    a_phantom, a_recognised, monkeypatch
):
    def never(*_, **__):
        raise AssertionError("searched again")

    monkeypatch.setattr("hexafix.pipeline.look.find_balls", never)
    gone = a_recognised.balls.balls[1].center_mm
    balls = pipeline.find_case_balls(
        a_phantom.volume, ball_diameter_mm=10.0, removed_lps_mm=[gone], found=a_recognised.balls
    )
    assert len(balls.balls) == len(a_recognised.balls.balls) - 1
    reasons = [other["reason"] for other in pipeline.balls_document(balls)["rejected"]]
    assert reasons[0] == "removed by the user"


def test_without_edits_the_balls_are_those_of_the_search(a_phantom):
    cut = np.array(a_phantom.volume.voxels[:, :150])
    volume = Volume(cut, a_phantom.volume.ijk_to_lps)
    mine = pipeline.find_case_balls(volume, ball_diameter_mm=10.0)
    np.testing.assert_array_equal(
        mine.centers_mm, find_balls(volume, ball_diameter_mm=10.0).centers_mm
    )


def test_added_balls_are_marked_in_the_document_and_others_are_not(a_phantom, a_recognised):
    center = a_recognised.balls.balls[0].center_mm
    balls = pipeline.find_case_balls(
        a_phantom.volume,
        ball_diameter_mm=10.0,
        added_lps_mm=[center + 1.0],
        removed_lps_mm=[center],
        found=a_recognised.balls,
    )
    rows = pipeline.balls_document(balls)["balls"]
    assert [row.get("added") for row in rows] == [True] + [None] * (len(rows) - 1)


def test_the_fragments_are_parted_half_way_between_the_rings(a_recognised):
    ends = a_recognised.distal.pose.position_mm, a_recognised.proximal.pose.position_mm
    np.testing.assert_allclose(pipeline.split_point(a_recognised), np.mean(ends, axis=0))
    np.testing.assert_allclose(pipeline.split_point(a_recognised, 0.0), ends[0])
    np.testing.assert_allclose(pipeline.split_point(a_recognised, 1.0), ends[1])
    for fraction in (-0.01, 1.01, float("nan")):
        with pytest.raises(InputError):
            pipeline.split_point(a_recognised, fraction)


@pytest.mark.parametrize("fraction", [0.3, 0.5])
def test_every_voxel_of_the_bone_belongs_to_the_fragment_on_its_side(
    a_plan, a_recognised, fraction
):
    scene = pipeline.scene_of(a_plan.case, a_recognised)
    parts = pipeline.bone_fragments(a_recognised, split_fraction=fraction)
    whole = scene.bone
    k, j, i = np.nonzero(whole.hu > -1000)
    points = np.stack([i, j, k], axis=-1) @ whole.ijk_to_lps[:3, :3].T + whole.ijk_to_lps[:3, 3]
    ends = a_recognised.distal.pose.position_mm, a_recognised.proximal.pose.position_mm
    along = (points - ends[0]) @ (ends[1] - ends[0]) / np.sum((ends[1] - ends[0]) ** 2)
    clear = np.abs(along - fraction) > 1e-4
    for name, here in (("proximal", along > fraction), ("distal", along < fraction)):
        values = parts[name].hu[k, j, i]
        np.testing.assert_array_equal(parts[name].ijk_to_lps, whole.ijk_to_lps)
        np.testing.assert_array_equal(values[here & clear], whole.hu[k, j, i][here & clear])
        assert np.all(values[~here & clear] == -1024)
        assert (values > 250).sum() > 500


def test_the_scene_is_that_of_the_plan_and_its_bone_is_asked_for(a_plan):
    case, recognised = a_plan.case, a_plan.recognised
    plain = pipeline.scene_of(case, recognised, bone=False)
    assert plain.bone is None
    np.testing.assert_allclose(plain.proximal_lps, recognised.proximal.pose.matrix, atol=1e-11)
    numbers = {ball.number: ball.center_mm for ball in plain.balls}
    for number, index in recognised.numbering.ball_of_number.items():
        center = recognised.balls.balls[index].center_mm
        np.testing.assert_allclose(numbers[number], center, atol=1e-8)
    full = pipeline.scene_of(case, recognised)
    np.testing.assert_array_equal(full.bone.hu, sample_bone(recognised.volume, plain).hu)


def test_the_small_pictures_are_those_of_the_prescription(a_plan):
    document = pipeline.plan_document_of(a_plan)
    drawn = pipeline.pictures(document)
    assert set(drawn) == {"layout_proximal", "layout_distal", "strut_curves", "strut_map"}
    assert all(svg.startswith("<svg") and svg.endswith("</svg>") for svg in drawn.values())
    before = pipeline.layout_pictures(a_plan.case.proximal, a_plan.case.distal)
    assert before == {name: drawn[name] for name in ("layout_proximal", "layout_distal")}
    sites = a_plan.case.proximal.sites
    other = replace(a_plan.case.proximal, sites=(replace(sites[0], sweep_rad=0.5), *sites[1:]))
    assert pipeline.layout_pictures(other, a_plan.case.distal) != before
