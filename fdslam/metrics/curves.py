"""How well LoC tells changed cells from unchanged ones, over all thresholds at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fdslam.metrics.scene import Scene


def thresholds(
    values: NDArray[np.floating], positive: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Count what is selected at every distinct value, taken as the threshold, from the largest down.

    Args:
        values: [n] LoC, no NaN. Sorted input costs no time.
        positive: [n] whether the cell is changed.

    Returns:
        (hits, selected), both [t]: changed cells, and all cells, at or above each threshold; t = 0 for n = 0.
    """
    order = np.argsort(-values, kind="stable")
    falling = values[order]
    ends = np.append(np.flatnonzero(falling[1:] != falling[:-1]) + 1, len(falling))[: len(falling)]
    return np.cumsum(positive[order], dtype=np.int64)[ends - 1], ends


def auroc(hits: NDArray[np.int64], selected: NDArray[np.int64]) -> float | None:
    """Return P(a changed cell has a larger LoC than an unchanged one), ties counting half; None without both kinds.

    Args:
        hits: [t] from ``thresholds``.
        selected: [t] from ``thresholds``.
    """
    changed = int(hits[-1]) if len(hits) else 0
    unchanged = int(selected[-1]) - changed if len(selected) else 0
    if not changed or not unchanged:
        return None
    false = selected - hits
    below = unchanged - (false + np.concatenate([[0], false[:-1]])) / 2  # unchanged cells below, ties half
    return float(np.diff(hits, prepend=0) @ below / (changed * unchanged))


def average_precision(hits: NDArray[np.int64], selected: NDArray[np.int64]) -> float | None:
    """Return Σ (recall step × precision) over the thresholds, as scikit-learn defines it; None without changed cells.

    Args:
        hits: [t] from ``thresholds``.
        selected: [t] from ``thresholds``.
    """
    if not len(hits) or not hits[-1]:
        return None
    return float(np.sum(np.diff(hits, prepend=0) * (hits / selected)) / hits[-1])


def f1_max(hits: NDArray[np.int64], selected: NDArray[np.int64]) -> float | None:
    """Return the largest F1 = 2 hits / (selected + changed) over the thresholds; None without changed cells.

    Args:
        hits: [t] from ``thresholds``.
        selected: [t] from ``thresholds``.
    """
    if not len(hits) or not hits[-1]:
        return None
    return float(np.max(2 * hits / (selected + hits[-1])))


def location_matrix(values: NDArray[np.floating], scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Compare the cells of every box with the same cells of every unchanged query.

    Args:
        values: [N] LoC of the scene's cells.
        scene: the queries and their objects.

    Returns:
        (a, valid), both [O, U]: a[o, u] = P(a positive cell of box o has a larger LoC than one of the same cells in
        the unchanged query u), ties half; valid where the grids have the same shape and the box has cells. Elsewhere
        a is 0. A map that is the same for both queries gives exactly ½.
    """
    objects = scene.objects
    shape = (len(objects.area), len(scene.unchanged))
    a, valid = np.zeros(shape), np.zeros(shape, dtype=bool)
    stacks = {}
    for grid in {scene.shapes[q] for q in objects.query}:
        same = np.array([u for u, q in enumerate(scene.unchanged) if scene.shapes[q] == grid], dtype=np.int64)
        cells_of = scene.starts[scene.unchanged[same]][:, None] + np.arange(grid[0] * grid[1])
        stacks[grid] = (same, values[cells_of])
    for o, (q, cells) in enumerate(zip(objects.query, objects.positive, strict=True)):
        same, maps = stacks[scene.shapes[q]]
        n = len(cells)
        if not n or not len(same):
            continue
        own, others = np.sort(values[cells]), maps[:, cells - scene.starts[q]]
        not_above = np.searchsorted(own, others, "left") + np.searchsorted(own, others, "right")  # twice: ties half
        a[o, same] = (2 * n * n - not_above.sum(axis=1)) / (2 * n * n)
        valid[o, same] = True
    return a, valid


def location_controlled_auroc(a: NDArray[np.float64], valid: NDArray[np.bool_]) -> float | None:
    """Return the mean over boxes of the mean over unchanged queries; None if no box can be compared.

    Where an object is in the image says much about change and nothing about understanding: any fixed map scores ½ here.

    Args:
        a: [O, U] from ``location_matrix``.
        valid: [O, U] from ``location_matrix``.
    """
    number = valid.sum(axis=1)
    usable = number > 0
    if not usable.any():
        return None
    return float(np.mean(a[usable].sum(axis=1) / number[usable]))
