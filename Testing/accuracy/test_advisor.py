"""The advised layouts: exact against brute force, buildable, unique, and no worse than before."""

from itertools import combinations, permutations, product

import numpy as np
import pytest
from hexafix.accuracy import advisor, angle_rule, check_layouts, layout_faults
from hexafix.accuracy.advised import AdviceRules, RingTask, assess
from hexafix.accuracy.advisor import advise
from hexafix.accuracy.joint_error import ErrorTarget, place_error, unit_square_errors
from hexafix.accuracy.layout_candidates import list_candidates
from hexafix.accuracy.layout_search import (
    assignment_rms_mm,
    every_order,
    feasible,
    keep_margins,
    orders_around,
)
from hexafix.errors import InputError, LayoutRejected
from hexafix.hardware import HoleCircle, MarkerLayout, MarkerSite, SiteList, shipped_fixator
from hexafix.recognition import ring_poses
from hexafix.recognition.rigid import rigid_rms_mm
from hypothesis import given, settings
from hypothesis import strategies as st

RULES = AdviceRules()
TARGET = ErrorTarget.of_radius(100.0)


def task(places, count, name="proximal", present=None, first_number=1):
    target = ErrorTarget.of_radius(100.0, name if name == "distal" else "proximal")
    return RingTask(name, places, count, target, present, first_number)


# --- the oracle: every layout one by one, nothing of the advisor's own ---


def key(holes, heights, count):
    """The same for turned and reflected copies: the smallest picture of the ring as a row."""
    row = [None] * count
    for hole, height in zip(holes, heights, strict=True):
        row[hole] = height
    rows = [[row[(s * k + t) % count] for k in range(count)] for s in (1, -1) for t in range(count)]
    return min(tuple(-1.0 if h is None else h for h in r) for r in rows)


def exact_error(points, side=-1.0):
    """RMS at six joints and the bone from the inverse of the normal equations."""
    skews = np.array([[[0, -z, y], [z, 0, -x], [-y, x, 0]] for x, y, z in points])
    jacobian = np.concatenate([np.broadcast_to(np.eye(3), skews.shape), -skews], axis=2)
    normal = np.einsum("nia,nib->ab", jacobian, jacobian) / RULES.sigma_mm**2
    covariance = np.linalg.inv(normal)

    def square(q):
        x, y, z = q
        lever = np.hstack([np.eye(3), -np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])])
        return np.trace(lever @ covariance @ lever.T)

    turn = np.arange(6) * np.pi / 3 + 0.3
    joints = np.mean([square((100 * np.cos(a), 100 * np.sin(a), 0.0)) for a in turn])
    return np.sqrt((joints + square((0, 0, side * 90.0))) / 2)


def smallest_rms(points, layout, orders, mirrored=False):
    rms = rigid_rms_mm(
        points_mm=points[..., orders, :], layout_mm=layout[..., None, :, :], mirrored=mirrored
    )
    return rms.min(axis=-1)


def all_layouts(circle, count, *, mirror, side=-1.0):
    """Error, points and key of every layout that keeps the rules, best first."""
    orders = np.array(list(permutations(range(count))))
    patterns = list(product(circle.heights_mm, repeat=count))
    found = []
    free = [k for k in range(circle.count) if k + 1 not in circle.occupied]
    for holes in combinations(free, count):
        sweeps = [360.0 * k / circle.count + np.degrees(circle.offset_rad) for k in holes]
        layouts = [
            MarkerLayout.of(radius_mm=[circle.radius_mm] * count, sweep_deg=sweeps, height_mm=h)
            for h in patterns
        ]
        points = np.array([layout.points_mm for layout in layouts])
        apart = min(np.linalg.norm(a - b) for a, b in combinations(points[0, :, :2], 2))
        if angle_rule(layouts[0]) != "preferred" or apart < RULES.spacing_mm:
            continue
        kept = smallest_rms(points, points, orders[1:]) >= RULES.margin_mm
        if mirror:
            kept &= smallest_rms(points, points, orders, mirrored=True) >= 5.0
        found += [
            (exact_error(points[k], side), points[k], key(holes, patterns[k], circle.count))
            for k in np.flatnonzero(kept)
        ]
    return sorted(found, key=lambda row: row[0])


def each_once(layouts):
    seen, errors = set(), []
    for error, _, name in layouts:
        if name not in seen:
            seen.add(name)
            errors.append(error)
    return errors


SMALL = {
    3: HoleCircle(14, 100.0, np.radians(7.0), (20.0, 45.0), occupied=(2, 5, 6)),
    4: HoleCircle(11, 100.0, np.radians(-3.0), (20.0, 45.0), occupied=(4, 8)),
    5: HoleCircle(8, 100.0, 0.0, (10.0, 45.0), occupied=(3,)),
}


@pytest.mark.parametrize("count", SMALL)
def test_the_ranking_is_that_of_trying_every_layout(count):
    circle, rules = SMALL[count], RULES
    wanted = each_once(all_layouts(circle, count, mirror=count > 3))
    assert len(wanted) > 10
    found = advise([task(circle, count)], top=8)
    errors = [proposal.error_mm for proposal in found.proposals]
    assert errors == pytest.approx(wanted[:8], rel=1e-9)
    candidates = list_candidates(circle, count, TARGET, spacing_mm=rules.spacing_mm)
    every = feasible(candidates, margin_mm=rules.margin_mm, mirror_mm=5.0 if count > 3 else None)
    units = [item.unit_error_mm * rules.sigma_mm for item in every]
    assert units == pytest.approx(wanted, rel=1e-9)


def test_the_best_pairs_are_those_of_trying_every_pair():
    first = HoleCircle(11, 100.0, 0.1, (20.0,), occupied=(3,))
    second = HoleCircle(10, 100.0, 0.0, (20.0,))
    lists = [all_layouts(first, 3, mirror=False), all_layouts(second, 3, mirror=False, side=1.0)]
    orders = np.array(list(permutations(range(3))))
    wanted = {}
    for (ea, a, ka), (eb, b, kb) in product(*lists):
        if (ka, kb) not in wanted and smallest_rms(a, b, orders) >= RULES.margin_mm:
            wanted[ka, kb] = np.hypot(ea, eb)
    assert len(wanted) < len({(a[2], b[2]) for a, b in product(*lists)})  # some are alike
    found = advise([task(first, 3), task(second, 3, "distal", first_number=4)], top=len(wanted))
    errors = [proposal.error_mm for proposal in found.proposals]
    assert errors == pytest.approx(sorted(wanted.values()), rel=1e-9)
    assert all(proposal.exchange_mm >= RULES.margin_mm for proposal in found.proposals)


def test_pairs_are_the_best_however_few_are_looked_at_first(monkeypatch):
    # The first ring's errors rise in large steps, the second's in small ones.
    rings = HoleCircle(12, 100.0, heights_mm=(20.0,)), HoleCircle(36, 100.0, heights_mm=(20.0,))
    tasks = [task(rings[0], 3), task(rings[1], 3, "distal", first_number=4)]
    found = []
    for first in (512, 3):
        monkeypatch.setattr(advisor, "FIRST_PAIRED", first)
        found.append([proposal.error_mm for proposal in advise(tasks, top=6).proposals])
    assert found[1] == pytest.approx(found[0], rel=1e-12)


def test_a_given_other_ring_is_kept_apart_from():
    circle = HoleCircle(12, 100.0, 0.0, (20.0,))
    alone = advise([task(circle, 3)], top=1).proposals[0]
    other = alone.rings[0].layout
    apart = advise([task(circle, 3)], top=1, other=other).proposals[0]
    assert apart.exchange_mm >= RULES.margin_mm
    assert apart.error_mm > alone.error_mm
    orders = np.array(list(permutations(range(3))))
    wanted = min(
        error
        for error, points, _ in all_layouts(circle, 3, mirror=False)
        if smallest_rms(points, other.points_mm, orders) >= RULES.margin_mm
    )
    assert apart.error_mm == pytest.approx(wanted, rel=1e-9)


def test_a_list_of_sites_gives_what_the_same_holes_give():
    circle = HoleCircle(12, 95.0, 0.0, (20.0, 45.0), occupied=(1,))
    sites = tuple(
        MarkerSite(1, 95.0, float(phi), height)
        for phi in circle.sweep_rad[circle.free]
        for height in circle.heights_mm
    )
    by_holes = advise([task(circle, 3)], top=4)
    by_sites = advise([task(SiteList(sites), 3)], top=40)
    found = sorted({round(p.error_mm, 8) for p in by_sites.proposals})
    wanted = sorted({round(p.error_mm, 8) for p in by_holes.proposals})
    assert len(found) > 1
    assert all(a == b for a, b in zip(found, wanted, strict=False))


# --- what every advised layout keeps ---

RINGS = st.builds(
    HoleCircle,
    count=st.integers(12, 30),
    radius_mm=st.floats(70.0, 130.0),
    offset_rad=st.floats(-3.0, 3.0),
    heights_mm=st.sampled_from([(20.0,), (20.0, 45.0), (12.0, 30.0, 50.0)]),
    occupied=st.sets(st.integers(1, 12), max_size=4).map(tuple),
)


@settings(max_examples=12, deadline=None)
@given(first=RINGS, second=RINGS, counts=st.tuples(st.integers(3, 5), st.integers(3, 5)))
def test_no_gate_refuses_an_advised_pair(first, second, counts):
    tasks = [task(first, counts[0]), task(second, counts[1], "distal", first_number=6)]
    for proposal in advise(tasks, top=2).proposals:
        layouts = [ring.layout for ring in proposal.rings]
        check = check_layouts(*layouts)
        assert layout_faults(check) == ()
        for layout, ring, circle in zip(layouts, proposal.rings, (first, second), strict=True):
            assert not set(ring.places) & set(circle.occupied)
            assert {site.height_mm for site in layout.sites} <= set(circle.heights_mm)
            t = circle.radius_mm
            phi = circle.sweep_rad[np.array(ring.places) - 1]
            across = np.stack([t * np.cos(phi), t * np.sin(phi)], axis=-1)
            assert layout.points_mm[:, :2] == pytest.approx(across, abs=1e-6)
            gaps = [np.linalg.norm(a - b) for a, b in combinations(across, 2)]
            assert min(gaps) >= RULES.spacing_mm - 1e-6


@settings(max_examples=10, deadline=None)
@given(circle=RINGS, turn=st.floats(-6.0, 6.0), count=st.integers(3, 4))
def test_turning_the_whole_ring_changes_nothing(circle, turn, count):
    turned = HoleCircle(
        circle.count, circle.radius_mm, circle.offset_rad + turn, circle.heights_mm, circle.occupied
    )
    one, two = (advise([task(c, count)], top=4).proposals for c in (circle, turned))
    assert [p.error_mm for p in one] == pytest.approx([p.error_mm for p in two], rel=1e-9)
    for a, b in zip(one, two, strict=True):
        assert a.rings[0].places == b.rings[0].places
        assert a.rings[0].verdict.uniqueness_mm == pytest.approx(
            b.rings[0].verdict.uniqueness_mm, abs=1e-6
        )


@settings(max_examples=8, deadline=None)
@given(circle=RINGS, count=st.integers(3, 4), seed=st.integers(0, 999))
def test_the_order_is_that_of_the_full_check_on_the_same_layouts(circle, count, seed):
    candidates = list_candidates(circle, count, TARGET, spacing_mm=RULES.spacing_mm)
    some = np.random.default_rng(seed).permutation(len(candidates))[:25]
    full = []
    for points in candidates.points_mm(some):
        layout = MarkerLayout.of(
            radius_mm=np.linalg.norm(points[:, :2], axis=1),
            sweep_deg=np.degrees(np.arctan2(points[:, 1], points[:, 0])),
            height_mm=points[:, 2],
        )
        full.append(assess(layout, TARGET, RULES).error_mm)
    fast = np.sqrt(candidates.unit_square_mm2[some]) * RULES.sigma_mm
    assert fast == pytest.approx(np.array(full), rel=1e-9)
    by_fast = np.argsort(np.round(fast, 9), kind="stable")
    assert np.diff(np.array(full)[by_fast]).min() > -2e-9


@settings(max_examples=8, deadline=None)
@given(circle=RINGS, count=st.integers(3, 5), seed=st.integers(0, 999))
def test_the_advice_is_never_worse_than_what_is_there(circle, count, seed):
    found = advise([task(circle, count)], top=12).proposals
    present = found[np.random.default_rng(seed).integers(len(found))].rings[0].layout
    again = advise([task(circle, count, present=present)], top=2)
    assert again.proposals[0].error_mm <= again.present_error_mm * (1 + 1e-9)
    best = again.present_error_mm <= again.proposals[0].error_mm * (1 + 1e-9)
    assert again.keep_present == best
    if best:
        assert again.rings[0].weaknesses == ()
    assert again.rings[0].fewest is None


def test_the_present_layout_itself_asks_for_no_move():
    circle = HoleCircle(36, 100.0)
    present = advise([task(circle, 4)], top=1).proposals[0].rings[0].layout
    again = advise([task(circle, 4, present=present)], top=1)
    assert again.keep_present
    assert again.proposals[0].rings[0].moves == ()


# --- the parts ---


@pytest.mark.parametrize("count", [3, 4, 5])
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_closed_form_fit_is_that_of_the_singular_values(count, mirrored):
    rng = np.random.default_rng(count)
    one = rng.normal(size=(40, count, 3)) * [100.0, 100.0, 15.0]
    other = one + rng.normal(size=one.shape) * 3.0
    orders = every_order(count)
    found = assignment_rms_mm(one, other, orders, mirrored=mirrored)
    wanted = rigid_rms_mm(points_mm=one[:, orders], layout_mm=other[:, None], mirrored=mirrored)
    assert found == pytest.approx(wanted, abs=1e-8)


def test_the_closed_form_fit_of_an_even_ring_is_near_zero():
    phi = np.arange(5) * 2 * np.pi / 5
    even = np.stack([100 * np.cos(phi), 100 * np.sin(phi), np.full(5, 20.0)], axis=-1)[None]
    assert assignment_rms_mm(even, even, orders_around(5)).max() < 0.02


def test_the_ranking_error_is_the_displacement_of_the_joints_and_the_bone():
    fixator = shipped_fixator()
    layout = MarkerLayout.of(
        radius_mm=[100, 90, 110, 100], sweep_deg=[0, 80, 170, 260], height_mm=[20, 25, 45, 10]
    )
    covariance = ring_poses(layout.points_mm[None], layout)[2][0]
    for side, ring, sign in (("proximal", fixator.proximal, -1), ("distal", fixator.distal, 1)):
        target = ErrorTarget.of_ring(ring, fixator.strut, side)
        bone = np.array([0.0, 0.0, sign * (120.0 + 240.0) / 4])
        rng = np.random.default_rng(1)
        xi = rng.multivariate_normal(np.zeros(6), covariance, size=200_000)
        squares = [
            np.mean(np.sum((xi[:, :3] + np.cross(xi[:, 3:], q)) ** 2, axis=1))
            for q in (*ring.joints_mm, bone)
        ]
        found = place_error(covariance, target)
        assert found.joints_mm == pytest.approx(np.sqrt(np.mean(squares[:6])), rel=0.01)
        assert found.bone_mm == pytest.approx(np.sqrt(squares[6]), rel=0.01)
        assert found.error_mm == pytest.approx(
            np.sqrt((found.joints_mm**2 + found.bone_mm**2) / 2), rel=1e-12
        )
        x, y, z = layout.points_mm.T
        unit = unit_square_errors(x[None], y[None], z[None], target, every_pair=True)
        assert np.sqrt(unit[0, 0]) * RULES.sigma_mm == pytest.approx(found.error_mm, rel=1e-9)


def test_markers_on_one_line_have_an_infinite_error():
    x, y, z = np.array([[-100.0, 0.0, 90.0]]), np.zeros((1, 3)), np.full((1, 3), 20.0)
    assert np.isinf(unit_square_errors(x, y, z, TARGET, every_pair=True)).all()


def test_every_numbering_counts_and_not_only_the_likely_ones():
    # Three even balls and one on the axis above them: turning the three fits, which keeps no
    # order around the ring and exchanges no two balls.
    points = MarkerLayout.of(
        radius_mm=[100, 5, 100, 100], sweep_deg=[0, 60, 120, 240], height_mm=[20, 90, 20, 20]
    ).points_mm[None]
    unique = smallest_rms(points[0], points[0], every_order(4)[1:])
    assert unique < 7.0
    assert smallest_rms(points[0], points[0], orders_around(4)[1:]) > 8.0
    assert not keep_margins(points, 8.0, None).any()
    assert keep_margins(points, unique - 0.01, None).all()


def test_markers_near_one_line_are_left_out_however_unique():
    flat = np.array([[[100.0, 0.0, 20.0], [20.0, 9.0, 20.0], [-100.0, 0.0, 20.0]]])
    assert smallest_rms(flat[0], flat[0], every_order(3)[1:]) > 8.0
    assert not keep_margins(flat, 8.0, None).any()
    flat[0, 1, 1] = 11.0
    assert keep_margins(flat, 8.0, None).all()


def test_no_two_balls_are_nearer_than_the_spacing():
    circle = HoleCircle(36, 100.0)
    found = {}
    for spacing in (0.0, 20.0, 60.0):
        points = list_candidates(circle, 4, TARGET, spacing_mm=spacing)
        points = points.points_mm(np.arange(len(points)))[..., :2]
        gaps = np.linalg.norm(points[:, :, None] - points[:, None], axis=-1)
        found[spacing] = gaps[:, ~np.eye(4, dtype=bool)].min()
    assert found[0.0] == pytest.approx(200 * np.sin(np.radians(5)))
    assert found[20.0] == pytest.approx(200 * np.sin(np.radians(10)))
    assert found[60.0] == pytest.approx(200 * np.sin(np.radians(20)))


# --- what is asked for and what cannot be had ---


def test_the_relaxed_rule_is_used_only_when_asked_for():
    # Nine free holes over 80°: no three are 45° apart.
    narrow = HoleCircle(36, 100.0, 0.0, (20.0, 45.0), occupied=tuple(range(10, 37)))
    with pytest.raises(LayoutRejected) as caught:
        advise([task(narrow, 3)])
    assert caught.value.faults[0].code == "no-layout"
    wide = HoleCircle(36, 100.0, 0.0, (20.0, 45.0), occupied=tuple(range(14, 37)))
    with pytest.raises(LayoutRejected):
        advise([task(HoleCircle(36, 100.0, 0.0, (20.0,), tuple(range(5, 34))), 3)])
    strict = advise([task(wide, 3)], top=1).proposals[0]
    assert strict.rings[0].verdict.rule == "preferred"
    # Holes 2, 5 and 14 are 30, 90 and 240 degrees apart.
    few = HoleCircle(36, 100.0, 0.0, (20.0,), tuple(k for k in range(1, 37) if k not in (2, 5, 14)))
    with pytest.raises(LayoutRejected):
        advise([task(few, 3)])
    relaxed = advise([task(few, 3)], rules=AdviceRules(relaxed=True)).proposals[0]
    assert relaxed.rings[0].verdict.rule == "relaxed"


def test_four_markers_show_a_mirror_where_the_heights_allow_it():
    two = advise([task(HoleCircle(36, 100.0), 4)], top=3)
    assert two.rings[0].mirror_shown
    assert all(p.rings[0].verdict.mirror_mm >= 5.0 for p in two.proposals)
    one = advise([task(HoleCircle(36, 100.0, heights_mm=(20.0,)), 4)], top=1)
    assert not one.rings[0].mirror_shown
    assert one.proposals[0].error_mm < two.proposals[0].error_mm
    assert not advise([task(HoleCircle(36, 100.0), 3)], top=1).rings[0].mirror_shown


def test_a_larger_margin_costs_accuracy():
    circle = HoleCircle(36, 100.0, heights_mm=(20.0,))
    found = [
        advise([task(circle, 3)], rules=AdviceRules(margin_mm=margin), top=1).proposals[0]
        for margin in (5.0, 8.0, 14.0)
    ]
    assert all(
        p.rings[0].verdict.uniqueness_mm >= m for p, m in zip(found, (5, 8, 14), strict=True)
    )
    assert found[0].error_mm < found[1].error_mm < found[2].error_mm


@pytest.mark.parametrize("margin", [4.99, 0.0, float("nan")])
def test_a_margin_that_the_gate_would_refuse_is_an_input_error(margin):
    with pytest.raises(InputError, match="refused by the gate"):
        AdviceRules(margin_mm=margin)


@pytest.mark.parametrize(("count", "top"), [(2, 5), (6, 5), (4, 0)])
def test_counts_that_cannot_be_served_are_input_errors(count, top):
    with pytest.raises(InputError):
        advise([task(HoleCircle(36, 100.0), count)], top=top)


def test_too_many_places_are_refused_and_not_searched():
    with pytest.raises(InputError, match="too many places"):
        advise([task(HoleCircle(144, 100.0, heights_mm=(10.0, 20.0, 30.0, 40.0)), 5)])
