"""Non-maximum suppression of a score map: the best window is taken, its neighbours are dropped, and so on."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.native import njit
from fdslam.obb.bing.binary import Scores


@njit
def _take(order, height, width, radius, count, kept):
    """Write to ``kept`` the windows that are taken in ``order``; return how many."""
    free = np.ones((height, width), np.bool_)
    taken = 0
    for place in order:
        y = place // width
        x = place - y * width
        if free[y, x]:
            kept[taken] = place
            taken += 1
            if taken == count:
                break
            free[max(y - radius, 0) : y + radius + 1, max(x - radius, 0) : x + radius + 1] = False
    return taken


def best_windows(scores: Scores, radius: int, count: int) -> NDArray[np.int64]:
    """Return at most ``count`` windows, flat indices int64 [n] into ``scores`` [H, W], by falling score.

    No two are within ``radius`` of each other in both directions; of equal scores the first in the map comes first.
    """
    height, width = scores.shape
    flat = scores.ravel()
    # A window that is taken drops at most (2 radius + 1)² - 1 others: so many of the best, and all that equal the last
    # of them, are enough.
    enough = count * (2 * radius + 1) ** 2
    places = np.arange(flat.size)
    if flat.size > enough:
        places = np.flatnonzero(flat >= np.partition(flat, flat.size - enough)[flat.size - enough])
    order = places[np.argsort(-flat[places], kind="stable")]
    kept = np.empty(count, np.int64)
    return kept[: _take(order, height, width, radius, count, kept)]
