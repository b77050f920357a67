"""Fewest moves, the words of weaknesses, and the advice of check-layout on known holes."""

from itertools import product

import numpy as np
import pytest
from hexafix.accuracy import RingPlaces, check_layout, check_layouts, layout_faults
from hexafix.accuracy.advised import AdviceRules, RingTask, assess
from hexafix.accuracy.advisor import advise
from hexafix.accuracy.fewest_moves import fewest_moves
from hexafix.accuracy.joint_error import ErrorTarget
from hexafix.accuracy.layout_check import exchange_rms_mm
from hexafix.hardware import HoleCircle, MarkerLayout, MarkerSite, SiteList

TARGET = ErrorTarget.of_radius(100.0)
CIRCLE = HoleCircle(36, 100.0, occupied=(3, 12))


def task(present, places=CIRCLE, name="proximal"):
    return RingTask(name, places, len(present), TARGET, present)


def terms(present, places=CIRCLE, **rules):
    advice = advise([task(present, places)], rules=AdviceRules(**rules), top=1)
    return {weakness.term: weakness for weakness in advice.rings[0].weaknesses}


def test_one_move_is_the_best_of_trying_every_one(layout_at):
    present = layout_at([0, 120, 240])
    circle, rules = HoleCircle(18, 100.0, occupied=(2, 12)), AdviceRules()
    best = np.inf
    for k, place, height in product(range(3), range(18), circle.heights_mm):
        if not circle.free[place]:
            continue
        sites = list(present.sites)
        sites[k] = MarkerSite(sites[k].number, 100.0, np.radians(20.0 * place), height)
        try:
            ring = assess(MarkerLayout(tuple(sites)), TARGET, rules)
        except np.linalg.LinAlgError:
            continue
        if ring.verdict.rule == "preferred" and ring.verdict.uniqueness_mm >= rules.margin_mm:
            best = min(best, ring.error_mm)
    found = fewest_moves(task(present, circle), rules, mirror=False)
    assert found is not None
    assert len(found.moves) == 1
    assert found.error_mm == pytest.approx(best, rel=1e-9)


def test_markers_that_stay_need_not_be_on_holes(layout_at):
    present = layout_at([3.3, 123.4, 243.3])
    found = fewest_moves(task(present), AdviceRules(), mirror=False)
    assert found is not None
    assert len(found.moves) == 1
    kept = [a for a, b in zip(present.sites, found.layout.sites, strict=True) if a == b]
    assert len(kept) == 2
    assert sum(place is None for place in found.places or ()) == 2
    assert found.layout.numbers == present.numbers


def test_two_moves_come_only_where_one_does_not_suffice(layout_at):
    # Two pairs of markers too close: one move cannot part both.
    present = layout_at([0, 8, 120, 128], height_mm=[20, 20, 45, 20])
    found = fewest_moves(task(present), AdviceRules(spacing_mm=40.0), mirror=True)
    assert found is not None
    assert len(found.moves) == 2
    assert layout_faults(check_layouts(found.layout, layout_at([0, 100, 220], 5))) == ()


def test_nothing_is_moved_into_a_taken_hole_or_to_a_height_there_is_not(layout_at):
    few = HoleCircle(36, 100.0, heights_mm=(20.0,), occupied=tuple(range(2, 36)))
    # Free are 0 and 350 degrees alone: nothing there mends an even ring.
    assert fewest_moves(task(layout_at([0, 120, 240]), few), AdviceRules(), mirror=False) is None


def test_a_move_that_breaks_the_angle_rule_mends_nothing(layout_at):
    present = layout_at([0, 40, 80])
    # With one marker at 120 degrees two others stay 40 degrees apart, or it does.
    places = SiteList((MarkerSite(1, 100.0, np.radians(120.0), 20.0),))
    assert fewest_moves(task(present, places), AdviceRules(), mirror=False) is None
    wider = SiteList((MarkerSite(1, 100.0, np.radians(130.0), 20.0),))
    assert fewest_moves(task(present, wider), AdviceRules(), mirror=False) is not None


def test_a_mended_ring_is_kept_apart_from_the_other(layout_at):
    other = layout_at([0, 100, 220], 4)
    present = layout_at([0, 120, 240])
    free = fewest_moves(task(present), AdviceRules(), mirror=False)
    apart = fewest_moves(task(present), AdviceRules(), mirror=False, other=other)
    assert free is not None
    assert apart is not None
    assert (exchange_rms_mm(apart.layout, other) or 0.0) >= AdviceRules().margin_mm


def test_each_weakness_is_named_by_its_term(layout_at):
    even = terms(layout_at([0, 120, 240]))
    assert set(even) == {"relabelling"}
    assert even["relabelling"].refused
    assert "numbers 1,2,3 turned" in even["relabelling"].words
    near = terms(layout_at([0, 20, 150]))
    assert {"sweep-gap", "predicted-error"} <= set(near)
    assert near["sweep-gap"].refused
    assert "markers 1 and 2 are 20 degrees apart" in near["sweep-gap"].words
    assert not terms(layout_at([0, 20, 150]), relaxed=True)["sweep-gap"].refused
    line = terms(layout_at([0, 5, 180], radius_mm=[100, 100, 100]))
    assert line["line"].refused
    flat = terms(layout_at([0, 70, 170, 280]))
    assert "coplanar" in flat["mirror"].words
    assert not flat["mirror"].refused
    wide = terms(layout_at([0, 50, 100]))
    assert set(wide) >= {"predicted-error"}
    assert "% more" in wide["predicted-error"].words


def test_alike_rings_are_named_and_one_of_them_is_mended(layout_at):
    one, other = layout_at([0, 100, 220]), layout_at([30, 130, 250], 4)
    advice = advise([task(one), task(other, name="distal")], top=1)
    assert advice.present_exchange_mm == pytest.approx(0.0, abs=1e-6)
    assert all("exchange" in {w.term for w in ring.weaknesses} for ring in advice.rings)
    assert not advice.keep_present
    assert advice.rings[0].fewest is None
    mended = advice.rings[1].fewest
    assert mended is not None
    assert (exchange_rms_mm(one, mended.layout) or 0.0) >= 8.0


def test_a_good_but_less_exact_layout_is_allowed_and_said_to_be_weaker(layout_at):
    advice = advise([task(layout_at([0, 60, 190]))], top=1)
    assert advice.rings[0].fewest is None
    assert [w.term for w in advice.rings[0].weaknesses] == ["predicted-error"]
    assert not advice.keep_present


def test_check_layout_advises_only_places_that_are_known(layout_at):
    present, other = layout_at([0, 120, 240]), layout_at([15, 105, 230], 4)
    # 10 to 350 degrees are taken but for 140, 230 and 260.
    holes = HoleCircle(
        36, 100.0, 0.0, (20.0,), tuple(k for k in range(2, 37) if k not in (15, 24, 27))
    )
    known = check_layouts(present, other, places=(RingPlaces(holes, TARGET), None))
    assert known.advice[0].startswith("proximal ring: not unique: numbers 1,2,3 turned")
    assert any(f"to {angle} degrees: unique by" in known.advice[0] for angle in (140, 230, 260))
    assert "225" in check_layouts(present, other).advice[0]
    none = HoleCircle(36, 100.0, 0.0, (20.0,), tuple(range(2, 37)))
    told = check_layouts(present, other, places=(RingPlaces(none, TARGET), None)).advice[0]
    assert told.endswith("the free places allow no better layout; add a marker or free a hole")


def test_an_advised_layout_of_check_layout_passes_it(layout_at):
    present, other = layout_at([0, 90, 180, 270]), layout_at([15, 105, 230], 5)
    known = RingPlaces(SiteList(tuple(layout_at(np.arange(24) * 15.0).sites)), TARGET)
    advice = check_layouts(present, other, places=(known, None)).advice[0]
    number, angle = 0, 0.0
    words = advice.split("; ")[-1].split()
    sites = {site.number: site for site in present.sites}
    for k, word in enumerate(words):
        if word == "marker":
            number, angle = int(words[k + 1]), float(words[k + 5])
            sites[number] = MarkerSite(number, 100.0, np.radians(angle), 20.0)
    verdict = check_layout(MarkerLayout(tuple(sites.values())))
    assert verdict.rule == "preferred"
    assert verdict.uniqueness_mm >= 8.0
