"""A mirrored image is refused along every axis, whatever the markers (H01)."""

from pathlib import Path

import numpy as np
import pytest
from hexafix.errors import ImageRefused
from hexafix.hardware import MarkerLayout, MarkerSite
from hexafix.imaging import Volume, read_volume
from hexafix.kinematics import strut_lengths
from hexafix.markers import find_balls
from hexafix.recognition import number_balls

SPHERES = Path(__file__).resolve().parents[3] / "shared" / "ct-corpus" / "spheres_nrrd"


def random_case(measured, seed, *, raised):
    """A frame with random layouts of three to five balls a ring, its balls and its pose."""
    rng = np.random.default_rng(seed)
    frame = measured.Frame(bone=("tibia", "humerus")[seed % 2])
    document, number = frame.document(), 0
    for ring in ("proximal", "distal"):
        count = int(rng.integers(3, 6))
        gaps = rng.dirichlet(np.full(count, 4.0)) * (359.9 - 46.0 * count) + 46.0
        sites = []
        for sweep in np.cumsum(gaps):
            number += 1
            height = 15.0 + (rng.uniform(0.0, 30.0) if raised else 0.0)
            site = {"number": number, "radius_mm": 85.0, "sweep_deg": float(sweep)}
            sites.append({**site, "height_mm": height})
        document["markers"][ring] = sites
    turn = measured.Pose.from_xyz_fixed(
        position_mm=rng.uniform(-8, 8, 3), angles_rad=np.radians(rng.uniform(-8, 8, 3))
    )
    distal, mechanism = frame.distal_pose @ turn, frame.mechanism @ turn
    poses = {"proximal": distal @ mechanism, "distal": distal}
    points = [poses[r].apply(measured.points_of(document["markers"][r])) for r in poses]
    fixator = measured.read(document).fixator
    document["strut_readings_mm"] = strut_lengths(mechanism, fixator).tolist()
    return document, np.vstack(points)


@pytest.mark.parametrize("raised", [False, True], ids=["coplanar", "out of plane"])
@pytest.mark.parametrize("seed", range(6))
def test_any_frame_that_can_be_planned_is_refused_in_a_mirror(measured, seed, raised):
    document, balls = random_case(measured, seed, raised=raised)
    plain = measured.verdict(document, balls)
    # an ambiguous layout is refused for that, before any mirror
    assert {hazard for hazard, _ in plain} <= {"H18", "H20"}
    middle = balls.mean(axis=0)
    for axis in range(3):
        signs = np.where(np.arange(3) == axis, -1.0, 1.0)
        assert measured.verdict(document, (balls - middle) * signs + middle)


def test_most_of_these_frames_can_be_planned(measured):
    planned = [
        measured.verdict(*random_case(measured, seed, raised=raised)) == []
        for seed in range(6)
        for raised in (False, True)
    ]
    assert np.mean(planned) > 0.6


def layout_of(centers_mm, first_number):
    """A layout in which balls lie as they were found: frame in their best plane."""
    middle = centers_mm.mean(axis=0)
    axes = np.linalg.svd(centers_mm - middle)[2]
    axes[2] = np.cross(axes[0], axes[1])
    x, y, z = ((centers_mm - middle) @ axes.T).T
    columns = zip(np.hypot(x, y), np.arctan2(y, x), z, strict=True)
    return MarkerLayout(
        tuple(MarkerSite(first_number + k, *map(float, row)) for k, row in enumerate(columns))
    )


@pytest.fixture(scope="module")
def a_sphere_image():
    if not SPHERES.is_dir():
        pytest.skip("the third-party CT corpus does not lie beside this checkout")
    return read_volume(SPHERES / "10mmFiducialTest.nrrd")


@pytest.fixture(scope="module")
def its_layouts(a_sphere_image):
    centers = find_balls(a_sphere_image, ball_diameter_mm=20.0).centers_mm
    return {"proximal": layout_of(centers[10:], 1), "distal": layout_of(centers[:5], 6)}


def test_the_spheres_of_a_foreign_image_get_their_numbers(a_sphere_image, its_layouts):
    centers = find_balls(a_sphere_image, ball_diameter_mm=20.0).centers_mm
    numbering = number_balls(centers, **its_layouts)
    assert numbering.proximal.balls == (10, 11, 12, 13, 14)
    assert numbering.distal.balls == (0, 1, 2, 3, 4)


@pytest.mark.parametrize("axis", range(3))
def test_a_mirrored_copy_of_a_foreign_image_under_its_old_header_is_refused(
    a_sphere_image, its_layouts, axis
):
    voxels = np.flip(a_sphere_image.voxels, axis)
    mirrored = Volume(voxels, a_sphere_image.ijk_to_lps, a_sphere_image.source)
    centers = find_balls(mirrored, ball_diameter_mm=20.0).centers_mm
    assert len(centers) == 15
    with pytest.raises(ImageRefused) as caught:
        number_balls(centers, **its_layouts)
    assert [(f.code, f.hazard) for f in caught.value.faults] == [("mirrored-balls", "H01")]
