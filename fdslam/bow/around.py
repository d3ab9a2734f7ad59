"""Which images of a map are looked at, and what of them is around a predicted place."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from fdslam.native import NATIVE, njit
from fdslam.popcount import bits_set
from fdslam.types import Features

NONE = 257  # bits: nothing is around
_ROUNDED = 1e-6  # pixels: no sum of a place and a radius is off by more


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
    ours, theirs = (np.ascontiguousarray(rows).view(np.uint64) for rows in (descriptors, other.descriptors))
    find = _nearest if NATIVE else _nearest_by_tree
    find(ours, np.ascontiguousarray(at, np.float64), theirs, other.xy.astype(np.float64), radius, best)
    return best


def _nearest_by_tree(
    ours: NDArray[np.uint64],
    at: NDArray[np.float64],
    theirs: NDArray[np.uint64],
    xy: NDArray[np.float64],
    radius: float,
    best: NDArray[np.int64],
) -> None:
    """Write what ``nearest_around`` returns to ``best``, without compiled loops."""
    around = cKDTree(xy).query_ball_point(at, radius, return_sorted=True)
    count = np.array([len(one) for one in around])
    word = np.fromiter(chain.from_iterable(around), np.int64, count.sum())
    mine = np.repeat(np.arange(len(ours)), count)
    distance = np.zeros(len(word), np.int64)
    for part in range(ours.shape[1]):  # a sum along so short an axis takes longer than all the rest
        distance += np.bitwise_count(ours[mine, part] ^ theirs[word, part])
    some = np.flatnonzero(count)
    if len(some):
        best[some] = np.minimum.reduceat(distance, (np.cumsum(count) - count)[some])


def _nearest(
    ours: NDArray[np.uint64],
    at: NDArray[np.float64],
    theirs: NDArray[np.uint64],
    xy: NDArray[np.float64],
    radius: float,
    best: NDArray[np.int64],
) -> None:
    """Write the same, by compiled loops over the rows of places that the disc around a place touches."""
    down = np.argsort(xy[:, 1], kind="stable")
    x, y = np.ascontiguousarray(xy[down, 0]), np.ascontiguousarray(xy[down, 1])
    begin = np.searchsorted(y, at[:, 1] - radius - _ROUNDED)
    end = np.searchsorted(y, at[:, 1] + radius + _ROUNDED, side="right")
    _in_discs(ours.reshape(-1), at.reshape(-1), theirs[down].reshape(-1), x, y, begin, end, radius * radius, best)


@njit
def _in_discs(ours, at, theirs, x, y, begin, end, squared, best):
    """Update ``best`` [n] by the places from ``begin`` to before ``end`` of each that lie in its disc."""
    for i in range(len(best)):
        q0, q1, q2, q3 = ours[4 * i], ours[4 * i + 1], ours[4 * i + 2], ours[4 * i + 3]
        smallest = best[i]
        for j in range(begin[i], end[i]):
            across, down = x[j] - at[2 * i], y[j] - at[2 * i + 1]
            if across * across + down * down <= squared:
                bits = np.int64(
                    bits_set(q0 ^ theirs[4 * j])
                    + bits_set(q1 ^ theirs[4 * j + 1])
                    + bits_set(q2 ^ theirs[4 * j + 2])
                    + bits_set(q3 ^ theirs[4 * j + 3])
                )
                smallest = min(smallest, bits)
        best[i] = smallest
