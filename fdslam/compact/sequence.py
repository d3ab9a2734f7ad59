"""Consecutive queries vouch for each other: what those before have found is laid over the present one (future work)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fdslam.bow.verification import supporting_matches
from fdslam.compact.alignment import LEAST
from fdslam.compact.flow import flow
from fdslam.compact.grid import Grid, read_at
from fdslam.types import CELL, Cells, Features, grid_shape


def pooled(
    loc: Sequence[Cells], sizes: Sequence[tuple[int, int]], keypoints: Callable[[int], Features], previous: int
) -> list[Cells]:
    """Return the LoC of every query averaged with that of the queries before it, where those saw the same.

    A query before is aligned with the present one by their keypoints, as map images are. It counts in a cell by how
    many agreeing keypoints are near: not at all where nothing is known, and hardly less than the present one where
    much is. One that does not fit as one rigid scene, as of another drive, does not count.

    Args:
        loc: of every query, float32 [rows, cols], in the order in which they were taken.
        sizes: height and width of each, pixels.
        keypoints: from the number of a query to its keypoints.
        previous: how many queries before the present one are looked at; 0 changes nothing.
    """
    return [
        _pooled(loc, sizes, keypoints, query, range(max(0, query - previous), query)) if previous else loc[query]
        for query in range(len(loc))
    ]


def _pooled(
    loc: Sequence[Cells],
    sizes: Sequence[tuple[int, int]],
    keypoints: Callable[[int], Features],
    query: int,
    before: Sequence[int],
) -> Cells:
    own = keypoints(query)
    rows, cols = loc[query].shape
    centres = Grid(rows, cols, CELL, CELL).centres()
    total, weights = loc[query].astype(np.float64), np.ones((rows, cols))
    for other in before:
        theirs = keypoints(other)
        mine, partners = supporting_matches(own, theirs, LEAST)
        found = flow(own.xy[mine], theirs.xy[partners], *sizes[query])
        at = found.at(centres)
        height, width = sizes[other]
        grid = Grid(*grid_shape(height, width), CELL, CELL)
        inside = ((at >= 0) & (at < (width, height))).all(axis=1)
        near = found.confidence(centres)[:, 0]
        weight = (inside * near / (near + 1)).reshape(rows, cols)
        seen = read_at(loc[other][..., None], grid.places(at))
        total += weight * seen.reshape(rows, cols)
        weights += weight
    return (total / weights).astype(np.float32)
