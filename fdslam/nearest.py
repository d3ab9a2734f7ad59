"""How far descriptors are from their nearest ones in other images (§PC), to the last bit.

SIFTs are whole numbers up to 255, and of such numbers |q|² + |m|² - 2 q·m is exact in float32: every sum on the way is
a multiple of a half below 2²³. The matrix product therefore gives distances that depend neither on the order of its
sums nor on blocks and threads, and no difference has to be taken afterwards.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fdslam.progress import in_parallel

LENGTH = 128  # of a SIFT
# The distance to a map without features. SIFTs are non-negative with norm 512, each of 128 entries rounded by at most a
# half: no two are further apart. So a keypoint that nothing could explain is never below one that something could.
FARTHEST = math.sqrt(2) * (512 + math.sqrt(LENGTH) / 2)
BLOCK = 512  # map descriptors in one matrix product: with 1,500 of a query its result stays in the second cache


def nearest_distance(
    query: NDArray[np.uint8], maps: Sequence[NDArray[np.uint8]], threads: int = 1
) -> NDArray[np.float32]:
    """Return the distance of each query descriptor to its nearest one in any of the map images.

    This is the LoC of a keypoint: the L2 distance to its nearest SIFT, minimum over the Y hypotheses. All map images
    are one blocked matrix product of [m, -|m|²/2] and [q, 1], of which the largest entry of each query is kept.

    Args:
        query: uint8 ``[n, 128]``.
        maps: of each hypothesis, uint8 ``[m_i, 128]``; m_i may be 0.
        threads: that share the blocks. Never changes a result.

    Returns:
        float32 ``[n]``, the exact distance rounded once, 0 where the query descriptor is in the map; ``FARTHEST`` if
        all m_i are 0.

    Raises:
        ValueError: not uint8 ``[…, 128]``.

    Source: the paper's §PC.
    """
    for rows in (query, *maps):
        if rows.dtype != np.uint8 or rows.ndim != 2 or rows.shape[1] != LENGTH:
            raise ValueError(f"descriptors of {rows.dtype} {list(rows.shape)}: uint8 [n, {LENGTH}] is needed")
    stacked = np.concatenate([np.empty((0, LENGTH), np.uint8), *maps])
    if not len(stacked) or not len(query):
        return np.full(len(query), FARTHEST, np.float32)
    augmented = np.ones((LENGTH + 1, len(query)), np.float32)
    augmented[:LENGTH] = query.T
    shares = np.array_split(stacked, min(threads, -(-len(stacked) // BLOCK)))
    if len(shares) == 1:
        best = _largest(augmented, stacked)
    else:
        best = np.max(list(in_parallel((partial(_largest, augmented, one) for one in shares), len(shares))), axis=0)
    return np.sqrt(_squares(augmented[:LENGTH].T) - 2 * best)


def _squares(rows: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.einsum("ij,ij->i", rows, rows)


def _largest(query: NDArray[np.float32], rows: NDArray[np.uint8]) -> NDArray[np.float32]:
    """Return the largest q·m - |m|²/2 over the rows m, float32 [n], of the columns [q, 1]."""
    size = min(BLOCK, len(rows))
    block, product = np.empty((size, LENGTH + 1), np.float32), np.empty((size, query.shape[1]), np.float32)
    best = np.full(query.shape[1], -np.inf, np.float32)
    for begin in range(0, len(rows), size):
        part = rows[begin : begin + size]
        m = block[: len(part)]
        m[:, :LENGTH] = part
        m[:, LENGTH] = _squares(m[:, :LENGTH]) / -2
        np.maximum(best, np.matmul(m, query, out=product[: len(part)]).max(axis=0), out=best)
    return best
