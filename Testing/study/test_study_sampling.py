"""Monte Carlo: right on average, sure of its error, and the same however it is cut."""

import tracemalloc

import numpy as np
import pytest
from hexafix.accuracy.jacobian import expected_errors
from hexafix.errors import Cancelled, InputError
from hexafix.study import ErrorModel
from hexafix.study.error_model import absolute_covariances, error_maps, exact_covariances
from hexafix.study.jacobians import model_jacobians
from hexafix.study.layouts import three_marker_layouts
from hexafix.study.sampling import BLOCK, LinearKernel, sample_moments


@pytest.fixture(scope="module")
def kernel():
    layouts = three_marker_layouts(15).take(slice(100, None, 2))
    maps = error_maps(model_jacobians(layouts, ErrorModel()), layouts, ErrorModel())
    return LinearKernel(np.ascontiguousarray(maps[:, [0, 2]]), 7 + np.arange(len(layouts)))


@pytest.fixture
def a_few(kernel):
    return kernel.take(slice(0, 5))


def test_sampled_and_exact_agree_within_monte_carlo_error(kernel):
    covariances = exact_covariances(kernel.maps)
    exact, spread = expected_errors(covariances), absolute_covariances(covariances)
    samples = 2 * BLOCK
    found = sample_moments(kernel, samples=samples, seed=5)
    error = np.sqrt(np.diagonal(spread, axis1=-2, axis2=-1) / samples)
    away = (found.mean - exact) / error
    # 84 layouts of 12 figures: normal, so none beyond 5, and a mean square of one
    assert away.size > 900
    assert np.abs(away).max() < 5.0
    assert np.mean(away**2) == pytest.approx(1.0, abs=0.2)
    assert abs(np.mean(away)) < 0.15
    assert np.abs(found.standard_error / error - 1).max() < 0.1
    for part, part_error in zip(
        (slice(0, 3), slice(3, 6)), found.volume_standard_error(), strict=True
    ):
        volume, wanted = (np.linalg.norm(x[..., part], axis=-1) for x in (found.mean, exact))
        assert np.abs((volume - wanted) / part_error).max() < 5.0


def test_the_stated_standard_error_is_the_scatter_between_seeds(a_few):
    runs = [sample_moments(a_few, samples=200, seed=s, workers=1) for s in range(80)]
    scatter = np.std([run.mean for run in runs], axis=0, ddof=1)
    stated = np.mean([run.standard_error for run in runs], axis=0)
    assert np.abs(scatter / stated - 1).max() < 0.35
    for part in (0, 1):
        rows = slice(3 * part, 3 * part + 3)
        volumes = [np.linalg.norm(run.mean[..., rows], axis=-1) for run in runs]
        stated_volume = np.mean([run.volume_standard_error()[part] for run in runs], axis=0)
        assert np.abs(np.std(volumes, axis=0, ddof=1) / stated_volume - 1).max() < 0.35


@pytest.mark.parametrize(
    ("layouts_per_task", "blocks_per_task", "workers"),
    [(1, 1, 1), (2, 3, 2), (5, 2, 3), (100, 100, 1)],
)
def test_the_answer_does_not_depend_on_how_the_work_is_cut(
    a_few, layouts_per_task, blocks_per_task, workers
):
    samples = 5 * BLOCK + 123
    whole = sample_moments(a_few, samples=samples, seed=3, workers=1)
    cut = sample_moments(
        a_few,
        samples=samples,
        seed=3,
        workers=workers,
        layouts_per_task=layouts_per_task,
        blocks_per_task=blocks_per_task,
    )
    assert np.array_equal(whole.mean, cut.mean)
    assert np.array_equal(whole.covariance, cut.covariance)


def test_a_layout_alone_gives_the_same_as_among_others(a_few):
    among = sample_moments(a_few, samples=300, seed=3)
    alone = sample_moments(a_few.take(slice(3, 4)), samples=300, seed=3)
    assert np.array_equal(among.mean[3:4], alone.mean)


def test_blocks_draw_from_spawned_children_of_the_seed(a_few):
    samples = BLOCK + 500
    found = sample_moments(a_few, samples=samples, seed=11)
    stream = np.random.SeedSequence(11).spawn(8)[7]  # the first layout's stream is number 7
    drawn = [
        np.random.Generator(np.random.SFC64(child)).standard_normal((size, 18))
        for child, size in zip(stream.spawn(2), (BLOCK, 500), strict=True)
    ]
    errors = np.abs(np.einsum("maz,kz->kma", a_few.maps[0], np.concatenate(drawn)))
    assert found.mean[0] == pytest.approx(errors.mean(axis=0), rel=1e-12)
    for m in (0, 1):
        assert found.covariance[0, m] == pytest.approx(np.cov(errors[:, m].T), rel=1e-9)


def test_other_seeds_and_other_layouts_draw_other_numbers(a_few):
    one, other = (sample_moments(a_few, samples=100, seed=s).mean for s in (0, 1))
    assert np.all(one != other)
    same = LinearKernel(np.stack([a_few.maps[0]] * 2), np.array([0, 1]))
    found = sample_moments(same, samples=100, seed=0).mean
    assert np.all(found[0] != found[1])


def test_memory_does_not_grow_with_the_sample_count(a_few):
    peaks = []
    for blocks in (20, 160):
        tracemalloc.start()
        sample_moments(
            a_few.take(slice(0, 2)), samples=blocks * BLOCK, seed=0, workers=1, blocks_per_task=2
        )
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    drawn = 160 * BLOCK * 18 * 8
    assert peaks[1] < 1.1 * peaks[0]
    assert peaks[1] < drawn / 50


def test_one_sample_is_refused(a_few):
    with pytest.raises(InputError, match="needs samples"):
        sample_moments(a_few, samples=1, seed=0)


def test_progress_ends_at_one_and_can_stop_the_work(a_few):
    seen = []
    sample_moments(a_few, samples=3 * BLOCK, seed=0, progress=lambda step, f: seen.append(f))
    assert seen == sorted(seen)
    assert seen[-1] == 1.0

    def stop(step, fraction):
        raise Cancelled.of("cancelled", "stopped")

    with pytest.raises(Cancelled):
        sample_moments(a_few, samples=100, seed=0, progress=stop)
