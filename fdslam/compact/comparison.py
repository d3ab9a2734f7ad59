"""Compact comparison: how unlike the map a query looks, by Hamming distances around the predicted places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fdslam.compact.grid import Grid
from fdslam.compact.signs import Signs

NOWHERE = np.iinfo(np.int32).max  # bits: no descriptor of the map image is around
_EXACT = 1e-9  # of a cell: what rounding may take from a place that is exactly ``reach`` away


@dataclass(frozen=True)
class Around:
    """Distances of each descriptor of a query to those of a map image around its predicted place."""

    smallest: NDArray[np.int32]  # [rows, cols] bits; NOWHERE where the map image does not reach that place
    mean: NDArray[np.float32]  # [rows, cols] bits, over all that are around; 0 where none is


def around(query: Signs, image: Signs, grid: Grid, at: NDArray[np.floating], reach: float) -> Around:
    """Compare a query's descriptors with those of a map image around where they should be seen.

    Args:
        query: uint64 [rows, cols, words].
        image: uint64 [rows', cols', words], of the map image.
        grid: where those lie in the map image.
        at: [rows · cols, 2] pixels of the map image, where the query's descriptors should be seen.
        reach: pixels, how far in x and in y from there they are looked for; exactly this far counts.
    """
    rows, cols, words = query.shape
    ours, theirs = query.reshape(-1, words), image.reshape(-1, words)
    place = grid.places(at)
    span = np.array([reach / grid.step_x, reach / grid.step_y])
    first = np.ceil(place - span - _EXACT).astype(np.int64)
    last = np.floor(place + span + _EXACT).astype(np.int64)
    best, total = np.full(len(ours), NOWHERE, np.int32), np.zeros(len(ours), np.int64)
    count = np.zeros(len(ours), np.int64)
    for dy in range(int(2 * span[1]) + 2):
        row = first[:, 1] + dy
        in_rows = (row >= 0) & (row < image.shape[0]) & (row <= last[:, 1])
        for dx in range(int(2 * span[0]) + 2):
            col = first[:, 0] + dx
            chosen = np.flatnonzero(in_rows & (col >= 0) & (col < image.shape[1]) & (col <= last[:, 0]))
            there = row[chosen] * image.shape[1] + col[chosen]
            distance = np.zeros(len(chosen), np.int32)
            for word in range(words):  # a sum along so short an axis takes longer than all the rest
                distance += np.bitwise_count(ours[chosen, word] ^ theirs[there, word])
            best[chosen] = np.minimum(best[chosen], distance)
            total[chosen] += distance
            count[chosen] += 1
    mean = (total / np.maximum(count, 1)).astype(np.float32)
    return Around(best.reshape(rows, cols), mean.reshape(rows, cols))
