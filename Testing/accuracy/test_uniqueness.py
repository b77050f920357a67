from itertools import permutations

import numpy as np
import pytest
from hexafix.accuracy import uniqueness
from hexafix.accuracy.uniqueness import (
    best_exchange,
    best_relabelling,
    mirror_rms_mm,
    numberings_around,
    wrong_numberings,
)
from hexafix.hardware import MarkerLayout
from scipy.spatial.transform import Rotation


def best_fit_rms(points: np.ndarray, layout: np.ndarray) -> float:
    a, b = points - points.mean(axis=0), layout - layout.mean(axis=0)
    return float(Rotation.align_vectors(a, b)[1] / np.sqrt(len(a)))


def every(count: int, itself: bool) -> list[list[int]]:
    return [
        list(p) for p in permutations(range(count)) if not (itself and p == tuple(range(count)))
    ]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [3, 4, 5])
def test_uniqueness_is_that_of_trying_every_numbering(layout_at, seed, count):
    rng = np.random.default_rng(seed)
    one, other = (
        layout_at(
            np.arange(count) * 360 / count + rng.uniform(-12, 12, count),
            height_mm=rng.uniform(0, 30, count),
        )
        for _ in range(2)
    )
    r, q = one.points_mm, other.points_mm
    found, order = best_relabelling(one)
    assert found == pytest.approx(min(best_fit_rms(r[p], r) for p in every(count, True)), abs=1e-5)
    assert best_fit_rms(r[list(order)], r) == pytest.approx(found, abs=1e-5)
    exchange = min(best_fit_rms(r[p], q) for p in every(count, False))
    assert best_exchange(one, other)[0] == pytest.approx(exchange, abs=1e-5)
    mirror = min(best_fit_rms(r[p], r * [1, 1, -1]) for p in every(count, False))
    assert mirror_rms_mm(one) == pytest.approx(mirror, abs=1e-5)


def test_figures_of_the_hazard_table(layout_at):
    # 105/130/125 at 80 mm: two numbers exchanged 2.14 mm; turned by one 10.97 mm.
    layout = layout_at([0, 105, 235], radius_mm=80.0, height_mm=12.0)
    rms, order = best_relabelling(layout)
    assert rms == pytest.approx(2.14, abs=0.01)
    assert sorted(order) == [0, 1, 2]
    assert sum(k != place for place, k in enumerate(order)) == 2
    r = layout.points_mm
    assert best_fit_rms(r[[1, 2, 0]], r) == pytest.approx(10.97, abs=0.01)


def test_an_even_ring_is_not_unique_and_0_105_225_is_by_8_mm(layout_at):
    assert best_relabelling(layout_at([0, 120, 240]))[0] < 1e-9
    assert best_relabelling(layout_at([0, 105, 225]))[0] == pytest.approx(8.01, abs=0.01)


def test_three_balls_cannot_show_a_mirror_and_a_fourth_out_of_plane_can(layout_at):
    assert mirror_rms_mm(layout_at([0, 105, 225], height_mm=[20, 25, 40])) < 1e-9
    four = layout_at([0, 80, 170, 260], height_mm=[20, 20, 20, 45])
    assert mirror_rms_mm(four) > 5.0


def test_a_ring_turned_about_its_axis_is_taken_for_the_other(layout_at):
    one, other = layout_at([0, 105, 225]), layout_at([40, 145, 265], height_mm=-10.0)
    assert best_exchange(one, other)[0] < 1e-9
    assert best_exchange(one, layout_at([40, 145, 250]))[0] > 5.0


def test_for_three_markers_the_likely_wrong_numberings_are_all(layout_at):
    tried = wrong_numberings(np.radians([[10.0, 250.0, 100.0]]))[0]
    assert {tuple(p) for p in tried} == {tuple(p) for p in every(3, True)}
    around = np.array([[0, 2, 1]])
    assert {tuple(p) for p in numberings_around(around, around)[0]} == {
        tuple(p) for p in every(3, False)
    }


def test_many_even_markers_end_with_a_lower_bound_and_not_in_an_endless_search():
    layout = MarkerLayout.of(
        radius_mm=[100.0] * 16, sweep_deg=np.arange(16) * 22.5, height_mm=[20.0] * 16
    )
    assert best_relabelling(layout)[0] < 1e-9


def test_a_search_cut_short_states_a_lower_bound(layout_at, monkeypatch):
    # even but for a few degrees: the likely wrong numberings miss by far more than 10 mm
    rng = np.random.default_rng(2)
    layout = layout_at(
        np.arange(9) * 40.0 + rng.uniform(-12, 12, 9),
        radius_mm=rng.uniform(70, 130, 9),
        height_mm=rng.uniform(0, 40, 9),
    )
    whole = best_relabelling(layout)[0]
    assert whole > 10.0
    for work in (50, 12, 1):
        monkeypatch.setattr(uniqueness, "WORK", work)
        assert best_relabelling(layout)[0] in uniqueness.FALLBACK_MM, (work, whole)
