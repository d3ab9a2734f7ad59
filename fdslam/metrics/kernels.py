"""Compiled loops of the evaluation, with what is used in their place where numba is not at hand."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.native import NATIVE, njit

BUCKETS = 4096  # of the ranks; most hold none of a box's cells, and need no search


def not_above(
    own: NDArray[np.integer], ranks: NDArray[np.integer], starts: NDArray[np.int64], offsets: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Count the pairs that a box does not win against the same cells of other queries, twice: ties are half.

    Args:
        own: [n] ranks of the box's cells, rising.
        ranks: [N] of all cells by their LoC, 0 to N; equal LoC have equal ranks.
        starts: [u] first cell of each other query.
        offsets: [n] the box's cells, counted from the start of its query.

    Returns:
        [u] twice the number of pairs with a larger LoC there, and once those with equal LoC.
    """
    if NATIVE:
        shift = max(0, len(ranks).bit_length() - BUCKETS.bit_length())
        below = np.searchsorted(own, np.arange((len(ranks) >> shift) + 2) << shift)
        return _not_above(own, ranks, starts, offsets, below, shift)
    others = ranks[starts[:, None] + offsets]
    return (np.searchsorted(own, others, "left") + np.searchsorted(own, others, "right")).sum(axis=1)


@njit
def _not_above(
    own: NDArray[np.integer],
    ranks: NDArray[np.integer],
    starts: NDArray[np.int64],
    offsets: NDArray[np.int64],
    below: NDArray[np.int64],  # how many of own are less than the first rank of each bucket
    shift: int,
) -> NDArray[np.int64]:
    result = np.zeros(len(starts), np.int64)
    for u in range(len(starts)):
        total = 0
        for offset in offsets:
            rank = ranks[starts[u] + offset]
            low, end = below[rank >> shift], below[(rank >> shift) + 1]
            high = end
            while low < end:  # the first that is not less
                middle = (low + end) // 2
                if own[middle] < rank:
                    low = middle + 1
                else:
                    end = middle
            end, high = high, low
            while high < end:  # the first that is larger
                middle = (high + end) // 2
                if own[middle] <= rank:
                    high = middle + 1
                else:
                    end = middle
            total += low + high
        result[u] = total
    return result
