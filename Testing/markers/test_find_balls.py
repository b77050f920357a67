from __future__ import annotations

import itertools

import numpy as np
import pytest
from hexafix.errors import Cancelled, InputError
from hexafix.imaging.volume import Volume
from hexafix.markers import find_balls


def distance_to(found, place) -> float:
    return min((float(np.linalg.norm(b.center_mm - place)) for b in found.balls), default=np.inf)


def test_a_ball_with_its_rod_is_found_and_nothing_else(crop_with_ball):
    for seed in range(4):
        volume, truth = crop_with_ball(seed)
        found = find_balls(volume, ball_diameter_mm=10.0)
        assert len(found.balls) == 1
        assert distance_to(found, truth.center_mm) < 0.02
        assert abs(found.balls[0].diameter_mm - 10.0) < 0.03
        assert found.balls[0].method == "gradient-rays"
        assert found.balls[0].warnings == ()


@pytest.mark.parametrize("sought", [8.0, 12.0])
def test_a_ball_of_another_size_is_rejected_for_its_radius(crop_with_ball, sought):
    volume, truth = crop_with_ball(5)
    found = find_balls(volume, ball_diameter_mm=sought)
    assert found.balls == ()
    nearest = min(found.rejected, key=lambda r: np.linalg.norm(r.center_mm - truth.center_mm))
    assert np.linalg.norm(nearest.center_mm - truth.center_mm) < 1.0
    assert nearest.reason.startswith("radius: ")
    assert "limit" in nearest.reason


def test_a_ball_cut_by_the_border_is_rejected_naming_the_border(workbench):
    bench = workbench()
    bench.ball((-10.0, 0.0, 0.0))
    bench.ball((20.5, 0.0, 0.0))
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert len(found.balls) == 1
    assert distance_to(found, bench.lps((-10.0, 0.0, 0.0))) < 0.03
    reasons = [
        r.reason
        for r in found.rejected
        if np.linalg.norm(r.center_mm - bench.lps((20.5, 0, 0))) < 2
    ]
    assert len(reasons) == 1
    assert reasons[0].startswith("border: ")


def test_a_ball_that_touches_a_ring_is_found(crop_with_ball):
    for seed, gap in ((0, 0.0), (1, 0.0), (2, 0.3), (3, 1.0)):
        volume, truth = crop_with_ball(seed, half_width_mm=16.0, ring_gap_mm=gap)
        found = find_balls(volume, ball_diameter_mm=10.0)
        assert len(found.balls) == 1
        assert distance_to(found, truth.center_mm) < 0.06


def test_two_touching_balls_are_two_and_never_averaged(workbench):
    bench = workbench()
    places = (-5.0, 0.3, 0.2), (5.0, 0.3, 0.2)
    for place in places:
        bench.ball(place)
    found = find_balls(bench.volume(), ball_diameter_mm=10.0)
    assert len(found.balls) == 2
    for place in places:
        assert distance_to(found, bench.lps(place)) < 0.08


def test_permuted_reversed_and_left_handed_voxels_give_the_same_ball(crop_with_ball):
    volume, _ = crop_with_ball(7)
    reference = find_balls(volume, ball_diameter_mm=10.0).balls[0]
    orders = [(0, 1, 2), (2, 0, 1), (1, 0, 2)]
    for order, flips in itertools.product(orders, [(0, 0, 0), (1, 0, 0), (1, 1, 1)]):
        voxels = volume.voxels.transpose(2, 1, 0).transpose(order)
        affine = np.eye(4)
        affine[:3, :3] = volume.ijk_to_lps[:3, order]
        affine[:3, 3] = volume.ijk_to_lps[:3, 3]
        for axis, flip in enumerate(flips):
            if flip:
                affine[:3, 3] += affine[:3, axis] * (voxels.shape[axis] - 1)
                affine[:3, axis] *= -1.0
                voxels = np.flip(voxels, axis)
        turned = Volume(voxels.transpose(2, 1, 0), affine)
        (ball,) = find_balls(turned, ball_diameter_mm=10.0).balls
        assert np.linalg.norm(ball.center_mm - reference.center_mm) < 2e-3
        np.testing.assert_allclose(
            ball.covariance_mm2, reference.covariance_mm2, rtol=0.5, atol=4e-6
        )


def test_voxels_may_be_floats(crop_with_ball):
    volume, _ = crop_with_ball(8)
    whole = find_balls(volume, ball_diameter_mm=10.0).balls[0]
    floats = Volume(volume.voxels.astype(np.float32), volume.ijk_to_lps)
    (ball,) = find_balls(floats, ball_diameter_mm=10.0).balls
    np.testing.assert_allclose(ball.center_mm, whole.center_mm, atol=1e-6)


def test_a_ball_fainter_than_aluminium_is_found_without_a_threshold(crop_with_ball):
    for hu in (900.0, 1500.0):
        volume, truth = crop_with_ball(9, ball_hu=hu, tissue_gap_mm=2.0)
        found = find_balls(volume, ball_diameter_mm=10.0)
        assert len(found.balls) == 1
        assert distance_to(found, truth.center_mm) < 0.03


def test_a_clipped_steel_ball_is_fitted_by_its_edges_and_warned_about(crop_with_ball):
    volume, truth = crop_with_ball(10, ball_hu=8000.0)
    (ball,) = find_balls(volume, ball_diameter_mm=10.0).balls
    assert np.linalg.norm(ball.center_mm - truth.center_mm) < 0.02
    assert any("clipped" in warning and "H11" in warning for warning in ball.warnings)


def test_thick_slices_take_the_model_fit_and_are_warned_about(crop_with_ball):
    volume, truth = crop_with_ball(11, half_width_mm=14.0, spacing_mm=(0.7, 0.7, 2.5))
    found = find_balls(volume, ball_diameter_mm=10.0)
    assert [ball.method for ball in found.balls] == ["model-fit"]
    assert distance_to(found, truth.center_mm) < 0.05
    assert any("2.50 mm apart" in warning for warning in found.warnings)


def test_a_flat_image_holds_no_ball():
    volume = Volume(np.full((30, 30, 30), -1000, np.int16), np.eye(4))
    found = find_balls(volume, ball_diameter_mm=10.0)
    assert found.balls == ()
    assert found.centers_mm.shape == (0, 3)


def test_noise_alone_holds_no_ball():
    voxels = np.random.default_rng(0).normal(0.0, 40.0, (60, 60, 60)).astype(np.int16)
    assert find_balls(Volume(voxels, np.eye(4)), ball_diameter_mm=8.0).balls == ()


@pytest.mark.parametrize("diameter", [0.0, -3.0, np.nan, 1.5])
def test_a_diameter_that_cannot_be_measured_is_an_input_error(crop_with_ball, diameter):
    volume, _ = crop_with_ball(0)
    with pytest.raises(InputError, match="diameter"):
        find_balls(volume, ball_diameter_mm=diameter)


def test_the_user_can_stop_the_search(crop_with_ball):
    volume, _ = crop_with_ball(0)

    def stop(step: str, fraction: float) -> None:
        raise Cancelled.of("cancelled", "stopped")

    with pytest.raises(Cancelled):
        find_balls(volume, ball_diameter_mm=10.0, progress=stop)
