"""The layout advisor: the best layouts that a ring's free holes allow, before any CT."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from hexafix.accuracy.advised import (
    Advice,
    AdviceRules,
    AssessedRing,
    Proposal,
    RingReport,
    RingTask,
    assess,
)
from hexafix.accuracy.fewest_moves import fewest_moves
from hexafix.accuracy.layout_candidates import Candidates, list_candidates
from hexafix.accuracy.layout_check import exchange_rms_mm
from hexafix.accuracy.layout_placing import Placed, placed
from hexafix.accuracy.layout_search import Feasible, exchange_kept, feasible
from hexafix.accuracy.weaknesses import keeps_rules, weaknesses
from hexafix.errors import InputError, LayoutRejected
from hexafix.hardware import HoleCircle, MarkerLayout
from hexafix.recognition.choices import UNIQUENESS_LIMIT_MM

FIRST_PAIRED = 32
"""Layouts of each ring paired at first; twice as many each time they do not suffice."""

PAIR_BATCH, SINGLE_BATCH = 64, 8
"""Pairs tested at once, and layouts of a single ring."""

MIRROR_NEEDS_MORE_THAN = 3
"""So many markers always lie in one plane and cannot show a mirrored image."""

MIRROR_SHARE = 0.5
"""A mirror image misses the layout by at most twice the markers' RMS distance from a plane."""


def advise(
    tasks: Sequence[RingTask],
    *,
    rules: AdviceRules | None = None,
    top: int = 5,
    other: MarkerLayout | None = None,
) -> Advice:
    """The best layouts of one ring, or of both together.

    Parameters
    ----------
    tasks : sequence of RingTask
        One ring, or the proximal and the distal one.
    rules : AdviceRules, optional
    top : int
        Proposals wanted.
    other : MarkerLayout, optional
        With one task: the other ring's layout, which this ring must not be taken for.

    Raises
    ------
    LayoutRejected
        If the places allow no layout that keeps the rules.
    InputError
        If `top` is not positive, or the count or the number of places cannot be served.

    Notes
    -----
    Source: the rule of Section 4.3.2, the margins of the gates H18, H20 and H01. Ranked by
    `PlaceError.error_mm` at the covariance of the least-squares pose. No layout is left out: what
    is skipped is a turned or reflected copy, breaks a rule, or comes after the last one wanted.
    """
    if top < 1:
        raise InputError.of("top-count", "at least one proposal must be wanted", value=str(top))
    rules = rules or AdviceRules()
    searches = [_Search.of(task, rules) for task in tasks]
    if len(searches) == 1:
        found = [((item,), choice) for item, choice in _singles(searches[0], other, rules, top)]
    else:
        found = _pairs(searches[0], searches[1], rules, top)
    if not found:
        raise _nothing(tasks, rules)
    known: dict[tuple[str, MarkerLayout], AssessedRing] = {}
    proposals = tuple(_proposal(tasks, rings, rules, other, known) for _, rings in found)
    present = [assess(t.present, t.target, rules) if t.present else None for t in tasks]
    return _answer(tasks, searches, rules, proposals, present, other)


@dataclass
class _Search:
    """The candidates of one ring and those found to keep its own margins so far."""

    task: RingTask
    candidates: Candidates
    mirror_shown: bool
    _stream: Iterator[Feasible]
    _found: list[Feasible] = field(default_factory=list)
    exhausted: bool = False

    @classmethod
    def of(cls, task: RingTask, rules: AdviceRules) -> _Search:
        """With the mirror margin where any layout of this ring can keep it (H01)."""
        if task.count > MIRROR_NEEDS_MORE_THAN:
            strict = cls._asking(task, rules, mirror=True)
            if strict.upto(1):
                return strict
        return cls._asking(task, rules, mirror=False)

    @classmethod
    def _asking(cls, task: RingTask, rules: AdviceRules, *, mirror: bool) -> _Search:
        candidates = list_candidates(
            task.places,
            task.count,
            task.target,
            relaxed=rules.relaxed,
            spacing_mm=rules.spacing_mm,
            out_of_plane_mm=MIRROR_SHARE * UNIQUENESS_LIMIT_MM if mirror else 0.0,
        )
        stream = feasible(
            candidates,
            margin_mm=rules.margin_mm,
            mirror_mm=UNIQUENESS_LIMIT_MM if mirror else None,
        )
        return cls(task, candidates, mirror, stream)

    def upto(self, count: int) -> list[Feasible]:
        """The best layouts, as many as there are up to `count`."""
        missing = count - len(self._found)
        if missing > 0 and not self.exhausted:
            more = list(islice(self._stream, missing))
            self._found += more
            self.exhausted = len(more) < missing
        return self._found[:count]

    def placed(self, item: Feasible, reflected: bool) -> Placed | None:
        return placed(self.candidates, item.flat, self.task, reflected=reflected)

    def points(self, items: Sequence[Feasible], *, reflected: bool) -> np.ndarray:
        """Ball centres in the order of their angles, shape (B, N, 3), mm."""
        points = self.candidates.points_mm(np.array([item.flat for item in items], dtype=np.intp))
        return points[:, ::-1] * [1.0, -1.0, 1.0] if reflected else points

    def hands(self, item: Feasible) -> tuple[bool, bool]:
        """Whether the layout as listed, and reflected, fits into the free holes."""
        row = self.candidates.split(np.array([item.flat]))[0][0]
        first, second = self.candidates.handed[row]
        return bool(first), bool(second)


def _singles(
    search: _Search, other: MarkerLayout | None, rules: AdviceRules, top: int
) -> list[tuple[Feasible, tuple[Placed, ...]]]:
    """The best layouts of one ring that cannot be taken for the other."""
    found = []
    start = 0
    while len(found) < top:
        items = search.upto(start + max(top, SINGLE_BATCH))[start:]
        if not items:
            break
        start += len(items)
        kept = np.ones((2, len(items)), bool)
        if other is not None and len(other) == search.task.count:
            around = np.argsort(np.mod([s.sweep_rad for s in other.sites], 2 * np.pi))
            against = np.broadcast_to(other.points_mm[around], (len(items), len(other), 3))
            for hand in (False, True):
                points = search.points(items, reflected=hand)
                kept[int(hand)] = exchange_kept(points, against, rules.margin_mm)
        for k, item in enumerate(items):
            ways = [(hand,) for hand in (False, True) if kept[int(hand), k]]
            choice = _nearest([search], [item], ways)
            if choice is not None:
                found.append((item, choice))
            if len(found) == top:
                break
    return found


def _pairs(
    one: _Search, other: _Search, rules: AdviceRules, top: int
) -> list[tuple[tuple[Feasible, Feasible], tuple[Placed, ...]]]:
    """The best pairs of layouts that cannot be taken for each other."""
    size = FIRST_PAIRED
    while True:
        lists = one.upto(size), other.upto(size)
        if not (lists[0] and lists[1]):
            return []
        squares = [np.array([item.unit_error_mm**2 for item in found]) for found in lists]
        # Beyond the lists a pair is no better than the last of one with the best of the other.
        bounds = [
            squares[k][-1] + squares[1 - k][0]
            for k, search in enumerate((one, other))
            if not search.exhausted
        ]
        total = np.round(squares[0][:, None] + squares[1][None, :], 9)
        pairs = np.argwhere(total <= min(bounds, default=np.inf))
        pairs = pairs[np.lexsort((pairs.max(axis=1), total[pairs[:, 0], pairs[:, 1]]))]
        found = _first_apart(one, other, lists, pairs, rules, top)
        if len(found) >= top or not bounds:
            return found
        size *= 2


def _first_apart(
    one: _Search,
    other: _Search,
    lists: tuple[list[Feasible], list[Feasible]],
    pairs: np.ndarray,
    rules: AdviceRules,
    top: int,
) -> list[tuple[tuple[Feasible, Feasible], tuple[Placed, ...]]]:
    """The first pairs, shape (Q, 2) of indices into the lists, whose rings differ enough."""
    found = []
    for start in range(0, len(pairs), PAIR_BATCH):
        batch = pairs[start : start + PAIR_BATCH]
        items = [[found_of[k] for k in batch[:, side]] for side, found_of in enumerate(lists)]
        kept = np.ones((2, len(batch)), bool)
        if one.task.count == other.task.count:
            for hand in (False, True):
                points = one.points(items[0], reflected=False)
                against = other.points(items[1], reflected=hand)
                kept[int(hand)] = exchange_kept(points, against, rules.margin_mm)
        for k, pair in enumerate(zip(*items, strict=True)):
            # Reflecting both rings changes nothing between them.
            ways = [
                (a, b)
                for a in (False, True)
                for b in (False, True)
                if kept[int(a != b), k]
            ]  # fmt: skip
            choice = _nearest([one, other], list(pair), ways)
            if choice is not None:
                found.append((pair, choice))
            if len(found) == top:
                return found
    return found


def _nearest(
    searches: list[_Search], items: list[Feasible], ways: list[tuple[bool, ...]]
) -> tuple[Placed, ...] | None:
    """The copies that ask for the fewest changes; `ways` says which reflections are allowed."""
    hands = [search.hands(item) for search, item in zip(searches, items, strict=True)]
    ways = [way for way in ways if all(h[int(w)] for h, w in zip(hands, way, strict=True))]
    if not ways:
        return None
    copies = {
        (k, hand): search.placed(item, hand)
        for k, (search, item) in enumerate(zip(searches, items, strict=True))
        for hand in {way[k] for way in ways}
    }
    rings = [tuple(copies[k, hand] for k, hand in enumerate(way)) for way in ways]
    whole = [ring for ring in rings if None not in ring]
    return min(whole, key=lambda ring: sum(copy.cost for copy in ring if copy), default=None)  # type: ignore[return-value]


def _proposal(
    tasks: Sequence[RingTask],
    rings: Sequence[Placed],
    rules: AdviceRules,
    other: MarkerLayout | None,
    known: dict[tuple[str, MarkerLayout], AssessedRing],
) -> Proposal:
    """The rings with all their figures; `known` holds those of earlier proposals."""
    for task, ring in zip(tasks, rings, strict=True):
        if (task.name, ring.layout) not in known:
            known[task.name, ring.layout] = assess(
                ring.layout, task.target, rules, places=ring.places, moves=ring.moves
            )
    assessed = tuple(known[task.name, ring.layout] for task, ring in zip(tasks, rings, strict=True))
    return Proposal(
        assessed,
        float(np.sqrt(sum(ring.error_mm**2 for ring in assessed))),
        _exchange([ring.layout for ring in assessed], other),
    )


def _exchange(layouts: list[MarkerLayout | None], other: MarkerLayout | None) -> float | None:
    """RMS of the rings taken for each other, where both are known."""
    both = [*layouts, other][:2]
    one, two = both[0], both[1]
    return None if one is None or two is None else exchange_rms_mm(one, two)


def _answer(
    tasks: Sequence[RingTask],
    searches: Sequence[_Search],
    rules: AdviceRules,
    proposals: tuple[Proposal, ...],
    present: list[AssessedRing | None],
    other: MarkerLayout | None,
) -> Advice:
    """The proposals beside what there is, and why that is weaker."""
    exchange = _exchange([ring.layout if ring else None for ring in present], other)
    reports, kept = [], True
    fewest = _mended(tasks, searches, present, rules, other)
    for k, (task, search, ring) in enumerate(zip(tasks, searches, present, strict=True)):
        best = proposals[0].rings[k]
        shown = search.mirror_shown
        why = weaknesses(ring, best, rules, exchange_mm=exchange, mirror=shown) if ring else ()
        kept &= ring is not None and keeps_rules(ring, rules, exchange_mm=exchange, mirror=shown)
        reports.append(RingReport(task, ring, why, shown, len(search.candidates), fewest[k]))
    whole = [ring.error_mm for ring in present if ring is not None]
    error = float(np.sqrt(np.sum(np.square(whole)))) if len(whole) == len(tasks) else np.inf
    return Advice(
        rules,
        tuple(reports),
        proposals,
        error if np.isfinite(error) else None,
        exchange,
        kept and error <= proposals[0].error_mm * (1.0 + 1e-9),
    )


def _mended(
    tasks: Sequence[RingTask],
    searches: Sequence[_Search],
    present: list[AssessedRing | None],
    rules: AdviceRules,
    other: MarkerLayout | None,
) -> list[AssessedRing | None]:
    """Each ring that breaks a rule with the fewest moves that mend it, one ring after the other."""
    mended: list[AssessedRing | None] = []
    for task, search, ring in zip(tasks, searches, present, strict=True):
        # The distal ring must differ from the proximal one as it will be built.
        exchange = _exchange([ring.layout if ring else None], other)
        shown = search.mirror_shown
        if ring is None or keeps_rules(ring, rules, exchange_mm=exchange, mirror=shown):
            mended.append(None)
        else:
            mended.append(fewest_moves(task, rules, mirror=shown, other=other))
        built = mended[-1] or ring
        other = built.layout if built else other
    return mended


def _nothing(tasks: Sequence[RingTask], rules: AdviceRules) -> LayoutRejected:
    free = ", ".join(
        f"{task.name} {int(task.places.free.sum())} holes"
        if isinstance(task.places, HoleCircle)
        else f"{task.name} {len(task.places.sites)} sites"
        for task in tasks
    )
    return LayoutRejected.of(
        "no-layout",
        "no layout of these places keeps the angle rule and can be numbered",
        value=free,
        limit=f"{'relaxed' if rules.relaxed else '45°'} rule, margin {rules.margin_mm:g} mm",
        hazard="H18",
        next_step="free more holes, give rods of other heights, or allow the relaxed rule",
    )
