"""Compiled loops of the evaluation, with what is used in their place where numba is not at hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.bow.native import NATIVE, njit


def not_above(
    own: NDArray[np.floating], values: NDArray[np.floating], starts: NDArray[np.int64], offsets: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Count the pairs that a box does not win against the same cells of other queries, twice: ties are half.

    Args:
        own: [n] LoC of the box's cells, rising.
        values: [N] LoC of all cells.
        starts: [u] first cell of each other query.
        offsets: [n] the box's cells, counted from the start of its query.

    Returns:
        [u] twice the number of pairs with a larger LoC there, and once those with equal LoC.
    """
    if NATIVE:
        return _not_above(own, values, starts, offsets)
    others = values[starts[:, None] + offsets]
    return (np.searchsorted(own, others, "left") + np.searchsorted(own, others, "right")).sum(axis=1)


@njit
def _not_above(
    own: NDArray[np.floating], values: NDArray[np.floating], starts: NDArray[np.int64], offsets: NDArray[np.int64]
) -> NDArray[np.int64]:
    result = np.zeros(len(starts), np.int64)
    for u in range(len(starts)):
        total = 0
        for offset in offsets:
            value = values[starts[u] + offset]
            low, left = 0, len(own)
            while left > 1:  # without branches: what is compared is as good as random, and guesses fail
                half = left // 2
                low += half * (own[low + half - 1] < value)
                left -= half
            low += own[low] < value
            high = low
            if low < len(own) and own[low] == value:
                left = len(own) - low
                while left > 1:
                    half = left // 2
                    high += half * (own[high + half - 1] <= value)
                    left -= half
                high += own[high] <= value
            total += low + high
        result[u] = total
    return result
