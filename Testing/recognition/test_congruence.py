from itertools import combinations, permutations

import numpy as np
import pytest
from hexafix.recognition.congruence import embeddings, spread_order
from hexafix.recognition.partial_match import matched_count
from scipy.spatial.transform import Rotation


def best_fit_rms(points: np.ndarray, layout: np.ndarray) -> float:
    """RMS by another library's rotation fit."""
    a, b = points - points.mean(axis=0), layout - layout.mean(axis=0)
    return float(Rotation.align_vectors(a, b)[1] / np.sqrt(len(a)))


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("count", [3, 4])
def test_the_search_lists_exactly_what_trying_everything_finds(seed, count):
    rng = np.random.default_rng(seed)
    layout = rng.uniform(-60, 60, (count, 3))
    points = np.vstack(
        [layout + rng.normal(size=layout.shape), rng.uniform(-60, 60, (7 - count, 3))]
    )
    everything = {
        order: rms
        for subset in combinations(range(7), count)
        for order in permutations(subset)
        if (rms := best_fit_rms(points[list(order)], layout)) <= 20.0
    }
    found = embeddings(points_mm=points, layout_mm=layout, max_rms_mm=20.0)
    assert found.complete
    listed = {tuple(map(int, b)): r for b, r in zip(found.balls, found.rms_mm, strict=True)}
    assert listed.keys() == everything.keys()
    assert len(listed) > 1
    assert all(listed[k] == pytest.approx(everything[k], abs=1e-6) for k in listed)
    assert np.all(np.diff(found.rms_mm) >= 0)


def test_the_mirrored_search_finds_only_the_mirrored_layout():
    rng = np.random.default_rng(9)
    layout = rng.uniform(-60, 60, (5, 3))
    mirrored = layout * [-1, 1, 1] + [5.0, 6.0, 7.0]
    proper = embeddings(points_mm=mirrored, layout_mm=layout, max_rms_mm=0.5)
    turned = embeddings(points_mm=mirrored, layout_mm=layout, max_rms_mm=0.5, mirrored=True)
    assert len(proper) == 0
    assert turned.balls.tolist() == [[0, 1, 2, 3, 4]]


def test_a_search_that_is_cut_short_says_so():
    phi = np.arange(16) * 2 * np.pi / 16
    ring = 100 * np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=-1)
    assert embeddings(points_mm=ring, layout_mm=ring, max_rms_mm=1.0).complete
    short = embeddings(points_mm=ring, layout_mm=ring, max_rms_mm=60.0, max_partial=500)
    assert not short.complete


def test_markers_are_placed_the_best_spread_first():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [10, 0, 0], [5, 8, 0]])
    order = spread_order(points)
    assert set(order[:2].tolist()) == {0, 2}
    assert order.tolist()[2:] == [3, 1]


@pytest.mark.parametrize(("kept", "expected"), [(5, 5), (4, 4), (3, 3), (2, 2), (1, 1), (0, 0)])
def test_the_markers_present_are_counted(kept, expected):
    rng = np.random.default_rng(10)
    layout = rng.uniform(-90, 90, (6, 3))
    turn = Rotation.random(rng=rng).as_matrix()
    points = layout[:kept] @ turn.T + [10, 20, 30]
    assert matched_count(points, layout, limit_mm=0.5) == expected
