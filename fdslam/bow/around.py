"""Which images of a map are looked at, and what of them is around a predicted place."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fdslam.types import Features

NONE = 257  # bits: nothing is around


def candidates(hypotheses: Sequence[int] | NDArray[np.integer], images: int, best: int, neighbours: int) -> list[int]:
    """Return the map ids of the best hypotheses and of what lies beside them along the path, rising.

    Args:
        hypotheses: map ids, best first.
        images: of the map.
        best: how many hypotheses count.
        neighbours: before and after each.
    """
    near = range(-neighbours, neighbours + 1)
    return sorted({int(m) + d for m in hypotheses[:best] for d in near if 0 <= int(m) + d < images})


def nearest_around(
    descriptors: NDArray[np.uint8], at: NDArray[np.float64], other: Features, radius: float
) -> NDArray[np.int64]:
    """Return the distance of each descriptor to the one most like it around its place in another image.

    Args:
        descriptors: uint8 [n, 32].
        at: float64 [n, 2] pixels, where each should be seen in the other image.
        other: the other image's descriptors and where they are.
        radius: pixels; one at exactly this distance counts.

    Returns:
        int64 [n] bits; NONE where nothing is around.
    """
    best = np.full(len(descriptors), NONE)
    if not len(descriptors) or not len(other.xy):
        return best
    around = cKDTree(other.xy.astype(np.float64)).query_ball_point(at, radius, return_sorted=True)
    count = np.array([len(one) for one in around])
    word = np.fromiter(chain.from_iterable(around), np.int64, count.sum())
    ours, theirs = (np.ascontiguousarray(rows).view(np.uint64) for rows in (descriptors, other.descriptors))
    mine = np.repeat(np.arange(len(ours)), count)
    distance = np.zeros(len(word), np.int64)
    for part in range(ours.shape[1]):  # a sum along so short an axis takes longer than all the rest
        distance += np.bitwise_count(ours[mine, part] ^ theirs[word, part])
    some = np.flatnonzero(count)
    if len(some):
        best[some] = np.minimum.reduceat(distance, (np.cumsum(count) - count)[some])
    return best
