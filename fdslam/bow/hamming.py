"""Hamming distances of 256-bit descriptors by native popcount: the inner loops of the word search.

Descriptors lie in groups of eight, transposed: the first 64 bits of all eight, then the second, … One vector register
then holds a quarter of eight descriptors, and no distance needs a sum across it. Nearest neighbours are found as keys,
``distance << 32 | id`` in uint64: the smallest key is the nearest, ties go to the smaller id, and the order in which
groups are visited cannot change the result. A place that holds nothing has id -1, which makes its key the largest.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.native import NATIVE

GROUP = 8  # descriptors in a group
NONE = np.uint64(0xFFFFFFFFFFFFFFFF)  # the key of nothing
_LOW = np.uint64(0xFFFFFFFF)
_TILE = 64  # groups: 16 KB of descriptors stay in the first cache while every query visits them
Keys = NDArray[np.uint64]

if NATIVE:
    from fdslam.bow.kernels import two_nearest_kernel


def pack(
    descriptors: NDArray[np.uint8], names: NDArray[np.int32] | None = None
) -> tuple[NDArray[np.uint64], NDArray[np.int32]]:
    """Return descriptors (uint8 [n, 32]) as groups (uint64 [g · 32]) and their ids (int32 [g · 8], else -1).

    The ids are ``names`` (int32 [n]), or 0 … n-1.
    """
    groups = -(-len(descriptors) // GROUP)
    padded = np.zeros((groups * GROUP, 4), np.uint64)
    padded[: len(descriptors)] = np.ascontiguousarray(descriptors).view(np.uint64)
    ids = np.full(groups * GROUP, -1, np.int32)
    ids[: len(descriptors)] = np.arange(len(descriptors), dtype=np.int32) if names is None else names
    return np.ascontiguousarray(padded.reshape(groups, GROUP, 4).transpose(0, 2, 1)).reshape(-1), ids


def flat(descriptors: NDArray[np.uint8]) -> NDArray[np.uint64]:
    """Return descriptors (uint8 [n, 32]) as kernels take queries: uint64 [4 n]."""
    return np.ascontiguousarray(descriptors).view(np.uint64).reshape(-1)


def unpack(groups: NDArray[np.uint64]) -> NDArray[np.uint8]:
    """Return the descriptors of groups (uint64 [g · 32]), those of empty places too: uint8 [g · 8, 32]."""
    rows = np.ascontiguousarray(groups.reshape(-1, 4, GROUP).transpose(0, 2, 1))
    return rows.reshape(-1, 4).view(np.uint8)


def distances(queries: NDArray[np.uint8], descriptors: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Return the Hamming distance of every pair, int64 [n, m], without compiled kernels."""
    q, d = (np.ascontiguousarray(rows).view(np.uint64) for rows in (queries, descriptors))
    result = np.zeros((len(q), len(d)), np.int64)
    for part in range(4):
        result += np.bitwise_count(q[:, part, None] ^ d[None, :, part])
    return result


def keys_of(distance: NDArray[np.int64], ids: NDArray[np.int32]) -> Keys:
    """Return ``distance << 32 | id`` as uint64 [n, m]; NONE where the id is -1."""
    keys = (distance.astype(np.uint64) << np.uint64(32)) | ids.astype(np.uint64)
    return np.where(ids < 0, NONE, keys)


def two_smallest(keys: Keys) -> Keys:
    """Return the smallest two of each row, ascending: uint64 [n, 2]; NONE where there are fewer."""
    padded = np.concatenate([keys, np.full((len(keys), 2), NONE)], axis=1)
    return np.sort(np.partition(padded, 1, axis=1)[:, :2], axis=1)


def without(keys: Keys, leave: NDArray[np.int32] | None) -> Keys:
    """Return keys (uint64 [n, m]) with NONE where the id is in its row's interval (int32 [n, 2], half-open)."""
    if leave is None:
        return keys
    names = id_of(keys)
    return np.where((leave[:, [0]] <= names) & (names < leave[:, [1]]), NONE, keys)


def two_nearest_keys(
    groups: NDArray[np.uint64],
    ids: NDArray[np.int32],
    queries: NDArray[np.uint8],
    leave: NDArray[np.int32] | None = None,
) -> Keys:
    """Return the keys of the two nearest descriptors of each query, uint64 [n, 2], ascending.

    ``leave`` (int32 [n, 2]) gives each query a half-open interval of ids that are passed over.
    """
    if NATIVE:
        out = np.full((len(queries), 2), NONE)
        two_nearest_kernel(groups, ids, flat(queries), leave, out.reshape(-1))
        return out
    rows = unpack(groups)
    best = np.full((len(queries), 2), NONE)
    for begin in range(0, len(ids), GROUP * _TILE):  # a tile at a time, so that memory stays bounded
        part = slice(begin, begin + GROUP * _TILE)
        found = without(keys_of(distances(queries, rows[part]), ids[part]), leave)
        best = two_smallest(np.concatenate([best, found], axis=1))
    return best


def id_of(keys: Keys) -> NDArray[np.int64]:
    """Return the ids of keys, int64 of the same shape; -1 for NONE."""
    return np.where(keys == NONE, -1, (keys & _LOW).astype(np.int64))


def distance_of(keys: Keys) -> NDArray[np.int64]:
    """Return the distances of keys, int64 of the same shape; far beyond 256 for NONE."""
    return (keys >> np.uint64(32)).astype(np.int64)


def two_nearest(
    descriptors: NDArray[np.uint8], words: NDArray[np.uint8]
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Return the distances and indices of the two nearest of ``words`` (uint8 [m, 32]) to each of the descriptors.

    Returns:
        distance and index, int32 [n, 2] each, nearest first, ties by smaller index; index -1 (and a distance beyond
        any real one) where there are fewer than two words.
    """
    keys = two_nearest_keys(*pack(words), descriptors)
    far = np.minimum(distance_of(keys), np.iinfo(np.int32).max)
    return far.astype(np.int32), id_of(keys).astype(np.int32)
