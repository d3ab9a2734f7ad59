"""Top-X accuracy: which objects do the cells with the largest LoC find (§Performance).

The cells of all queries are sorted by falling LoC. Cells of equal LoC are ordered by a random key that depends only on
the seed, the query's name and the cell's place in its query. The first K = floor(N X / 100) cells are selected.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from fdslam.metrics.cells import at_least, cell_areas
from fdslam.metrics.scene import Scene

EIGHT = np.ones((3, 3), dtype=bool)  # neighbours of a cell: also across the corner


@dataclass(frozen=True, eq=False)
class Ranking:
    """One method's cells, sorted."""

    order: NDArray[np.integer]  # [N] cells by falling LoC, over all queries; int32 where that is enough
    position: NDArray[np.integer]  # [N] per cell its place in that order, 1 = largest LoC
    within: NDArray[np.integer]  # [N] per cell its place among the cells of its own query, 1 = largest LoC

    def tied(self, falling: NDArray[np.floating]) -> NDArray[np.integer]:
        """[N] per cell a rank, 1 to N, larger for a larger LoC, equal for equal LoC; ``falling``: LoC in the order."""
        first = np.arange(len(falling), dtype=self.order.dtype)
        first[1:][falling[1:] == falling[:-1]] = 0
        np.maximum.accumulate(first, out=first)
        ranks = np.empty_like(first)
        ranks[self.order] = len(falling) - first
        return ranks


def rank_cells(values: NDArray[np.floating], scene: Scene, seed: int) -> Ranking:
    """Sort the cells of all queries by falling LoC, ties in a seeded random order.

    Args:
        values: [N] LoC of the scene's cells, no NaN.
        scene: the queries.
        seed: of the order among equal values.

    Returns:
        The ranking. Its restriction to a query does not depend on the other queries.
    """
    by_chance = scene.by_chance(seed)
    order = by_chance[np.argsort(-values[by_chance], kind="stable")]
    numbers = np.arange(1, len(values) + 1, dtype=order.dtype)
    position, within = np.empty_like(order), np.empty_like(order)
    position[order] = numbers
    for begin, end in pairwise(scene.starts):
        own = within[begin:end]
        own[np.argsort(position[begin:end])] = numbers[: end - begin]
    return Ranking(order, position, within)


def cut(cells: NDArray[np.int64] | int, percent: int) -> NDArray[np.int64]:
    """Return K = floor(n X / 100) in integers: how many of ``cells`` cells the top ``percent`` are."""
    return np.asarray(cells, dtype=np.int64) * percent // 100


def needed_positions(place: NDArray[np.integer], scene: Scene, found: float) -> NDArray[np.int64]:
    """Return how many cells must be selected before each object is found.

    Coverage only grows with K, so one number per object answers for every X: it is found if and only if p_o <= K.

    Args:
        place: [N] per cell its place in the order of selection, 1 first (``Ranking.position`` or ``.within``).
        scene: the queries and their objects.
        found: the least share of a box's area inside the image that selected cells must cover, 0 to 1.

    Returns:
        [O] p_o: the smallest K that finds the object; N + 1 for a box without area inside the image: never.
    """
    objects = scene.objects
    needed = np.full(len(objects.area), len(place) + 1, dtype=np.int64)
    for o, (cells, overlap, area) in enumerate(zip(objects.cells, objects.overlap, objects.area, strict=True)):
        if area <= 0:
            continue
        by_place = np.argsort(place[cells])
        covered = np.concatenate([[0.0], np.cumsum(overlap[by_place])])
        enough = at_least(covered, area, found)
        if enough.any():
            needed[o] = np.concatenate([[0], place[cells][by_place]])[np.argmax(enough)]
    return needed


def prefix_counts(query: NDArray[np.integer], cuts: NDArray[np.int64], queries: int) -> NDArray[np.int64]:
    """Count the cells of every query among the first cells of an order.

    Args:
        query: [n] the query of each cell, in the order.
        cuts: [c] ascending, 0 to n.
        queries: their number Q.

    Returns:
        [c, Q] at [i, q] how many of the first ``cuts[i]`` cells belong to q.
    """
    counts = np.zeros((len(cuts), queries), dtype=np.int64)
    for i, (begin, end) in enumerate(pairwise([0, *cuts])):
        counts[i] = np.bincount(query[begin:end], minlength=queries)
    return np.cumsum(counts, axis=0, out=counts)


def found_by_iou(
    within: NDArray[np.integer], selected: NDArray[np.int64], scene: Scene, found: float
) -> NDArray[np.bool_]:
    """Tell which objects equal a connected component of the selected cells closely enough (criterion ``iou``).

    The selected cells of a query form 8-connected components, cut at the image. An object is found if its IoU with
    one of them is at least ``found``. This may be lost again as K grows, so it is computed for each selection.

    Args:
        within: [N] ``Ranking.within``.
        selected: [S, Q] in each of S selections, how many cells of each query are selected (its first ones).
        scene: the queries and their objects.
        found: the least IoU, 0 to 1.

    Returns:
        [S, O] bool.
    """
    objects = scene.objects
    result = np.zeros((len(selected), len(objects.area)), dtype=bool)
    for q in np.unique(objects.query):
        mine = np.flatnonzero((objects.query == q) & (objects.area > 0))
        numbers, back = np.unique(selected[:, q], return_inverse=True)
        table = np.array([_found_in_query(within, int(k), int(q), mine, scene, found) for k in numbers], dtype=bool)
        result[:, mine] = table.reshape(len(numbers), len(mine))[back.ravel()]
    return result


def _found_in_query(
    within: NDArray[np.integer], k: int, q: int, mine: NDArray[np.int64], scene: Scene, found: float
) -> list[bool]:
    """Tell which of the objects ``mine`` of query ``q`` are found by the components of its first ``k`` cells."""
    begin, end = scene.starts[q], scene.starts[q + 1]
    labels, count = ndimage.label(within[begin:end].reshape(scene.shapes[q]) <= k, structure=EIGHT)
    i = scene.by_name[q]
    flat, areas = labels.ravel(), cell_areas(scene.heights[i], scene.widths[i]).ravel()
    component = np.bincount(flat, weights=areas, minlength=count + 1)
    hits = []
    for o in mine:
        cells, overlap = scene.objects.cells[o] - begin, scene.objects.overlap[o]
        shared = np.bincount(flat[cells], weights=overlap, minlength=count + 1)
        union = component + scene.objects.area[o] - shared
        hits.append(bool(at_least(shared, union, found)[1:].any()))  # label 0: not selected
    return hits
