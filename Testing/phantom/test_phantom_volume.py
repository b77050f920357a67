"""What the volume shows: anatomy, decoys, noise, streaks, clipping; and what is refused."""

import dataclasses

import numpy as np
import pytest
from hexafix.errors import Cancelled, InputError
from hexafix.geometry import Pose
from hexafix.hardware import MarkerLayout
from hexafix.imaging.fingerprint import fingerprint
from hexafix.phantom import Phantom, PhantomSpec, make_phantom
from hexafix.phantom.limb import CORTEX_HU, FAT_HU, MUSCLE_HU
from hexafix.phantom.render import add_noise, noise_response
from hexafix.phantom.scene import build_scene


def hu_near(phantom: Phantom, point_mm, reach: int = 1) -> np.ndarray:
    """Voxels around an LPS point."""
    i, j, k = np.rint(phantom.volume.ijk_from_lps(np.array(point_mm))).astype(int)
    cut = [slice(n - reach, n + reach + 1) for n in (k, j, i)]
    return phantom.volume.voxels[tuple(cut)]


def test_every_decoy_is_dense_where_the_truth_says(a_coarse_phantom: Phantom) -> None:
    decoys = a_coarse_phantom.truth["decoys"]
    kinds = [decoy["kind"] for decoy in decoys]
    assert kinds.count("ball-joint") == 12
    assert {"pin-cap", "hex-nut", "cube", "calcification", "ball-of-another-size"} <= set(kinds)
    for decoy in decoys:
        assert hu_near(a_coarse_phantom, decoy["center_mm"]).max() > 300, decoy
    centers = np.array([d["center_mm"] for d in decoys])
    balls = np.array([b["center_mm"] for b in a_coarse_phantom.truth["balls"]])
    assert np.linalg.norm(centers[:, None] - balls, axis=-1).min() > 14.0


def test_the_limb_holds_bone_muscle_and_fat_on_both_sides_of_the_fracture() -> None:
    spec = PhantomSpec(
        size_ijk=(150, 150, 90),
        spacing_mm=(1.0, 1.1, 2.0),
        noise_hu=0.0,
        decoys=False,
        partial_frame=True,
        image_center_mm=tuple(build_scene(PhantomSpec()).bone_b.position_mm),
    )
    phantom = make_phantom(spec)
    scene = build_scene(spec)
    for bone, z in ((scene.bone_b, -40.0), (scene.bone_a, 45.0)):
        marrow = hu_near(phantom, bone.apply([0.0, 0.0, z]), 0)
        wall = hu_near(phantom, bone.apply([12.5 * 1.09 - 2.1, 0.0, z])).max()
        muscle = hu_near(phantom, bone.apply([0.0, -25.0, z]), 0)
        assert marrow == pytest.approx(40, abs=25)
        assert wall == pytest.approx(CORTEX_HU, abs=120)
        assert muscle == pytest.approx(MUSCLE_HU, abs=10)
    share = np.mean(np.abs(phantom.volume.voxels - FAT_HU) < 15)
    assert 0.01 < share < 0.3


@pytest.mark.parametrize(("correlation", "in_plane", "axial"), [(0.0, 0.0, 0.0), (0.6, 0.36, 0.51)])
def test_noise_has_the_asked_width_and_correlation(a_grid, correlation, in_plane, axial) -> None:
    grid = a_grid((0.65, 0.65, 0.7), 30.0)
    spec = PhantomSpec(noise_hu=40.0, noise_correlation_mm=correlation)
    slab = np.zeros((12, *grid.size_ijk[1::-1]), np.float32)
    add_noise(slab, 0, spec, noise_response(grid, correlation))
    assert slab.mean() == pytest.approx(0.0, abs=1.0)
    assert slab.std() == pytest.approx(40.0, rel=0.02)

    def correlated(first: np.ndarray, second: np.ndarray) -> float:
        return float(np.corrcoef(first.ravel(), second.ravel())[0, 1])

    assert correlated(slab[:, 1:], slab[:, :-1]) == pytest.approx(in_plane, abs=0.08)
    assert correlated(slab[1:], slab[:-1]) == pytest.approx(axial, abs=0.03)
    again = np.zeros_like(slab[4:8])
    add_noise(again, 4, spec, noise_response(grid, correlation))
    np.testing.assert_array_equal(again, slab[4:8])


def test_metal_is_clipped_where_the_scanner_ends(a_crop) -> None:
    spec = a_crop(1, ball_hu=8000.0)
    clipped = make_phantom(spec).volume.voxels
    open_end = make_phantom(dataclasses.replace(spec, clip_hu=None)).volume.voxels
    assert clipped.max() == 3071
    assert open_end.max() == pytest.approx(8000, abs=2)
    np.testing.assert_array_equal(clipped, np.minimum(open_end, 3071))


def test_streaks_add_dark_and_bright_bands_between_metal(a_coarse_spec, a_coarse_phantom) -> None:
    plain = make_phantom(dataclasses.replace(a_coarse_spec, streak_hu=0.0))
    change = a_coarse_phantom.volume.voxels.astype(int) - plain.volume.voxels
    assert change.min() < -60
    assert change.max() > 60
    assert np.mean(change != 0) < 0.3


def test_voxels_do_not_depend_on_the_number_of_threads(a_coarse_spec, a_coarse_phantom) -> None:
    again = make_phantom(a_coarse_spec, workers=1)
    np.testing.assert_array_equal(again.volume.voxels, a_coarse_phantom.volume.voxels)
    assert again.truth == a_coarse_phantom.truth
    volume = a_coarse_phantom.volume
    assert volume.source.sha256 == fingerprint(volume.voxels, volume.ijk_to_lps)


def test_another_seed_gives_other_noise_and_other_installation_errors(a_coarse_spec) -> None:
    small = dataclasses.replace(
        a_coarse_spec, size_ijk=(60, 60, 20), partial_frame=True, image_center_mm=(0.0, 0.0, 0.0)
    )
    one, other = (make_phantom(dataclasses.replace(small, seed=seed)) for seed in (1, 2))
    assert np.mean(one.volume.voxels != other.volume.voxels) > 0.5
    assert one.truth["balls"][0] != other.truth["balls"][0]


def test_the_work_can_be_stopped(a_coarse_spec) -> None:
    steps = []

    def stop(step: str, fraction: float) -> None:
        steps.append(fraction)
        if len(steps) == 2:
            raise Cancelled.of("cancelled", "stopped by the user")

    with pytest.raises(Cancelled):
        make_phantom(a_coarse_spec, progress=stop)
    assert len(steps) == 2


def test_a_ball_outside_the_volume_is_refused_by_number() -> None:
    with pytest.raises(InputError, match="ball 8 does not lie wholly in the volume"):
        make_phantom(PhantomSpec(size_ijk=(100, 100, 40)))


def test_a_ball_in_a_strut_is_refused() -> None:
    layout = MarkerLayout.of(
        radius_mm=(94.0, 100.0, 100.0),
        sweep_deg=(48.0, 120.0, 240.0),
        height_mm=(20, 20, 20),
        first_number=5,
    )
    with pytest.raises(InputError, match="ball 5 would sit in a strut"):
        make_phantom(PhantomSpec(distal=layout))


@pytest.mark.parametrize("which", ["mechanism_pose", "target_pose"])
def test_a_strut_out_of_its_stroke_is_refused(which: str) -> None:
    far = Pose(np.eye(3), np.array([0.0, 0.0, 270.0]))
    with pytest.raises(InputError, match="strut 1 would be out of its stroke"):
        make_phantom(PhantomSpec(**{which: far}))


def test_a_wrong_spec_names_every_fault_at_once() -> None:
    with pytest.raises(InputError) as caught:
        PhantomSpec(ring_material="wood", psf_sigma_mm=0.0, noise_hu=-1.0, strut_typo=(7, 1.0))
    text = str(caught.value)
    assert all(word in text for word in ("ring_material", "psf_sigma_mm", "noise_hu", "strut_typo"))
    with pytest.raises(InputError, match="on both rings"):
        PhantomSpec(distal=PhantomSpec().proximal)
