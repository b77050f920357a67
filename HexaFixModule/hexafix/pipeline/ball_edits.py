"""The user's corrections of the balls, one after the other, as the case file keeps them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

KEYS = ("added_lps_mm", "removed_lps_mm")


def with_ball_added(edits: Mapping[str, Any], *, lps_mm: Sequence[float]) -> dict[str, Any]:
    """The ``marker_edits`` of a case with one more ball to add.

    Parameters
    ----------
    edits : mapping
        As the case file has them; empty for none.
    lps_mm : sequence of float, length 3
        Point near the ball's centre, LPS mm.
    """
    found = _copy(edits)
    found["added_lps_mm"].append([float(value) for value in lps_mm])
    return found


def with_ball_removed(edits: Mapping[str, Any], *, ball: Mapping[str, Any]) -> dict[str, Any]:
    """The ``marker_edits`` of a case with one ball less.

    A ball that the user added is not added any more; one that the search found is removed.

    Parameters
    ----------
    edits : mapping
        As the case file has them; empty for none.
    ball : mapping
        The ball as `balls_document` has it.
    """
    found, center = _copy(edits), np.asarray(ball["center_mm"], float)
    if ball.get("added") and found["added_lps_mm"]:
        points = np.asarray(found["added_lps_mm"], float)
        away = np.linalg.norm(points - center, axis=1)
        nearest = int(np.argmin(away))
        # balls do not overlap, so no other ball's point lies within a diameter
        if away[nearest] < float(ball["diameter_mm"]):
            del found["added_lps_mm"][nearest]
            return found
    found["removed_lps_mm"].append([float(value) for value in center])
    return found


def _copy(edits: Mapping[str, Any]) -> dict[str, list[list[float]]]:
    return {key: [list(point) for point in edits.get(key) or ()] for key in KEYS}
