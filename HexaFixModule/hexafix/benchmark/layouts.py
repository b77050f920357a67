"""How long the layout advisor takes, and how long trying every layout would."""

from __future__ import annotations

from math import comb
from time import perf_counter
from typing import Any

import numpy as np

from hexafix.accuracy import AdviceRules, ErrorTarget, RingTask, advise
from hexafix.accuracy.advised import assess
from hexafix.hardware import HoleCircle, MarkerLayout, shipped_fixator

TRIED = 12
"""Random layouts timed for the plain loop."""


def advice_time(count: int, *, rounds: int = 5) -> dict[str, Any]:
    """Best seconds of some rounds to advise one ring, and both: 36 holes, two rod heights.

    Returns
    -------
    dict
        ``ring_s``, ``pair_s``, ``layouts`` that the holes allow, ``compared`` shapes, and
        ``one_by_one_s``, the full check of every layout, from `TRIED` of them.
    """
    fixator, circle = shipped_fixator(), HoleCircle(36, 100.0)
    upper = ErrorTarget.of_ring(fixator.proximal, fixator.strut, "proximal")
    lower = ErrorTarget.of_ring(fixator.distal, fixator.strut, "distal")
    tasks = [
        RingTask("proximal", circle, count, upper),
        RingTask("distal", circle, count, lower, first_number=count + 1),
    ]
    seconds: dict[str, list[float]] = {"ring_s": [], "pair_s": []}
    compared = advise(tasks[:1]).rings[0].compared
    for _ in range(rounds):
        for key, asked in (("ring_s", tasks[:1]), ("pair_s", tasks)):
            start = perf_counter()
            advise(asked)
            seconds[key].append(perf_counter() - start)
    rng = np.random.default_rng(0)
    start = perf_counter()
    for _ in range(TRIED):
        holes = np.sort(rng.choice(circle.count, count, replace=False))
        layout = MarkerLayout.of(
            radius_mm=[circle.radius_mm] * count,
            sweep_deg=10.0 * holes,
            height_mm=rng.choice(circle.heights_mm, count),
        )
        assess(layout, tasks[0].target, AdviceRules())
    each = (perf_counter() - start) / TRIED
    layouts = comb(circle.count, count) * len(circle.heights_mm) ** count
    return {
        **{key: float(min(values)) for key, values in seconds.items()},
        "layouts": layouts,
        "compared": compared,
        "one_by_one_s": each * layouts,
    }
