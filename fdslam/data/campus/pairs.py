"""Which images of a session are the queries of a pair, and how the protocol's numbers are shared out.

How the paper's numbers are read: its map database of 2,959 images is the images of the four sessions together, 740 or
739 each, and 986 + 1,973 = 2,959 is the number of queries of the twelve (query, map) pairs together: 986 images with
one annotated object each, and 1,973 distractors. An image of a session may be a query against each of the other three.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import permutations

import numpy as np
from numpy.typing import NDArray

from fdslam.data.campus.seasons import SESSIONS

PAIRS = tuple(permutations(SESSIONS, 2))  # (query, map)
_GOLDEN = (5**0.5 - 1) / 2


def shares(total: int, parts: Sequence[str] | Sequence[tuple[str, str]]) -> dict:
    """Return how many of ``total`` each part gets: all alike, but for one more each for the first parts."""
    return {part: total // len(parts) + (k < total % len(parts)) for k, part in enumerate(parts)}


def choose(annotated: NDArray[np.int64], visible: NDArray[np.int64], objects: int, distractors: int) -> list[int]:
    """Choose the queries of a pair among the images of its query session.

    Images with change are taken by how few annotated objects they have, those with one first; whatever is taken is
    spread over the path. Where there are not enough, all are taken that there are.

    Args:
        annotated: [n] annotated changes in each image of the session.
        visible: [n] changes of which anything is to be seen in it.
        objects: how many annotated objects are wanted; never more are given.
        distractors: how many images without any change are wanted.

    Returns:
        Indices of images, ascending.
    """
    chosen, left = [], objects
    for count in np.unique(annotated[annotated > 0]):
        for i in _spread(np.flatnonzero(annotated == count)):
            if count <= left:
                chosen.append(i)
                left -= int(count)
    rest = np.setdiff1d(np.flatnonzero(annotated), chosen)
    for k, i in enumerate(chosen if left else ()):
        fitting = rest[annotated[rest] - annotated[i] == left]
        if len(fitting):  # one object is wanted still, say, and only images with two are left: one for one with one
            chosen[k] = int(fitting[0])
            break
    return sorted(chosen + _spread(np.flatnonzero(visible == 0))[:distractors])


def _spread(indices: NDArray[np.int64]) -> list[int]:
    """Return the indices in an order whose beginnings are spread over all of them (multiples of the golden ratio)."""
    return indices[np.argsort(np.arange(len(indices)) * _GOLDEN % 1)].tolist()
