"""How many markers of a layout the balls hold when not all are there."""

from __future__ import annotations

from itertools import combinations

import numpy as np

from hexafix.recognition.congruence import embeddings
from hexafix.recognition.rigid import Array, kabsch, triangle_heights_mm

MAX_TRIPLES = 200
"""Marker triples tried as a start; more markers are sampled evenly."""


def matched_count(points: Array, layout_mm: Array, *, limit_mm: float) -> int:
    """Most markers of a layout, shape (N, 3), that one rigid motion brings onto balls, (M, 3).

    Each marker of the count lies within three times `limit_mm` of its ball. With no triple of
    markers among the balls, a pair at the right distance counts as 2.
    """
    if len(points) < 2:
        return len(points)
    best = 0
    triples = np.array(list(combinations(range(len(layout_mm)), 3)))
    triples = triples[np.argsort(-triangle_heights_mm(layout_mm[triples]), kind="stable")]
    for triple in triples[:: max(1, len(triples) // MAX_TRIPLES)] if len(points) >= 3 else ():
        found = embeddings(points_mm=points, layout_mm=layout_mm[triple], max_rms_mm=limit_mm)
        for balls in found.balls[:20]:
            rotation, position = kabsch(points_mm=points[balls], layout_mm=layout_mm[triple])
            fitted = layout_mm @ rotation.T + position
            distance = np.linalg.norm(fitted[:, None] - points[None], axis=-1).min(axis=1)
            best = max(best, int(np.count_nonzero(distance <= 3 * limit_mm)))
    if best:
        return best
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    wanted = np.linalg.norm(layout_mm[:, None] - layout_mm[None], axis=-1)
    first, second = np.triu_indices(len(layout_mm), 1)
    upper = apart[np.triu_indices(len(points), 1)]
    near = np.abs(upper[:, None] - wanted[first, second][None]) <= 2 * limit_mm
    return 2 if np.any(near) else 1
