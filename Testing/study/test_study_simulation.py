"""The full simulation recognises what it built, and its control variate tells the truth."""

import numpy as np
import pytest
from hexafix.accuracy.jacobian import expected_errors
from hexafix.recognition import ring_pose, ring_pose_by_groups
from hexafix.study import ErrorModel, StudySettings
from hexafix.study.error_model import error_maps, exact_covariances
from hexafix.study.estimates import estimate, volumes
from hexafix.study.jacobians import model_jacobians
from hexafix.study.layouts import RingLayouts
from hexafix.study.sampling import sample_moments
from hexafix.study.simulation import FullKernel

ANISOTROPIC = ErrorModel((0.2, 0.3, 0.5), (0.05, 0.1, 0.15))


def full_kernel(sweeps, errors, heights=(20.0, -30.0, 25.0)):
    layouts = RingLayouts(
        np.full((len(sweeps), 3), 95.0), np.radians(sweeps), np.tile(heights, (len(sweeps), 1))
    )
    maps = error_maps(model_jacobians(layouts, errors), layouts, errors)
    return FullKernel(layouts, errors, maps[:, 1:], np.arange(len(layouts)))


def sampled(kernel, normals):
    out = np.empty((len(normals), 24))
    kernel.sample(0, normals, out)
    return out.reshape(-1, 4, 6)


def test_each_sample_is_a_ring_built_measured_and_recognised():
    kernel = full_kernel([[0, 70, 200]], ANISOTROPIC)
    normals = np.random.default_rng(4).normal(size=(6, 18))
    found = sampled(kernel, normals)
    layout = kernel.layouts.layout(0)
    covariances = np.tile(np.diag(np.square(ANISOTROPIC.image_sigma_mm)), (3, 1, 1))
    for k, draw in enumerate(normals.reshape(6, 3, 6)):
        believed = layout.points_mm
        true = believed - draw[:, 3:] * ANISOTROPIC.installation_sigma_mm
        balls = true + draw[:, :3] * ANISOTROPIC.image_sigma_mm
        options = {
            "covariances_mm2": covariances,
            "installation_sigma_mm": ANISOTROPIC.installation_sigma_mm,
        }
        for m, recognise in enumerate((ring_pose_by_groups, ring_pose)):
            pose = recognise(balls, layout, **options).pose
            wanted = np.abs([*pose.position_mm, *pose.angles_rad])
            assert found[k, m] == pytest.approx(wanted, rel=1e-7, abs=1e-12)


def test_small_errors_leave_no_difference_from_the_linear_model():
    normals = np.random.default_rng(5).normal(size=(50, 18))
    rest = []
    for scale in (1e-2, 1e-3):
        errors = ErrorModel((0.3 * scale,) * 3, (0.07 * scale,) * 3)
        found = sampled(full_kernel([[0, 70, 200]], errors), normals)
        rest.append(np.abs(found[:, 2:]).max() / found[:, :2].max())
    assert rest[0] < 1e-3
    assert rest[1] < 0.2 * rest[0]


def test_the_control_variate_is_truer_than_the_plain_mean_and_agrees_with_it():
    kernel = full_kernel([[0, 45, 90]], ErrorModel(), heights=(20.0, 20.0, 20.0))
    few = sample_moments(kernel, samples=300, seed=1)
    many = sample_moments(kernel, samples=30_000, seed=2)
    exact = expected_errors(exact_covariances(kernel.maps))
    controlled = exact + few.mean[:, 2:]
    assert np.all(few.standard_error[:, 2:] < 0.25 * few.standard_error[:, :2])
    error = np.hypot(few.standard_error[:, 2:], many.standard_error[:, :2])
    assert np.abs((controlled - many.mean[:, :2]) / error).max() < 4.5


def test_a_turned_layout_has_the_same_volume_error():
    settings = StudySettings(samples=100, full_samples=4000, workers=1)
    one, other = (
        estimate(RingLayouts.of([sweep]), settings, stream=k)
        for k, sweep in enumerate(([0, 50, 150], [0, 100, 310]))
    )
    for part in (0, 1):
        assert volumes(one.exact)[part] == pytest.approx(volumes(other.exact)[part], rel=1e-12)
        error = np.hypot(one.full_volume_error[part], other.full_volume_error[part])
        gap = volumes(one.full)[part] - volumes(other.full)[part]
        assert np.abs(gap / error).max() < 4.5
        assert np.all(error < 0.005 * volumes(one.full)[part])


def test_turned_layouts_share_a_simulation_only_where_every_side_is_alike():
    sweeps = [[0, 50, 150], [0, 100, 310], [0, 210, 260]]
    few = {"samples": 10, "full_samples": 10, "workers": 1}
    alike = estimate(RingLayouts.of(sweeps), StudySettings(**few)).full
    assert np.array_equal(alike[0], alike[1])
    assert np.array_equal(alike[0], alike[2])
    apart = estimate(RingLayouts.of(sweeps), StudySettings(**few, errors=ANISOTROPIC)).full
    assert np.all(apart[0] != apart[1])


def test_layouts_that_recognition_refuses_have_no_full_figure():
    settings = StudySettings(samples=10, full_samples=10, workers=1)
    found = estimate(RingLayouts.of([[0, 5, 10], [0, 105, 225], [0, 5, 180]]), settings)
    assert np.isnan(found.full[[0, 2]]).all()
    assert np.isfinite(found.full[1]).all()
    assert np.isfinite(found.exact).all()
    flat = estimate(RingLayouts.of([[0, 5, 10]]), settings)
    assert np.isnan(flat.full).all()


def test_the_full_simulation_of_a_raised_ring_tells_the_tilt_that_the_paper_leaves_out():
    found = estimate(RingLayouts.of([[0, 120, 240]]), StudySettings(samples=10, workers=1))
    alpha = np.degrees([found.exact[0, 0, 3], found.full[0, 0, 3]])
    assert alpha == pytest.approx([0.112, 0.115], abs=0.0006)
