"""From the scores of weak lists to ranks: all of them, those of given images, or the first n (§FD).

Ties share the best rank of their group. Images never retrieved (score 0) get rank M ("last") or the rank after all
retrieved ones ("next"). Only what is retrieved is ever sorted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def _rank_of_nothing(retrieved: NDArray[np.integer], images: int, unretrieved: str) -> NDArray[np.integer]:
    return np.full_like(retrieved, images) if unretrieved == "last" else retrieved + 1


def ranks_of(scores: NDArray[np.int64], unretrieved: str) -> NDArray[np.int32]:
    """Return the rank of every map image in every list, 1 = best.

    Args:
        scores: int64 [J, M], not negative.
        unretrieved: "last" or "next".

    Returns:
        int32 [J, M].
    """
    ranks = np.empty(scores.shape, np.int32)
    ranks[:] = _rank_of_nothing(np.count_nonzero(scores, axis=1), scores.shape[1], unretrieved)[:, None]
    for row, rank in zip(scores, ranks, strict=True):
        found = np.flatnonzero(row)
        values = row[found]
        rank[found] = len(found) + 1 - np.searchsorted(np.sort(values), values, side="right")
    return ranks


def ranks_of_images(scores: NDArray[np.int64], images: NDArray[np.integer], unretrieved: str) -> NDArray[np.int32]:
    """Return the ranks of a few map images in every list by counting what is better, int32 [J, len(images)]."""
    mine = scores[:, images]
    ranks = np.empty(mine.shape, np.int64)
    for i in range(mine.shape[1]):
        ranks[:, i] = 1 + (scores > mine[:, [i]]).sum(axis=1)
    nothing = _rank_of_nothing(np.count_nonzero(scores, axis=1), scores.shape[1], unretrieved)
    return np.where(mine == 0, nothing[:, None], ranks).astype(np.int32)


def first_images(scores: NDArray[np.int64], n: int) -> NDArray[np.int32]:
    """Return the first ``n`` map ids of every list, by falling score, ties by id: int32 [J, min(n, M)]."""
    lists, images = scores.shape
    n = min(n, images)
    first = np.empty((lists, n), np.int32)
    for row, out in zip(scores, first, strict=True):
        found = np.flatnonzero(row)
        if len(found) > n > 0:
            found = found[row[found] >= np.partition(row[found], -n)[-n]]
        found = found[np.argsort(-row[found], kind="stable")][:n]
        out[: len(found)] = found
        if len(found) < n:
            out[len(found) :] = np.flatnonzero(row == 0)[: n - len(found)]
    return first
